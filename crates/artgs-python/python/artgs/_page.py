"""The viewer as a page that is complete in itself."""

from __future__ import annotations

import html
import sys
import tempfile
import webbrowser
from importlib import import_module
from pathlib import Path
from typing import Any

from artgs import _native


def page_of(folder: Path) -> str:
    """The page of a replica, HTML."""
    return _native.page(folder)


def show(folder: Path, height: int) -> None:
    """Shows the page of a replica in the notebook that executes this, or else in a browser."""
    shell = _shell()
    if shell is None:
        # The browser reads it after this function has returned.
        target = Path(tempfile.mkdtemp(prefix="artgs-")) / "page.html"
        target.write_text(page_of(folder), encoding="utf-8")
        webbrowser.open(target.as_uri())
        return
    shown: Any = import_module("IPython.display")
    # `IPython.display.HTML` warns of every frame.
    shown.display({"text/html": frame(page_of(folder), height), "text/plain": f"viewer of {folder}"}, raw=True)


def frame(page: str, height: int) -> str:
    """A page as an element of another one."""
    return f'<iframe srcdoc="{html.escape(page)}" style="width: 100%; height: {height}px; border: 0"></iframe>'


def _shell() -> Any:
    """The kernel of a notebook; None elsewhere."""
    # Imported already in a notebook.
    module: Any = sys.modules.get("IPython")
    shell: Any = None if module is None else module.get_ipython()
    return shell if shell is not None and hasattr(shell, "kernel") else None
