"""Tables of an evaluation: in the terminal and in Markdown."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from wsn_env.evaluation.comparison import Evaluation
from wsn_env.evaluation.files import replacing
from wsn_env.evaluation.intervals import Summary
from wsn_env.reports.markdown import escape_markdown, markdown_table
from wsn_env.simulation.reference import has_reference, why_no_reference

if TYPE_CHECKING:
    from rich.console import Console

OVER_REFERENCE = "RMS / reference"
HEADER = ("policy", "return", "difference to {}", "RMS m", OVER_REFERENCE, "energy mJ/step", "awake", "lost")
CAPPED = "capped error m"
IDENTITY = ("GOSPA m", "swaps", "lost tracks")  # of several targets
LIFETIME = ("first death", "half dead", "functional", "tracked %", "left mJ")


def table_header(evaluation: Evaluation, reference: str) -> list[str]:
    """Names of the columns of `table_rows`."""
    names = [name.format(reference) for name in HEADER]
    if not has_reference(evaluation.scenario):
        names.remove(OVER_REFERENCE)
    if evaluation.scenario.error_cap_m is not None:
        names.insert(names.index("RMS m"), CAPPED)
    several = evaluation.scenario.targets > 1
    return [*names, *(IDENTITY if several else ()), *(LIFETIME if nodes_die(evaluation) else ())]


def nodes_die(evaluation: Evaluation) -> bool:
    """Whether a battery ran empty in any of the episodes, so that lifetimes tell something."""
    return any(float(row["first_death"]) < evaluation.scenario.periods for row in evaluation.rows)


def describe_reference(evaluation: Evaluation) -> str:
    """What the column of the Cramer-Rao reference holds, in a sentence."""
    all_awake_m = evaluation.reference_all_awake_m()
    if all_awake_m is None:
        return f"no Cramer-Rao reference: {why_no_reference(evaluation.scenario)}"
    what = "Cramer-Rao recursion on the values of the reports delivered, which an estimate may beat"
    return f"RMS over the {what}; the same for all nodes awake and heard: {all_awake_m:.3f} m"


def table_rows(evaluation: Evaluation, lam: float, reference: str) -> list[tuple[str, ...]]:
    """Best return first; means with 95 % intervals, and the paired difference of each return to the reference's."""
    rows, cap, dying = [], evaluation.scenario.error_cap_m, nodes_die(evaluation)
    for policy in evaluation.policies:
        s = evaluation.summary(policy, lam)
        ratio = evaluation.rms_over_reference(policy, lam)
        difference = (
            "" if policy == reference else format_interval(evaluation.difference(policy, reference, lam), 2, "+")
        )
        rows.append(
            (
                s["return"].mean,
                (
                    policy,
                    format_interval(s["return"], 1),
                    difference,
                    *([] if cap is None else [format_interval(s["error_m"], 3)]),
                    format_interval(s["rms_m"], 3),
                    *([] if ratio is None else [format_interval(ratio, 2)]),
                    format_interval(s["energy_mj"], 4),
                    f"{s['members'].mean:.1f}",
                    f"{s['lost'].mean:.2f}",
                    *(_identity(evaluation, policy, lam) if evaluation.scenario.targets > 1 else ()),
                    *(_lifetime(s) if dying else ()),
                ),
            )
        )
    return [row for _, row in sorted(rows, key=lambda pair: -pair[0])]


def _identity(evaluation: Evaluation, policy: str, lam: float) -> list[str]:
    """The columns of IDENTITY."""
    gospa, swaps, lost = (
        Summary.of(evaluation.values(policy, lam, name)) for name in ("gospa_m", "swaps", "lost_tracks")
    )
    return [format_interval(gospa, 3), f"{swaps.mean:.2f}", f"{lost.mean:.2f}"]


def _lifetime(s: dict[str, Summary]) -> list[str]:
    """The columns of LIFETIME."""
    periods = [f"{s[name].mean:.0f}" for name in ("first_death", "half_dead")]
    left = f"{s['stranded_mj'].mean:.3g}"
    return [*periods, format_interval(s["functional"], 0), f"{100 * s['tracked'].mean:.1f}", left]


def format_interval(value: Summary, digits: int, sign: str = "") -> str:
    """mean [low, high] of a Summary."""
    return f"{value.mean:{sign}.{digits}f} [{value.low:{sign}.{digits}f}, {value.high:{sign}.{digits}f}]"


def describe_best_in_hindsight(evaluation: Evaluation, lam: float) -> list[str]:
    """A line on the best member of each numbered family, if there is one."""
    best = [f"{evaluation.best_of(stem, lam)} of {evaluation.family_name(stem)}" for stem in evaluation.families()]
    return [f"best in hindsight: {', '.join(best)}"] if best else []


def wide_console() -> Console:
    """For the terminal, or as wide as a table wants where the output is a file or a pipe.

    It shows words as they are: a label may look like rich's markup, or hold the code of an emoji.
    """
    from rich.console import Console

    console = Console(markup=False, emoji=False)
    return console if console.is_terminal else Console(width=160, markup=False, emoji=False)


def print_tables(evaluation: Evaluation, reference: str | None = None, most: int | None = None) -> None:
    """A table for each lam that fits 80 columns; evaluation.md has all columns.

    Args:
        reference: what others are compared with; None: the first.
        most: of the best policies are shown, beside the reference, in one table at the middle lam, with a line for
            each other lam; None: all of them, at every lam.
    """
    reference = reference or evaluation.policies[0]
    console = wide_console()
    for lam in evaluation.lams if most is None else [evaluation.middle_lam]:
        ranked = evaluation.ranked(lam)
        shown = [policy for policy in ranked if most is None or policy in (*ranked[:most], reference)]
        console.print(_terminal_table(evaluation, lam, reference, shown))
        notes = [f"to {reference}: paired difference of returns, positive is better; mJ a time step"]
        notes += [f"{len(ranked) - len(shown)} more: evaluation.md"] if len(shown) < len(ranked) else []
        notes += describe_best_in_hindsight(evaluation, lam)
        console.print("\n".join(notes), style="dim")
    if most is not None:
        for lam in evaluation.lams:
            console.print(_line_of(evaluation, lam, reference))
    has = has_reference(evaluation.scenario)
    console.print(f"{'/ref: ' if has else ''}{describe_reference(evaluation)}", style="dim")


def narrow_table(title: str, columns: list[str]) -> Any:
    """For the terminal: no frame, the first column to the left."""
    from rich import box
    from rich.table import Table

    table = Table(title=title, box=box.SIMPLE_HEAD, title_justify="left", padding=(0, 1, 0, 0), pad_edge=False)
    for number, name in enumerate(columns):
        table.add_column(name, justify="right" if number else "left", overflow="fold")
    return table


def _terminal_table(evaluation: Evaluation, lam: float, reference: str, shown: list[str]) -> Any:
    cap, dying = evaluation.scenario.error_cap_m, nodes_die(evaluation)
    title = f"{evaluation.scenario.title}, lam = {lam:g} m/mJ, {evaluation.episodes} paired episodes"
    error = ["RMS m"] if cap is None else ["capped m"]
    error += ["/ref"] if has_reference(evaluation.scenario) else []
    last = "functional" if dying else "lost"
    table = narrow_table(title, ["policy", "return", f"to {reference}", *error, "mJ", "awake", last])
    for policy in shown:
        s = evaluation.summary(policy, lam)
        difference = evaluation.difference(policy, reference, lam)
        ratio = evaluation.rms_over_reference(policy, lam)
        table.add_row(
            policy,
            f"{s['return'].mean:.1f}",
            "" if policy == reference else format_interval(difference, 1, "+"),
            f"{s['rms_m' if cap is None else 'error_m'].mean:.3f}",
            *([] if ratio is None else [f"{ratio.mean:.2f}"]),
            f"{s['energy_mj'].mean:.3g}",
            f"{s['members'].mean:.1f}",
            f"{s['functional'].mean:.0f}" if dying else f"{s['lost'].mean:.2f}",
        )
    return table


def _line_of(evaluation: Evaluation, lam: float, reference: str) -> str:
    """A policy's return beside the best of the others, and how far it is ahead of that [%]."""
    best = next(policy for policy in evaluation.ranked(lam) if policy != reference)
    own, other = (evaluation.values(policy, lam, "return").mean() for policy in (reference, best))
    ahead, scale = evaluation.difference(reference, best, lam), 100 / max(abs(other), 1e-12)
    share = format_interval(Summary(*(scale * value for value in (ahead.mean, ahead.low, ahead.high))), 1, "+")
    return f"lam {lam:g}: {reference} {own:.1f}, best other {best} {other:.1f}: {share} %"


def format_markdown(evaluation: Evaluation, lam: float, reference: str) -> str:
    """The same as Markdown."""
    rows = [(escape_markdown(name), *figures) for name, *figures in table_rows(evaluation, lam, reference)]
    return markdown_table(table_header(evaluation, escape_markdown(reference)), rows)


def save_markdown(evaluation: Evaluation, folder: str | Path) -> None:
    """Write evaluation.md: a table for each lam, compared with the first policy."""
    parts = [
        f"## {escape_markdown(evaluation.scenario.title)}, lam = {lam:g} m/mJ,"
        + f" {evaluation.episodes} paired episodes\n\n"
        + format_markdown(evaluation, lam, evaluation.policies[0])
        + f"\nMeans with 95 % bootstrap intervals; {describe_reference(evaluation)}.\n"
        + "".join(f"\n{escape_markdown(line)}\n" for line in describe_best_in_hindsight(evaluation, lam))
        for lam in evaluation.lams
    ]
    with replacing(Path(folder) / "evaluation.md") as path:
        path.write_text("\n".join(parts), encoding="utf-8")
