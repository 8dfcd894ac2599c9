"""``make s3``: a study in an object store, from an empty bucket to a report, on a server of this machine."""

import os
import subprocess
import sys
from tempfile import TemporaryDirectory

from tests.object_server.server import Buckets, environment, serving

BUCKET = "milling"
STORE = f"store=s3://{BUCKET}/smoke"


def main(words: list[str]) -> int:
    """Run the smoke study, run it again from elsewhere, look at it and read it back; return the first bad exit code."""
    buckets = Buckets({BUCKET: {}})
    with serving(buckets) as endpoint, TemporaryDirectory(prefix="chatter-") as elsewhere:
        print(f"an S3-speaking server listens at {endpoint}, with an empty bucket {BUCKET}")
        steps = (
            ["sweep", "study=smoke", STORE, "output=results/objects", *words],
            ["sweep", "study=smoke", STORE, f"output={elsewhere}/other_machine", *words],
            ["status", STORE],
            ["verify", STORE],
        )
        for step in steps:
            print(f"\n$ python -m pipeline {' '.join(step)}", flush=True)
            code = subprocess.run(
                [sys.executable, "-m", "pipeline", *step], env={**os.environ, **environment(endpoint)}, check=False
            ).returncode
            if code:
                return code
        kept = buckets.kept[BUCKET]
        print(f"\nin the bucket: {len(kept)} objects, {sum(len(one.content) for one in kept.values())} bytes")
        print("\n".join(sorted({"/".join(key.split("/")[:2]) for key in kept})))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
