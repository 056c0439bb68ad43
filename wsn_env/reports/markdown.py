"""Markdown: tables, and pages in which what a command made stands between markers.

<!-- begin NAME -->
a table
<!-- end NAME -->
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence

BLOCK = re.compile(r"(<!-- begin ([\w./-]+) -->\n).*?(<!-- end \2 -->)", flags=re.DOTALL)


WORD = r"[^\W_]"  # where an underscore between two begins no emphasis
SPECIAL = re.compile(rf"[\\`*\[\]<>~$&]|(?<!{WORD})_|_(?!{WORD})|:(?=[\w+-]+:)")


def escape_markdown(text: str) -> str:
    """A label as a page shows it: no emphasis, code, links, HTML, formulas or emoji. Tables see to its pipes."""
    return SPECIAL.sub(r"\\\g<0>", text)


def markdown_table(columns: Sequence[str], rows: Iterable[Sequence[str]], left: Sequence[int] = (0,)) -> str:
    """A table; these columns to the left, the others to the right."""
    marks = ["---" if i in left else "--:" for i in range(len(columns))]
    return "".join(f"| {' | '.join(_cell(cell) for cell in line)} |\n" for line in (columns, marks, *rows))


def _cell(text: str) -> str:
    return " ".join(text.splitlines()).replace("|", r"\|")


def block_names(text: str) -> list[str]:
    """Of all blocks of a page, in its order."""
    return [name for _, name, _ in BLOCK.findall(text)]


def fill_blocks(text: str, blocks: Mapping[str, str]) -> str:
    """The page's text with new blocks; one that `blocks` does not name stays. Doing it twice changes nothing."""

    def renew(found: re.Match) -> str:
        return found[1] + blocks[found[2]].rstrip("\n") + "\n" + found[3] if found[2] in blocks else found[0]

    return BLOCK.sub(renew, text)
