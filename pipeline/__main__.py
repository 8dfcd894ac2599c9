"""Command line: ``chatter VERB key=value ...``, or ``python -m pipeline VERB key=value ...``."""

import sys
from importlib import import_module


def main() -> int:
    """Run the command line and return the exit code; Ctrl-C is answered while its modules are loaded, too."""
    try:
        command_line = import_module("pipeline.command_line")
    except KeyboardInterrupt:
        sys.stderr.write("stopped at once\n")
        return 130
    code: int = command_line.main()
    return code


if __name__ == "__main__":
    sys.exit(main())
