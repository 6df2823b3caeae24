#!/usr/bin/env python3
"""Runs notebooks: `.ci/notebooks.py NOTEBOOKS FOLDER`.

Every notebook of the folder NOTEBOOKS runs in FOLDER, in the order of the names, with this interpreter. A copy with its outputs is written
there; those in NOTEBOOKS must have none. Settings of notebooks are environment variables, `ARTGS_CAPTURE` and others. Exit code 1 if one fails.
"""

import sys
import time
from pathlib import Path

import nbformat
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError

notebooks, folder = map(Path, sys.argv[1:])
files = sorted(notebooks.glob("*.ipynb"))
failed = not files
folder.mkdir(parents=True, exist_ok=True)
for file in files:
    notebook = nbformat.read(file, as_version=4)
    nbformat.validate(notebook)
    if any(cell.get("outputs") or cell.get("execution_count") for cell in notebook.cells):
        print(f"{file}: has outputs; clear them before a commit")
        failed = True
    begun = time.monotonic()
    client = NotebookClient(notebook, timeout=600, kernel_name="python3", resources={"metadata": {"path": str(folder)}})
    try:
        client.execute()
        print(f"{file}: passed in {time.monotonic() - begun:.0f} s", flush=True)
    except CellExecutionError as error:
        print(f"{file}: failed\n{error}", flush=True)
        failed = True
    nbformat.write(notebook, folder / file.name)
sys.exit(failed)
