"""Whether the tables of a page are what their command writes."""

import re
from pathlib import Path

from wsn_env.reports.markdown import BLOCK

DOCS = Path(__file__).parents[1] / "docs"
MEASURED = re.compile(r"(-?[\d.]+) \(([\d.]+)\)")  # a figure and its standard error
DOUBT = 4.0  # standard errors


def check_tables(page, command, folder, share):
    """Every block of a page that `command` makes: written, with the same columns and rows, and figures that agree.

    Args:
        page: below docs/.
        folder: with what the command wrote in a shorter form, of the page's runs `share` times as many.
    """
    blocks = [(name, text) for _, name, text in found_blocks((DOCS / page).read_text()) if name.startswith(command)]
    assert blocks, f"{page} shows nothing of {command}"
    for name, text in blocks:
        written = folder / f"{name.removeprefix(command).lstrip('/')}.md"
        shown, fresh = table_lines(text), table_lines(written.read_text())
        assert len(shown) == len(fresh), f"{page}: {name}: run `make figures`"
        for old, new in zip(shown, fresh, strict=True):
            assert_cells_agree(f"{page}: {name}", cells(old), cells(new), share)


def found_blocks(text):
    """(all, name, content) of each."""
    return [(found[0], found[2], found[0][len(found[1]) : -len(found[3])]) for found in BLOCK.finditer(text)]


def table_lines(text):
    return [line for line in text.splitlines() if line.startswith("|")]


def cells(line):
    return [cell.strip() for cell in line.strip().strip("|").split("|")]


def assert_cells_agree(where, shown, fresh, share):
    assert len(shown) == len(fresh) and shown[:1] == fresh[:1], f"{where}: {shown} is now {fresh}: run `make figures`"
    for old, new in zip(shown, fresh, strict=True):
        for (a, error), (b, _) in zip(MEASURED.findall(old), MEASURED.findall(new), strict=False):
            digit = 10.0 ** -len(a.partition(".")[2])
            allowed = DOUBT * (float(error) + digit / 2) * (1 + share**-0.5) + digit
            assert abs(float(a) - float(b)) <= allowed, f"{where}: {old!r} is {new!r} in a short run: `make figures`"
