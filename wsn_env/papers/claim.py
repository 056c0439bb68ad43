"""Claims of a paper and figures expected of our reading: how they are judged, written and printed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from rich.table import Table
from rich.text import Text

from wsn_env.evaluation.files import replacing
from wsn_env.papers.sheet import Sheet, write_sheet
from wsn_env.reports.markdown import markdown_table
from wsn_env.reports.tables import wide_console

Verdict = Literal["holds", "holds under a stated reading", "not reproduced"]
HOLDS: Verdict = "holds"
UNDER_READING: Verdict = "holds under a stated reading"
NOT_REPRODUCED: Verdict = "not reproduced"
COLOURS: dict[Verdict, str] = {HOLDS: "green", UNDER_READING: "yellow", NOT_REPRODUCED: "red"}


@dataclass(frozen=True)
class Claim:
    """A claim of the paper beside what we measured."""

    claim: str
    paper: str
    ours: str
    verdict: Verdict


@dataclass(frozen=True)
class Expectation:
    """An expected figure, with the absolute tolerance that it must be met with."""

    quantity: str
    expected: float
    tolerance: float
    measured: float

    @property
    def within(self) -> bool:
        return bool(abs(self.measured - self.expected) <= self.tolerance)


def judge_claim(plainly: bool, under_reading: bool) -> Verdict:
    """Judge a claim.

    Args:
        plainly: it holds even without the reading that favours it.
        under_reading: it holds in the reading that the paper's module states.
    """
    if not under_reading:
        return NOT_REPRODUCED
    return HOLDS if plainly else UNDER_READING


def write_and_print_claims(
    out: Path, claims: Sequence[Claim], expected: Sequence[Expectation], additions: Sequence[Claim] = ()
) -> None:
    """Write claims.csv, expected.csv and summary.md to the folder and print the first two, after all else.

    Args:
        additions: what we claim beyond the paper, for additions.csv; `paper` says what was expected.
    """
    write_claims(out / "claims.csv", claims)
    if additions:
        write_claims(out / "additions.csv", additions, "expected")
    write_expected(out / "expected.csv", expected)
    write_summary(out / "summary.md", claims, expected, additions)
    print_claims(claims)
    if additions:
        print_claims(additions, "What we add", "expected")
    print_expected(expected)
    print(f"written: {out}")


def write_claims(path: Path, claims: Iterable[Claim], source: str = "paper") -> None:
    """claims.csv and claims.md: claim, paper, ours, verdict."""
    columns, rows = ("claim", source, "ours", "verdict"), [(c.claim, c.paper, c.ours, c.verdict) for c in claims]
    write_sheet(path, Sheet(columns, rows))
    with replacing(path.with_suffix(".md")) as temporary:
        temporary.write_text(markdown_table(columns, rows, left=(0, 1, 2, 3)), encoding="utf-8")


def write_summary(
    path: Path, claims: Sequence[Claim], expected: Sequence[Expectation], additions: Sequence[Claim] = ()
) -> None:
    """How many expected figures are met and how many claims have which verdict, as a line of Markdown."""
    met = sum(e.within for e in expected)
    line = f"Of {len(expected)} expected figures {met} are met. Of {len(claims)} claims: {_verdicts(claims)}."
    line += f" Of {len(additions)} additions of ours: {_verdicts(additions)}.\n" if additions else "\n"
    missed = "".join(
        f"- missed: {e.quantity}: {e.measured:.4g}, expected {e.expected:.4g} ± {e.tolerance:.2g}\n"
        for e in expected
        if not e.within
    )
    with replacing(path) as temporary:
        temporary.write_text(line + (f"\n{missed}" if missed else ""), encoding="utf-8")


def _verdicts(claims: Sequence[Claim]) -> str:
    return ", ".join(f"{sum(c.verdict == verdict for c in claims)} {verdict}" for verdict in COLOURS)


def write_expected(path: Path, expected: Iterable[Expectation]) -> None:
    """expected.csv: quantity, expected, tolerance, measured, within."""
    rows = [(e.quantity, e.expected, e.tolerance, e.measured, e.within) for e in expected]
    write_sheet(path, Sheet(("quantity", "expected", "tolerance", "measured", "within"), rows))


def print_claims(claims: Iterable[Claim], title: str = "Claims", source: str = "paper") -> None:
    """The claims with their verdicts in colour."""
    table = Table(title=title, title_justify="left", show_lines=True)
    for column in ("claim", source, "ours", "verdict"):
        table.add_column(column)
    for c in claims:
        table.add_row(c.claim, c.paper, c.ours, Text(c.verdict, style=COLOURS[c.verdict]))
    wide_console().print(table)


def print_expected(expected: Sequence[Expectation]) -> None:
    """How many expected figures were met, and each that was not."""
    missed = [e for e in expected if not e.within]
    wide_console().print(f"Expected figures: {len(expected) - len(missed)} of {len(expected)} within their tolerance.")
    for e in missed:
        text = f"  missed: {e.quantity}: {e.measured:.4g}, expected {e.expected:.4g} +- {e.tolerance:.2g}"
        wide_console().print(text)
