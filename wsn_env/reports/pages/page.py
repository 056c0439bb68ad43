"""Templates filled in: one file of HTML with everything that it needs inside."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import TYPE_CHECKING, Literal

from wsn_env.reports.pictures import svg_data_url

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def read_template(name: str) -> str:
    """The text of a file of `templates/`."""
    return (files("wsn_env.reports.pages") / "templates" / name).read_text(encoding="utf-8")


def fill_template(name: str, **parts: str) -> str:
    """A template, each {{part}} replaced by its HTML. What is put in is not looked at again."""
    return re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found[1]], read_template(name))


def build_page(kind: Literal["replay", "report"], title: str, body: str) -> str:
    """A page with our style.

    Args:
        kind: "replay" or "report".
        title: plain text.
        body: HTML.
    """
    return fill_template("page.html", kind=kind, title=html.escape(title), style=read_template("style.css"), body=body)


def json_for_script(data: object) -> str:
    """JSON that cannot end the script element that it stands in."""
    return json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


# --- parts of a body ---


def section(title: str, *parts: str) -> str:
    """A part of a report under a heading."""
    return f"<section><h2>{html.escape(title)}</h2>\n" + "\n".join(parts) + "</section>"


def table(rows: Sequence[Sequence[str]], strong: str | None = None) -> str:
    """Rows of text; with `strong` the first is the header, and the row of that name stands out."""
    lines = []
    for k, row in enumerate(rows):
        cell = "th" if strong is not None and k == 0 else "td"
        mark = ' class="strong"' if strong is not None and row[0] == strong else ""
        lines.append(f"<tr{mark}>" + "".join(f"<{cell}>{html.escape(str(text))}</{cell}>" for text in row) + "</tr>")
    kind = "" if strong is None else ' class="figures"'
    return f'<div class="wide"><table{kind}>{"".join(lines)}</table></div>'


def collapsible(title: str, *parts: str, open: bool = False) -> str:
    """What opens at a click."""
    return f"<details{' open' if open else ''}><summary>{html.escape(title)}</summary>{''.join(parts)}</details>"


def values_table(values: Mapping[str, object]) -> str:
    """Names and values."""
    return table([(k, v if isinstance(v, str) else json.dumps(v, default=str)) for k, v in values.items()])


def image(figure: Figure, words: str) -> str:
    """A matplotlib figure, and what it shows in words."""
    return f'<img alt="{html.escape(words)}" src="{svg_data_url(figure)}">'
