"""``python -m ifgarments`` is the command ``ifg``."""

from ._command import main

main()
