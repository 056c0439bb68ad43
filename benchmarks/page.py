"""docs/performance.md from the results of the claims: what stands between markers is renewed, the prose stays.

    python -m benchmarks.page [FOLDER]

Markers are `<!-- begin NAME -->` and `<!-- end NAME -->`: `machine`, `targets`, one for any claim by its name, and
`further` for the claims without their own.
"""

from __future__ import annotations

import argparse
import re
import textwrap
from pathlib import Path

from benchmarks.plots import draw
from benchmarks.race import Result, Table
from wsn_env.files import replacing

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "performance.md"
RESULTS = ROOT / "benchmarks" / "results"
MARKED = re.compile(r"(<!-- begin (\w+) -->\n).*?(<!-- end \2 -->)", flags=re.DOTALL)


def renew(folder: Path = RESULTS, page: Path = PAGE) -> None:
    """Write the plots beside the page, and the page anew."""
    results = [Result.load(path) for path in sorted(folder.glob("*.json"))]
    if not results:
        raise SystemExit(f"no results in {folder}: run python -m benchmarks")
    for result in results:
        for plot in result.plots:
            draw(plot, page.with_name(f"performance_{plot.name}.svg"))
    text = rendered(page.read_text(), results)
    with replacing(page) as temporary:
        temporary.write_text(text)


def rendered(text: str, results: list[Result]) -> str:
    """The page's text with new blocks. Doing it twice changes nothing."""
    own = {name for _, name, _ in MARKED.findall(text)}
    blocks = {"machine": machine(results), "targets": targets(results)}
    blocks |= {result.name: section(result, heading=False) for result in results}
    blocks["further"] = "\n".join(section(result) for result in results if result.name not in own)
    if "further" not in own and blocks["further"]:
        raise SystemExit(f"{PAGE.name} has no place for further claims: add <!-- begin further --> and its end")
    return MARKED.sub(lambda found: found[1] + blocks.get(found[2], "") + found[3], text)


def machine(results: list[Result]) -> str:
    """Where the figures come from; the claims of one page should share it."""
    lines = []
    for facts in _distinct([result.machine for result in results]):
        packages = ", ".join(f"{name} {number}" for name, number in sorted(facts["packages"].items()))
        text = (
            f"{facts['processor']}, {facts['cores']} cores, {facts['l2_bytes'] // 1024} KiB of L2 cache each,"
            f" {facts['system']}, Python {facts['python']}; {packages}."
        )
        lines.append(_wrapped(text))
    return "\n".join(lines)


def _distinct(machines: list[dict]) -> list[dict]:
    """Machines that differ in more than the packages that a claim names; these joined."""
    distinct: list[dict] = []
    for facts in machines:
        for known in distinct:
            if {**known, "packages": 0} == {**facts, "packages": 0}:
                known["packages"] = known["packages"] | facts["packages"]
                break
        else:
            distinct.append(dict(facts))
    return distinct


def targets(results: list[Result]) -> str:
    """All claims in a table."""
    rows = [claim.cells() for result in results for claim in result.claims]
    return markdown(Table("", ["claim", "target", "measured", "verdict"], rows))


def section(result: Result, heading: bool = True) -> str:
    """Text, tables, what was skipped, plots."""
    parts = [f"## {result.title}\n"] if heading else []
    parts += [_wrapped(result.text)] if result.text else []
    parts += [f"{table.title}:\n\n{markdown(table)}" for table in result.tables]
    if result.skipped:
        names = "; ".join(f"{name} ({reason})" for name, reason in result.skipped.items())
        parts.append(_wrapped(f"Skipped: {names}."))
    parts += [f"![{plot.title}](performance_{plot.name}.svg)\n" for plot in result.plots]
    return "\n".join(parts)


def _wrapped(text: str) -> str:
    return textwrap.fill(text, 120, break_on_hyphens=False) + "\n"


def markdown(table: Table) -> str:
    """The first column to the left, the others to the right."""
    rules = ["---", *["--:"] * (len(table.columns) - 1)]
    lines = [table.columns, rules, *table.rows]
    return "".join(f"| {' | '.join(cell.replace('|', '/') for cell in line)} |\n" for line in lines)


def main() -> None:
    """Renew the page from a folder of results."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?", default=RESULTS, help="where the JSON files are")
    renew(parser.parse_args().folder)


if __name__ == "__main__":
    main()
