"""Whether the tables of a page are what their command writes."""

import re
from pathlib import Path

from wsn_env.reports.markdown import BLOCK

DOCS = Path(__file__).parents[1] / "docs"
FIGURE = r"(-?[\d.]+) \(([\d.]+)\)"  # with its standard error
NUMBER = re.compile(rf"{FIGURE}|[-+]?\d[\d.,]*")
ALLOWED = 4.0  # standard errors of a difference
IN_WORDS = ("claims", "additions")  # tables whose words depend on the figures


def check_tables(page, command, folder, share):
    """Every block of a page that `command` makes: written, with the same columns and rows, and figures that agree.

    Args:
        page: below docs/, or README.md.
        folder: with what the command wrote in a shorter form, of the page's runs `share` times as many. Blocks that
            it did not write are left out, but for one at least.
    """
    text = (DOCS.parent / page if page == "README.md" else DOCS / page).read_text()
    checked = 0
    for _, name, shown in found_blocks(text):
        written = folder / f"{name.removeprefix(command).lstrip('/')}.md"
        if name.startswith(command) and written.exists():
            check_table(f"{page}: {name}", table_lines(shown), table_lines(written.read_text()), share)
            checked += 1
    assert checked, f"{page} shows nothing of {command} in {folder}"


def check_table(where, shown, fresh, share):
    """Line by line."""
    assert len(shown) == len(fresh), f"{where}: {len(shown)} lines are {len(fresh)}: run `make figures`"
    for old, new in zip(map(cells, shown), map(cells, fresh), strict=True):
        assert len(old) == len(new) and old[:1] == new[:1], f"{where}: {old} is {new}: run `make figures`"
        for left, right in zip(old[1:], new[1:], strict=True):
            if not where.endswith(IN_WORDS) and "-" not in (left, right):
                assert words(left) == words(right), f"{where}: {left!r} is {right!r}: run `make figures`"
            for (a, error), (b, _) in zip(re.findall(FIGURE, left), re.findall(FIGURE, right), strict=False):
                digit = 10.0 ** -len(a.partition(".")[2])
                allowed = ALLOWED * (float(error) + digit / 2) * (1 + 1 / share) ** 0.5 + digit
                assert abs(float(a) - float(b)) <= allowed, f"{where}: {left!r} is {right!r} in a short run"


def words(cell):
    """Without its numbers."""
    return NUMBER.sub("#", cell)


def found_blocks(text):
    """(all, name, content) of each."""
    return [(found[0], found[2], found[0][len(found[1]) : -len(found[3])]) for found in BLOCK.finditer(text)]


def table_lines(text):
    return [line for line in text.splitlines() if line.startswith("|")]


def cells(line):
    return [cell.strip() for cell in line.strip().strip("|").split("|")]
