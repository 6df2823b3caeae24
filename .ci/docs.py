#!/usr/bin/env python3
"""Checks the documents against the repository, without a network: `.ci/docs.py [--book DIR] [--program artgs]`.

* Relative links and pictures of every tracked Markdown file lead to files and headings that exist.
* With `--book`: so do those of the built book.
* Every message that `docs/src/troubleshooting.md` explains (its headings) is in the sources.
* Every Rust excerpt of `docs/src/library.md` stands in an example of the library, which is compiled.
* With `--program`: `artgs` commands in the documents use subcommands and options that exist.

Exit code 1 if anything is wrong.
"""

import argparse
import html.parser
import re
import subprocess
import sys
from functools import cache
from pathlib import Path
from urllib.parse import unquote, urlsplit

ROOT = Path(__file__).resolve().parent.parent
FENCE = re.compile(r"^ *```.*?^ *```\s*$", re.MULTILINE | re.DOTALL)
TROUBLESHOOTING = "docs/src/troubleshooting.md"
LIBRARY = "docs/src/library.md"


def markdown_files():
    listed = subprocess.run(
        ["git", "ls-files", "-co", "--exclude-standard", "*.md"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    return [name for name in listed.stdout.splitlines() if (ROOT / name).is_file()]


@cache
def text_of(path):
    """Markdown with `{{#include FILE}}` and `{{#include FILE:ANCHOR}}` replaced, as mdBook does."""

    def included(match):
        text = (path.parent / match[1]).resolve().read_text()
        if match[2]:
            text = text.split(f"<!-- ANCHOR: {match[2]} -->")[1].split(f"<!-- ANCHOR_END: {match[2]} -->")[0]
        return text

    return re.sub(r"\{\{#include ([^}:]+)(?::(\w+))?\}\}", included, path.read_text())


@cache
def anchors_of(path):
    """Identifiers of the headings of a Markdown file, as GitHub and mdBook derive them."""
    found = set()
    for title in re.findall(r"^#+ (.*)$", FENCE.sub("", text_of(path)), re.MULTILINE):
        title = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", title).strip().lower()
        slug = re.sub(r"[^\w\- ]", "", title).replace(" ", "-")
        number = 0
        while (f"{slug}-{number}" if number else slug) in found:
            number += 1
        found.add(f"{slug}-{number}" if number else slug)
    return found


def excerpts_not_in_examples():
    """Rust excerpts of the page on the library of which no example has the lines, apart from their indentation."""

    def lines(text):
        return "\n".join(line.strip() for line in text.splitlines() if line.strip())

    examples = [lines(path.read_text()) for path in sorted((ROOT / "crates/artgs/examples").glob("*.rs"))]
    for block in re.finditer(r"^```rust\n(.*?)^```$", (ROOT / LIBRARY).read_text(), re.MULTILINE | re.DOTALL):
        if not any(lines(block[1]) in example for example in examples):
            yield f"{LIBRARY}: no example has the excerpt that begins with `{block[1].splitlines()[0]}`"


def wrong_links(name):
    path = ROOT / name
    text = re.sub(r"`[^`\n]*`", "", FENCE.sub("", text_of(path)))
    targets = re.findall(r"\]\(([^)\s]+)\)", text) + re.findall(r"^\[[^]]+\]: (\S+)$", text, re.MULTILINE)
    defined = {key.lower() for key in re.findall(r"^\[([^]]+)\]: ", text, re.MULTILINE)}
    for key in re.findall(r"\]\[([^]]+)\]", text):
        if key.lower() not in defined:
            yield f"{name}: [{key}] is not defined"
    for target in targets:
        parts = urlsplit(target)
        if parts.scheme:
            continue
        file = (path.parent / unquote(parts.path)).resolve() if parts.path else path
        if not file.is_relative_to(ROOT) or not file.exists():
            yield f"{name}: {target}: no such file"
        elif parts.fragment and file.suffix == ".md" and parts.fragment not in anchors_of(file):
            yield f"{name}: {target}: no such heading"


class Page(html.parser.HTMLParser):
    """Identifiers and local targets of a page."""

    def __init__(self, path):
        super().__init__()
        self.ids, self.targets = set(), []
        self.feed(path.read_text())

    def handle_starttag(self, tag, attributes):
        for key, value in attributes:
            if key == "id":
                self.ids.add(value)
            elif key in ("href", "src") and value and not urlsplit(value).scheme and not value.startswith("//"):
                self.targets.append(value)


def wrong_pages(book):
    pages = {path.resolve(): Page(path) for path in sorted(book.rglob("*.html"))}
    if not pages:
        yield f"{book}: no book; build it with `mdbook build docs`"
    for path, page in pages.items():
        # Its links are absolute, for a server.
        if path.name == "404.html":
            continue
        for target in page.targets:
            parts = urlsplit(target)
            file = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if not file.exists():
                yield f"{path.name}: {target}: no such file in the book"
            elif parts.fragment and file in pages and unquote(parts.fragment) not in pages[file].ids:
                yield f"{path.name}: {target}: no such heading in the book"


def squeezed(text):
    """Words of a message: placeholders, quotes and spacing do not count."""
    return " ".join(re.findall(r"[\w.=-]+", re.sub(r"\{[\w.:?!-]*\}|…|\\n", " ", text)))


def wrong_messages():
    """Headings of level 3 are messages, with `…` for what varies; each piece must be in a string of the sources."""
    sources = []
    for path in sorted((ROOT / "crates").glob("*/src/**/*.rs")):
        # A backslash at the end of a line continues a string.
        sources.append(squeezed(re.sub(r"\\\n\s*", "", path.read_text())))
    for heading in re.findall(r"^### (.*)$", (ROOT / TROUBLESHOOTING).read_text(), re.MULTILINE):
        pieces = [p for p in (squeezed(p) for p in heading.replace("`", "").split("…")) if len(p) > 3]
        if not any(all(piece in source for piece in pieces) for source in sources):
            yield f"{TROUBLESHOOTING}: no source holds the message: {heading}"


def wrong_commands(program, names):
    def help_of(*words):
        return subprocess.run([program, *words, "--help"], capture_output=True, text=True, check=True).stdout

    known = {}
    for command in re.findall(r"^  ([a-z]+) ", help_of().split("Commands:")[1], re.MULTILINE):
        known[command] = set(re.findall(r"--[a-z-]+", help_of(command) if command != "help" else ""))
    for name in names:
        text = text_of(ROOT / name).replace("\\\n", " ")
        fenced = "\n".join(FENCE.findall(text) + re.findall(r"^    .*$", text, re.MULTILINE))
        # One line may hold several commands: `artgs export X && artgs evaluate X`.
        for line in re.findall(r"(?:^ *|[;&|] *)artgs ([^#;&|\n]*)", fenced, re.MULTILINE) + re.findall(r"`artgs ([^`]*)`", text):
            words = line.split()
            command = next((w for w in words if not w.startswith("-")), "")
            if command and re.fullmatch("[a-z]+", command) and command not in known:
                yield f"{name}: artgs {line.strip()}: no such command"
            for option in [w.split("=")[0] for w in words if re.match("--[a-z]", w)]:
                if command in known and option not in known[command]:
                    yield f"{name}: artgs {line.strip()}: no option {option}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--book", type=Path)
    parser.add_argument("--program")
    args = parser.parse_args()
    names = markdown_files()
    wrong = [line for name in names for line in wrong_links(name)] + list(wrong_messages())
    wrong += list(excerpts_not_in_examples())
    wrong += wrong_pages(args.book) if args.book else []
    wrong += wrong_commands(args.program, names) if args.program else []
    for line in wrong:
        print(line)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
