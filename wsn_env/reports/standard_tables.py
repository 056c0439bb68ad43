"""The standard benchmark's table, to paste, and its file of scores."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

from wsn_env.evaluation.files import replacing
from wsn_env.evaluation.intervals import Summary
from wsn_env.evaluation.standard import Scores
from wsn_env.reports.markdown import markdown_table

COLUMNS = "policy scenario score low high".split()
AGGREGATE = "all"


def standard_table(found: Sequence[Scores]) -> str:
    """Markdown: a line a policy, the best first; an aggregate, with its 95 % interval, of those that act in every
    scenario."""
    scenarios = list(dict.fromkeys(name for each in found for name in each.blocks))
    whole = {each.policy: each.aggregate() for each in found if len(each.blocks) == len(scenarios)}

    def rank(each: Scores) -> float:
        return whole[each.policy].mean if each.policy in whole else float("-inf")

    rows = []
    for each in sorted(found, key=rank, reverse=True):
        cells = [f"{each.of(name).mean:.3f}" if name in each.blocks else "" for name in scenarios]
        rows.append([each.policy, _cell(whole[each.policy]) if each.policy in whole else "", *cells])
    return markdown_table(["policy", AGGREGATE, *scenarios], rows)


def _cell(score: Summary) -> str:
    return f"{score.mean:.3f} [{score.low:.3f}, {score.high:.3f}]"


def print_standard(found: Sequence[Scores]) -> None:
    """A line a scenario, on the terminal."""
    from rich.console import Console
    from rich.table import Table

    table = Table(title="0: random choices; 1: the best policy known; 95 % intervals")
    for column in ("", *(each.policy for each in found)):
        table.add_column(column, justify="left" if not column else "right")
    scenarios = list(dict.fromkeys(name for each in found for name in each.blocks))
    for name in scenarios:
        table.add_row(name, *(_cell(each.of(name)) for each in found))
    if len(scenarios) > 1:
        table.add_section()
        table.add_row(AGGREGATE, *(_cell(each.aggregate()) for each in found))
    Console().print(table)


def save_standard(found: Sequence[Scores], out: Path) -> list[Path]:
    """Write benchmark.md and benchmark.csv into a folder. Returns their paths."""
    out.mkdir(parents=True, exist_ok=True)
    scenarios = {name for each in found for name in each.blocks}
    with replacing(out / "benchmark.md") as path:
        path.write_text(standard_table(found), encoding="utf-8")
    with replacing(out / "benchmark.csv") as path, open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        for each in found:
            told = {name: each.of(name) for name in each.blocks}
            if set(told) == scenarios:
                told[AGGREGATE] = each.aggregate()
            for name, score in told.items():
                writer.writerow([each.policy, name, *(f"{value:.5f}" for value in vars(score).values())])
    return [out / "benchmark.md", out / "benchmark.csv"]
