"""Preprocessor of the book: replaces fenced blocks of language `math` (LaTeX) with MathML.

mdBook calls it as `math_blocks.py supports RENDERER` and then with `[context, book]` as JSON on standard input; the book
goes to standard output. Needs the Python package `latex2mathml`; without it the blocks stay as they are.
"""

import json
import re
import sys

FENCE = re.compile(r"^```math\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def with_mathml(text):
    try:
        from latex2mathml.converter import convert
    except ImportError:
        return text
    return FENCE.sub(lambda block: f'<div class="equation">{convert(block[1].strip(), display="block")}</div>', text)


def convert_items(items):
    for item in items:
        if isinstance(item, dict) and "Chapter" in item:
            chapter = item["Chapter"]
            chapter["content"] = with_mathml(chapter["content"])
            convert_items(chapter["sub_items"])


def main():
    if sys.argv[1:2] == ["supports"]:
        sys.exit(0 if sys.argv[2] == "html" else 1)
    _, book = json.load(sys.stdin)
    convert_items(book.get("items", book.get("sections", [])))
    json.dump(book, sys.stdout)


if __name__ == "__main__":
    main()
