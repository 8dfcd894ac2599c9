"""Commands that stand in for those of PBS: a job is a process group on this machine, its number that of the group."""

import os
from pathlib import Path

SCRIPTS = {
    # The script is gone when the command has answered.
    "qsub": """
cp "$1" "$PBS_STANDIN/script-$$"
setsid bash "$PBS_STANDIN/script-$$" > "$PBS_STANDIN/said-$$" 2>&1 < /dev/null &
touch "$PBS_STANDIN/job-$!"
echo "$!.standin"
""",
    "qdel": """
kill -TERM -- "-$1"
""",
    "qselect": """
for file in "$PBS_STANDIN"/job-*; do
    number="${file##*-}"
    if kill -0 -- "-$number" 2> /dev/null; then echo "$number.standin"; fi
done
""",
}


def install(folder: Path) -> dict[str, str]:
    """Write the commands into a folder and return the environment in which they are found."""
    for name, script in SCRIPTS.items():
        file = folder / name
        file.write_text(f"#!/bin/bash{script}")
        file.chmod(0o755)
    return {"PATH": f"{folder}{os.pathsep}{os.environ['PATH']}", "PBS_STANDIN": str(folder)}
