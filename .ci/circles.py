#!/usr/bin/env python3
"""Counts the modules of each crate that import each other in a circle; fails if there are more than before.

A module is a file or folder directly below `src`. Imports of tests are not counted. A crate without circles reads from the bottom
to the top: to understand a file, one reads only what is below it."""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
# What is left. Numbers only go down.
ALLOWED = {"artgs": 5, "artgs-bench": 3, "artgs-gpu": 8, "artgs-io": 4, "artgs-synth": 7}


def imports(text, modules):
    """Modules of the crate that a file names."""
    text = text.split("#[cfg(test)]\nmod tests {")[0]
    named = set(re.findall(r"\bcrate::(\w+)", text))
    for group in re.findall(r"use crate::\{(.*?)\};", text, re.S):
        depth, word = 0, ""
        for letter in group + ",":
            depth += {"{": 1, "}": -1}.get(letter, 0)
            if letter == "," and depth == 0:
                named.update(re.findall(r"^\s*(\w+)", word))
                word = ""
            else:
                word += letter
    return named & modules


def graph(source):
    """Imports of each module."""
    files = [path for path in source.rglob("*.rs") if not path.stem.endswith("tests") and path.stem not in ("lib", "main")]
    module = lambda path: path.relative_to(source).parts[0].removesuffix(".rs")
    modules = {module(path) for path in files}
    found = {name: set() for name in modules}
    for path in files:
        found[module(path)] |= imports(path.read_text(encoding="utf-8"), modules) - {module(path)}
    return found


def in_circles(found):
    """Modules that can be reached from themselves."""
    def reached(start):
        seen, waiting = set(), list(found[start])
        while waiting:
            name = waiting.pop()
            if name not in seen:
                seen.add(name)
                waiting += found[name]
        return seen

    return sorted(name for name in found if name in reached(name))


def main():
    failed = False
    for crate in sorted((ROOT / "crates").iterdir()):
        found = graph(crate / "src")
        circle, allowed = in_circles(found), ALLOWED.get(crate.name, 0)
        print(f"{crate.name}: {len(circle)} of {len(found)} modules in circles{': ' if circle else ''}{', '.join(circle)}")
        if len(circle) > allowed:
            print(f"{crate.name}: at most {allowed} were there before; move what both need below both", file=sys.stderr)
            failed = True
    sys.exit(failed)


if __name__ == "__main__":
    main()
