"""The command ``artgs``, executed in this process."""

import os
import shutil
import signal
import sys
from pathlib import Path

from artgs import _native


def main() -> None:
    """Executes the command line of this process and exits with its exit code."""
    # As in a program that is not Python: Ctrl-C ends it at once, unless the command handles it.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    # Mesa's drivers otherwise ask a display which device is best.
    os.environ.setdefault("NODEVICE_SELECT", "1")
    sys.exit(_native.command(_program(), ["artgs", *sys.argv[1:]]))


def _program() -> Path:
    """The script that was started, or the one of the package if there is none: `bench` starts it for every run."""
    if os.access(sys.argv[0], os.X_OK):
        return Path(sys.argv[0])
    beside = Path(sys.executable).parent / "artgs"
    return beside if beside.exists() else Path(shutil.which("artgs") or "artgs")
