"""``python -m artgs`` is the command ``artgs``."""

from artgs._command import main

main()
