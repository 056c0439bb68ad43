"""What docs/reliability.md says: trials of damaged files, kills, random environments and long runs; and docs/errors.md:
every message about bad input.

    python -m studies.reliability --out out/reliability

A trial that finds a failure writes it on stderr, and the command ends with exit status 1.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

import tyro

from studies.reliability.hostile_files import try_files
from studies.reliability.kills import COMMANDS, kill
from studies.reliability.memory import RUNS, growth
from studies.reliability.messages import messages as all_messages
from tests import fuzz
from wsn_env.envs.registration import IDS
from wsn_env.evaluation.files import replacing
from wsn_env.evaluation.progress import Progress, progress_bar
from wsn_env.reports.markdown import markdown_table

EACH = 300  # damaged files of a kind
KILLS = 12  # of a command
WORLDS = 3000
FLAT = 1.01  # memory at the end over that after a tenth


@dataclass
class Reliability:
    """Which trials, and how many of each."""

    only: list[str] = field(default_factory=list)
    """Names; left out: all."""
    share: float = 1.0
    """Of the files and steps that the page tells."""
    seed: int = 0
    """Of the damage."""
    out: Path = Path("out/reliability")
    """Folder."""


def files(asked: Reliability, report: Progress) -> tuple[str, list[str]]:
    """Files of every kind, damaged at random."""
    each, rows, failures, total = max(1, round(EACH * asked.share)), [], [], [0, 0, 0]
    with TemporaryDirectory() as folder:
        for kind, taken, refused, failed in try_files(Path(folder), each, asked.seed, report):
            rows.append([kind, f"{taken:,}", f"{refused:,}", f"{len(failed):,}"])
            total = [total[0] + taken, total[1] + refused, total[2] + len(failed)]
            failures += [f"{kind}, {one}" for one in failed]
    rows.append(["all", *(f"{count:,}" for count in total)])
    return markdown_table(["file", "accepted", "rejected with one line", "crash or wrong value"], rows), failures


def kills(asked: Reliability, report: Progress) -> tuple[str, list[str]]:
    """Commands killed by turns at a file and at a time, and run again."""
    rows, failures, each = [], [], max(1, round(KILLS * asked.share))
    for number, name in enumerate(COMMANDS):
        report(number, len(COMMANDS), name)
        with TemporaryDirectory() as folder:
            found = kill(name, Path(folder), "--random", str(each))
        rows.append([name, str(found["killed"]), str(len(found["differ"]))])
        failures += [f"{name}, {one}" for one in found["differ"]]
    return markdown_table(["command", "kills before its end", "files that differ"], rows), failures


def memory(asked: Reliability, report: Progress) -> tuple[str, list[str]]:
    """Long runs."""
    rows, failures = [], []
    for number, (name, (_, most)) in enumerate(RUNS.items()):
        report(number, len(RUNS), name)
        steps = round(most * asked.share)
        early, late = growth(name, steps)
        rows.append([f"{steps:,} {name}", f"{early:.1f}", f"{late:.1f}", f"{late / early - 1:+.2%}"])
        if late > FLAT * early:
            failures.append(f"memory: {rows[-1]}")
    return markdown_table(["run", "MiB after 10 %", "MiB at the end", "growth"], rows), failures


def worlds(asked: Reliability, report: Progress) -> tuple[str, list[str]]:
    """Random environments, by `tests/fuzz.py`."""
    rows, failures, most = {name: [0, 0, 0, 0] for name in IDS}, [], max(1, round(WORLDS * asked.share))
    first = most * asked.seed
    for number in range(first, first + most):
        case = fuzz.case_of(number, usual=True)
        periods, law = fuzz.broken_law(case)
        found = [periods > 0, not periods and not law, periods, bool(law)]
        rows[case.id] = [old + new for old, new in zip(rows[case.id], found, strict=True)]
        failures += [f"{case}: {law}"] if law else []
        report(number - first + 1, most, case.id)
    shown = [[name, *(f"{count:,}" for count in counts)] for name, counts in rows.items()]
    shown.append(["all", *(f"{sum(counts):,}" for counts in zip(*rows.values(), strict=True))])
    columns = ["preset", "valid scenarios", "rejected", "time steps", "invariants violated"]
    return markdown_table(columns, shown), failures


def messages(asked: Reliability, report: Progress) -> tuple[str, list[str]]:
    """Bad input."""
    return all_messages(), []


TRIALS: dict[str, Callable[[Reliability, Progress], tuple[str, list[str]]]] = {
    "messages": messages,
    "files": files,
    "kills": kills,
    "worlds": worlds,
    "memory": memory,
}


def main(arguments: list[str] | None = None) -> int:
    """Try, print and write NAME.md."""
    asked = tyro.cli(Reliability, args=arguments, description=__doc__)
    unknown = [name for name in asked.only if name not in TRIALS]
    if unknown:
        print(f"reliability: only = {unknown}: unknown; allowed are {', '.join(TRIALS)}", file=sys.stderr)
        return 2
    asked.out.mkdir(parents=True, exist_ok=True)
    found = []
    for name in asked.only or list(TRIALS):
        with progress_bar() as report:
            text, failures = TRIALS[name](asked, report)
        with replacing(asked.out / f"{name}.md") as path:
            path.write_text(text, encoding="utf-8")
        print(text)
        found += failures
    print("\n".join(found), file=sys.stderr)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
