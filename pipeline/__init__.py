"""Config-driven runs of the chain: sweeps on Dask into Zarr, and what is made of them."""

import os

# One thread a process for the linear algebra: a worker pool oversubscribes the cores many times
# otherwise. It must be said before numpy is imported for the first time.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
