"""The program ``limpid``: ``python -m limpid render water.vtu``."""

import os
import sys

from . import _limpid


def main() -> None:
    """Runs the program with the arguments of the process."""
    os.environ.setdefault("NODEVICE_SELECT", "1")
    sys.exit(_limpid.main(["limpid", *sys.argv[1:]]))


if __name__ == "__main__":
    main()
