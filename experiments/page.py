"""Pages of Markdown whose text is written by hand and whose tables are not.

A table stands between `<!-- begin NAME -->` and `<!-- end NAME -->`. Filling a page replaces what is between and keeps
the rest.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence

_BLOCK = re.compile(r"<!-- begin (?P<name>[\w-]+) -->\n.*?<!-- end (?P=name) -->", re.DOTALL)


def block(name: str, text: str) -> str:
    """A block with its marks."""
    return f"<!-- begin {name} -->\n{text}\n<!-- end {name} -->"


def names(page: str) -> list[str]:
    """The blocks of a page, in order."""
    return [found["name"] for found in _BLOCK.finditer(page)]


def fill(page: str, blocks: Mapping[str, str]) -> tuple[str, list[str]]:
    """The page with its blocks replaced, and the names of blocks in it for which there is nothing new. Blocks that the
    page has no place for come at its end."""
    found = names(page)

    def new(old: re.Match[str]) -> str:
        name = old["name"]
        return block(name, blocks[name]) if name in blocks else old[0]

    missing = [f"## {name}\n\n{block(name, text)}" for name, text in blocks.items() if name not in found]
    text = "\n\n".join([_BLOCK.sub(new, page).rstrip("\n"), *missing])
    return text + "\n", [name for name in found if name not in blocks]


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table; the first column is words, the others are figures."""
    lines = [head, ["---", *["---:"] * (len(head) - 1)], *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def picture(name: str, words: str) -> str:
    """A figure. Its caption is text, which people write."""
    return f"![{words}]({name})"
