#!/usr/bin/env python3
"""Runs the Python examples of a document: `.ci/snippets.py DOCUMENT FOLDER`.

Every block of language `python` runs in FOLDER with this interpreter, each in a process of its own. Blocks of `python,ignore` are
left out. Exit code 1 if one fails or if there is none.
"""

import re
import subprocess
import sys
from pathlib import Path

document, folder = map(Path, sys.argv[1:])
blocks = list(re.finditer(r"^```python\n(.*?)^```$", document.read_text(), re.MULTILINE | re.DOTALL))
failed = not blocks
for block in blocks:
    line = document.read_text()[: block.start()].count("\n") + 2
    done = subprocess.run([sys.executable, "-c", block[1]], cwd=folder, capture_output=True, text=True, timeout=600)
    print(f"{document}:{line}: {'failed' if done.returncode else 'passed'}\n{done.stdout}{done.stderr if done.returncode else ''}")
    failed |= done.returncode != 0
sys.exit(failed)
