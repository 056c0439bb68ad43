"""docs/performance.md from the results of the claims: what stands between markers is renewed, the prose stays.

    python -m benchmarks.page [FOLDER]

Markers are `<!-- begin NAME -->` and `<!-- end NAME -->`: `machine`, `targets`, one for any claim by its name,
`further` for the claims without their own, and `plots` for those with every implementation.
"""

from __future__ import annotations

import argparse
import textwrap
from dataclasses import replace
from pathlib import Path

from benchmarks.plots import draw
from benchmarks.race import Claim, Plot, Result
from wsn_env.evaluation.files import replacing
from wsn_env.reports.markdown import block_names, fill_blocks, markdown_table

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "performance.md"
RESULTS = ROOT / "benchmarks" / "results"
ORDER = (
    *("filter_step", "environment", "vector", "several_targets", "overhead", "training", "rllib"),
    *("filter_scaling", "nodes", "memory", "recording", "frames"),
)
EVERY_IMPLEMENTATION = ("particles", "rows")  # plots that stand together, at the end
ENVIRONMENTS = "env_rows"  # joins the second of them
WIDTH = 128


def renew_page(folder: Path = RESULTS, page: Path = PAGE) -> None:
    """Write the plots beside the page, and the page anew."""
    results = sorted((Result.load(path) for path in folder.glob("*.json")), key=_place)
    if not results:
        raise SystemExit(f"no results in {folder}: run python -m benchmarks")
    for plot in make_plots(results).values():
        draw(plot, page.with_name(f"performance_{plot.name}.svg"))
    text = renew_blocks(page.read_text(encoding="utf-8"), results)
    with replacing(page) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _place(result: Result) -> tuple[int, str]:
    return ORDER.index(result.name) if result.name in ORDER else len(ORDER), result.name


def make_plots(results: list[Result]) -> dict[str, Plot]:
    """By name; the steps of whole environments are lines beside those of filters."""
    found = {plot.name: plot for result in results for plot in result.plots}
    if "rows" in found and ENVIRONMENTS in found:
        rows, lines = found["rows"], found.pop(ENVIRONMENTS).lines
        title = "Steps/s of filters and of whole environments against rows (P = 5000)"
        found["rows"] = replace(rows, title=title, y="steps/s", lines=rows.lines | lines)
    return found


def renew_blocks(text: str, results: list[Result]) -> str:
    """The page's text with new blocks. Doing it twice changes nothing."""
    own = set(block_names(text))
    blocks = {"machine": machine(results), "targets": table_of_targets(results)}
    blocks |= {result.name: section(result, heading=False) for result in results}
    drawn = make_plots(results)
    blocks["plots"] = "\n".join(_image(drawn[name]) for name in EVERY_IMPLEMENTATION if name in drawn)
    blocks["further"] = "\n".join(section(result) for result in results if result.name not in own)
    if "further" not in own and blocks["further"]:
        raise SystemExit(f"{PAGE.name} has no place for further claims: add <!-- begin further --> and its end")
    return fill_blocks(text, dict.fromkeys(own, "") | blocks)


def machine(results: list[Result]) -> str:
    """Where the figures come from; the claims of one page should share it."""
    lines = []
    for facts in _distinct_machines([result.machine for result in results]):
        packages = ", ".join(f"{name} {number}" for name, number in sorted(facts["packages"].items()))
        text = (
            f"{facts['processor']}, {facts['cores']} cores, {facts['l2_bytes'] // 1024} KiB of L2 cache each,"
            f" {facts['system']}, Python {facts['python']}; {packages}."
        )
        lines.append(_wrap_text(text))
    return "\n".join(lines)


def _distinct_machines(machines: list[dict]) -> list[dict]:
    """Machines that differ in more than the packages that a claim names; these joined."""
    distinct: list[dict] = []
    for facts in machines:
        for joined in distinct:
            if {**joined, "packages": 0} == {**facts, "packages": 0}:
                joined["packages"] = joined["packages"] | facts["packages"]
                break
        else:
            distinct.append(dict(facts))
    return distinct


def table_of_targets(results: list[Result]) -> str:
    """All claims in a table: a line for those that differ in their case only, with the worst of them."""
    lines: dict[tuple, list[Claim]] = {}
    for result in results:
        for claim in result.claims:
            lines.setdefault((claim.what, claim.target), []).append(claim)
    columns = ("claim", "target", "measured", "worst case", "verdict")
    return markdown_table(columns, [_line(each) for each in lines.values()], left=(0, 3, 4))


def _line(claims: list[Claim]) -> list[str]:
    measured = [claim for claim in claims if claim.measured is not None]
    if not measured:
        what, *_, verdict = replace(claims[0], case="").cells()
        return [what, claims[0].cells()[1], "", "", verdict]
    pick = (max, min) if claims[0].at_most else (min, max)
    worst, best = (choose(measured, key=lambda claim: claim.measured) for choose in pick)
    what, target, value, verdict = replace(worst, case="").cells()
    if missing := len(claims) - len(measured):
        verdict += f", {missing} not measured"
    cases = (
        f"{worst.case} (best of {len(measured)}: {best.written(best.measured)})" if len(measured) > 1 else worst.case
    )
    return [what, target, value, cases, f"**{verdict}**" if worst.holds is False else verdict]


def section(result: Result, heading: bool = True) -> str:
    """Text, tables, what was skipped, plots."""
    parts = [f"## {result.title}\n"] if heading else []
    parts += [_wrap_text(result.text)] if result.text else []
    parts += [f"{table.title}:\n\n{markdown_table(table.columns, table.rows)}" for table in result.tables]
    if result.skipped:
        names = "; ".join(f"{name} ({reason})" for name, reason in result.skipped.items())
        parts.append(_wrap_text(f"Skipped: {names}."))
    elsewhere = (*EVERY_IMPLEMENTATION, ENVIRONMENTS)
    parts += [_image(plot) for plot in result.plots if plot.name not in elsewhere]
    return "\n".join(parts)


def _image(plot: Plot) -> str:
    return f"![{plot.title}](performance_{plot.name}.svg)\n"


def _wrap_text(text: str) -> str:
    return textwrap.fill(text, WIDTH, break_on_hyphens=False) + "\n"


def main() -> None:
    """Renew the page from a folder of results."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?", default=RESULTS, help="where the JSON files are")
    renew_page(parser.parse_args().folder)


if __name__ == "__main__":
    main()
