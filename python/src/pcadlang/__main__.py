"""The `pcadlang` command: `python -m pcadlang run human.pcad --observe img.png`."""

import signal
import sys

from pcadlang._native import command


def main() -> int:
    """Runs the command with the arguments of this process."""
    # The command handles Ctrl-C itself; Python would only see it when the command has ended.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return command(sys.argv[1:])


if __name__ == "__main__":
    sys.exit(main())
