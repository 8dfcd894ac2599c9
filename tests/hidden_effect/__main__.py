"""Make one campaign: python -m tests.hidden_effect SEED FOLDER TRUTH_FOLDER."""

import argparse
import os
from pathlib import Path

# The matrices are small: a second thread makes them slower, and sums in another order.
os.environ.setdefault("OMP_NUM_THREADS", "1")


def main() -> None:
    """Read the command line and make the campaign."""
    from tests.hidden_effect.campaign import make_campaign  # after the number of threads is set

    parser = argparse.ArgumentParser(prog="python -m tests.hidden_effect", description=__doc__)
    parser.add_argument("seed", type=int, help="seed of the campaign; design.py has those of calibration and test")
    parser.add_argument("folder", type=Path, help="folder for what the shop has")
    parser.add_argument("truth_folder", type=Path, help="folder for the truth, apart from it")
    arguments = parser.parse_args()
    make_campaign(arguments.seed, arguments.folder, arguments.truth_folder)


if __name__ == "__main__":
    main()
