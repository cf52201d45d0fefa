"""The command `armcal`."""

import signal
import sys

from armcal import _armcal


def main() -> int:
    """Runs the command line of this process."""
    # As in a program of its own: Ctrl-C and a closed pipe are the command's to hear.
    for name in ("SIGINT", "SIGPIPE"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_DFL)
    return _armcal.main(["armcal", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
