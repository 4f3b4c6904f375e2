"""The program ``limpid``: ``python -m limpid render water.vtu``."""

import os
import signal
import sys

from . import _limpid


def main() -> None:
    """Runs the program with the arguments of the process."""
    os.environ.setdefault("NODEVICE_SELECT", "1")
    # The program handles signals itself, and would call Python's handler too.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.exit(_limpid.main(["limpid", *sys.argv[1:]]))


if __name__ == "__main__":
    main()
