"""The command `ifg`."""

import signal
import sys

from . import _ifgarments as _native


def main() -> None:
    """Runs ``ifg`` with the arguments of the process, and exits with its code."""
    # The native part ends on Ctrl-C itself, unless it is ignored (nohup).
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.exit(_native.ifg(sys.argv))
