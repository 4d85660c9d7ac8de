"""The program: `decoupler` opens the window, `decoupler COMMAND` works in the terminal."""

import signal
import sys

from ._native import run_program


def main() -> int:
    """Run the program with the arguments of the command line, and return its exit status."""
    # The program handles Ctrl-C itself; Python's handler would only set a flag.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    # Writing to a closed pipe ends in an error that the program handles; Python has this default.
    return run_program(["decoupler", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
