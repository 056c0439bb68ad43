"""What of a paper's text is rebuilt, item by item, and where."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from wsn_env.evaluation.files import replacing
from wsn_env.reports.markdown import markdown_table

State = Literal["covered", "interpreted", "lost in the source"]


@dataclass(frozen=True)
class Item:
    """One equation, figure, table, claim, step or assumption of a paper.

    "covered": as the text has it. "interpreted": the text is silent, ambiguous or wrong there, and `where` says what
    we chose. "lost in the source": the text that we have does not show it; `where` says what stands in its place.
    """

    item: str
    where: str  # files in `backticks`, names of tables and pictures, a few words
    state: State


def write_coverage(path: Path, items: Iterable[Item]) -> None:
    """A Markdown table: item, where, state."""
    rows = [(item.item, item.where, item.state) for item in items]
    with replacing(path) as temporary:
        temporary.write_text(markdown_table(("item", "where", "state"), rows, left=(0, 1, 2)), encoding="utf-8")
