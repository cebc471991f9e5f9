"""The command `ifg`."""

import sys

from . import _ifgarments as _native


def main() -> None:
    """Runs ``ifg`` with the arguments of the process, and exits with its code."""
    sys.exit(_native.ifg(sys.argv))
