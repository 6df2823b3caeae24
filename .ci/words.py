#!/usr/bin/env python3
"""Checks that tracked text uses plain technical English: `.ci/words.py [PATH...]`.

Reads the words from `.ci/words.txt` and searches every tracked source file, document and script for them, in comments,
strings and identifiers (`told_parts` and `ToldParts` contain `told`). Exit code 1 if a word is found.
"""

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SUFFIXES = {".rs", ".wgsl", ".md", ".ts", ".mjs", ".html", ".css", ".py", ".toml", ".sh", ".yml", ".txt"}
SKIPPED = (".ci/words", "crates/artgs-view/dist/", "viewer/package-lock.json", "Cargo.lock", "LICENSE")


def load_rules():
    """Pairs of (pattern, advice), and allowed (path, text) pairs."""
    rules, allowed = [], set()
    for line in (ROOT / ".ci/words.txt").read_text().splitlines():
        line = line.strip()
        if not line or line.startswith("#"):
            continue
        if line.startswith("allow "):
            _, path, text = line.split(maxsplit=2)
            allowed.add((path, text.lower()))
            continue
        words, _, advice = line.partition(" -> ")
        for word in words.split(","):
            rules.append((word.strip().lower(), advice.strip()))
    return rules, allowed


def spaced(line):
    """The line in lower case with identifiers split into words, separators collapsed to single spaces."""
    line = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", " ", line)
    return " " + re.sub(r"[^a-z0-9']+", " ", line.lower()) + " "


def tracked(paths):
    listed = subprocess.run(["git", "ls-files", "-co", "--exclude-standard", "--", *paths], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in listed.splitlines():
        path = ROOT / name
        wanted = path.suffix in SUFFIXES or name == ".ci/run"
        if wanted and path.is_file() and not name.startswith(SKIPPED):
            yield name, path


def main():
    rules, allowed = load_rules()
    found = 0
    for name, path in tracked(sys.argv[1:]):
        for number, line in enumerate(path.read_text(errors="replace").splitlines(), 1):
            text = spaced(line)
            for word, advice in rules:
                if f" {word} " in text and (name, word) not in allowed:
                    found += 1
                    print(f"{name}:{number}: `{word}`: {advice}")
    if found:
        print(f"{found} words of .ci/words.txt found", file=sys.stderr)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
