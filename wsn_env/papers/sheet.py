"""Tables and pictures of a reproduction: CSV files, the terminal, axes.

Files are written under a temporary name and then renamed, so that a reader never meets half a file.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Any

from rich.table import Table

from wsn_env.evaluation.files import replacing
from wsn_env.evaluation.intervals import Measured
from wsn_env.reports.markdown import markdown_table
from wsn_env.reports.pictures import NEEDED, can_draw
from wsn_env.reports.tables import wide_console

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Sheet:
    """A table for a CSV file."""

    columns: tuple[str, ...]
    rows: Sequence[Sequence[Any]]


def by_period(names: Iterable[str], columns: Iterable[Iterable[float]], clock: str = "period") -> Sheet:
    """A table of a row a period, counted from 1 in its first column, `clock`."""
    return Sheet((clock, *names), [(k + 1, *values) for k, values in enumerate(zip(*columns, strict=True))])


def prepare_folder(out: Path) -> None:
    """Make the folder, and see that pictures can be drawn, before time is spent.

    Raises:
        ValueError: when either cannot be.
    """
    if not can_draw():
        raise ValueError(NEEDED)
    try:
        out.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=out):
            pass
    except OSError as problem:
        raise ValueError(f"out = {str(out)!r}: must be a folder that files can be written to: {problem}") from None


def write_sheet(path: Path, sheet: Sheet) -> None:
    """A table as CSV; numbers with six digits, None and NaN as an empty cell."""
    with replacing(path) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(sheet.columns)
        table.writerows([_cell(value) for value in row] for row in sheet.rows)


def new_axes(title: str, x: str, y: str) -> tuple[Figure, Axes]:
    """A matplotlib figure with one pair of axes."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 4.2), layout="constrained")
    axes = figure.subplots()
    axes.set(title=title, xlabel=x, ylabel=y)
    tidy(axes)
    return figure, axes


def tidy(axes: Axes) -> None:
    """No frame, a faint grid."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(alpha=0.25)


def _cell(value: Any) -> str:
    if isinstance(value, (str, bool, int)):
        return str(value)
    return "" if value is None or value != value else f"{value:.6g}"


def show_table(
    path: Path, title: str, columns: Sequence[str], rows: Iterable[Sequence[str]], caption: str | None = None
) -> None:
    """A table on the terminal, and as Markdown in a file: the first column names, the others are figures."""
    rows = list(rows)
    with replacing(path) as temporary:
        temporary.write_text(markdown_table(columns, rows) + (f"\n{caption}\n" if caption else ""), encoding="utf-8")
    table = Table(title=title, caption=caption or "", title_justify="left", caption_justify="left")
    for i, column in enumerate(columns):
        table.add_column(column, justify="right" if i else "left")
    for row in rows:
        table.add_row(*row)
    wide_console().print(table)


def show_sheet(path: Path, title: str, sheet: Sheet, caption: str | None = None) -> None:
    """The same of a sheet, numbers with four digits; a column `stderr_...` in brackets behind the one before it.

    A figure with a standard error has as many decimals as that has with two digits.
    """
    shown = [i for i, name in enumerate(sheet.columns) if not name.startswith("stderr")]
    rows = []
    for row in sheet.rows:
        errors = (row[i + 1] if i + 1 < len(row) and i + 1 not in shown else None for i in shown)
        rows.append([_shown(row[i], error) for i, error in zip(shown, errors, strict=True)])
    show_table(path, title, [sheet.columns[i] for i in shown], rows, caption)


def _shown(value: Any, error: float | None) -> str:
    """For people: four digits, or as many as a standard error of two digits leaves."""
    if value is None:
        return "-"
    if error:
        return str(Measured(value, error))
    return f"{value:.4g}" if isinstance(value, float) else str(value)
