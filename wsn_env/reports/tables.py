"""An evaluation for people: a table in the terminal or in Markdown, and the picture of error against energy."""

from __future__ import annotations

from math import pi, sqrt
from pathlib import Path

import numpy as np

from wsn_env.envs.rendering.colours import BLUE, DARK, GREEN, GREY, VERMILION
from wsn_env.evaluation.comparison import Evaluation, stem_of
from wsn_env.evaluation.files import replacing
from wsn_env.reports.pictures import plain
from wsn_env.simulation.bound import bound_kind

EMPHASIS, FAMILY, OTHER, FLOOR = VERMILION, BLUE, DARK, GREEN
HEADER = ("policy", "return", "{} minus it", "RMS m", "RMS / {}", "energy mJ/period", "awake", "lost")
NARROW = 3  # energies that span less are drawn on a linear axis
ROUND = sqrt(pi) / 2  # mean error over RMS of a round Gaussian in the plane


def table_header(evaluation: Evaluation, reference: str) -> list[str]:
    """Names of the columns of `table_rows`."""
    kind = bound_kind(evaluation.scenario)
    names = [name.format(reference if "minus" in name else kind) for name in HEADER]
    return [name for name in names if name != "RMS / none"]


def about_the_bound(evaluation: Evaluation) -> str:
    """What the column of the bound holds, in a sentence."""
    floor = evaluation.floor_m()
    if floor is None:
        if evaluation.scenario.measurement.lasting_errors:
            return "no Cramer-Rao bound: the errors of a beacon's levels last over periods"
        return "no Cramer-Rao bound: a bit that jumps at an edge has no Fisher information"
    what = {
        "bound": "posterior Cramer-Rao bound of the reports delivered",
        "reference": "Cramer-Rao recursion of the reports delivered, which can be beaten here: no bound",
    }[bound_kind(evaluation.scenario)]
    return f"RMS over the {what}; the same for all nodes awake and heard: {floor:.3f} m"


def table_rows(evaluation: Evaluation, lam: float, reference: str) -> list[tuple[str, ...]]:
    """Best return first; means with 95 % intervals, and the paired difference of the reference's return minus each."""
    rows = []
    for policy in evaluation.policies:
        s = evaluation.summary(policy, lam)
        ratio = evaluation.rms_over_bound(policy, lam)
        difference = "" if policy == reference else interval_text(evaluation.difference(reference, policy, lam), 2, "+")
        rows.append(
            (
                s["return"].mean,
                (
                    policy,
                    interval_text(s["return"], 1),
                    difference,
                    interval_text(s["rms_m"], 3),
                    *([] if ratio is None else [interval_text(ratio, 2)]),
                    interval_text(s["energy_mj"], 4),
                    f"{s['members'].mean:.1f}",
                    f"{s['lost'].mean:.2f}",
                ),
            )
        )
    return [row for _, row in sorted(rows, key=lambda pair: -pair[0])]


def interval_text(value, digits: int, sign: str = "") -> str:
    """mean [low, high] of a Summary."""
    return f"{value.mean:{sign}.{digits}f} [{value.low:{sign}.{digits}f}, {value.high:{sign}.{digits}f}]"


def best_in_hindsight(evaluation: Evaluation, lam: float) -> list[str]:
    """A line on the best member of each numbered family, if there is one."""
    best = [f"{evaluation.best_of(stem, lam)} of {evaluation.family_name(stem)}" for stem in evaluation.families()]
    return [f"best in hindsight: {', '.join(best)}"] if best else []


def wide_console():
    """For the terminal, or as wide as a table wants where the output is a file or a pipe."""
    from rich.console import Console

    console = Console()
    return console if console.is_terminal else Console(width=160)


def print_tables(evaluation: Evaluation, reference: str | None = None, console=None) -> None:
    """One table for each lam."""
    from rich.table import Table

    reference = reference or evaluation.policies[0]
    console = console or wide_console()
    for lam in evaluation.lams:
        title = f"{evaluation.scenario.name}, lam = {lam:g} m/mJ, {evaluation.episodes} paired episodes"
        caption = f"means, 95 % bootstrap intervals; {reference} minus it: paired difference of returns"
        lines = f"{caption}; {about_the_bound(evaluation)}", *best_in_hindsight(evaluation, lam)
        table = Table(title=title, caption="\n".join(lines))
        for name in table_header(evaluation, reference):
            table.add_column(name, justify="left" if name == "policy" else "right")
        for row in table_rows(evaluation, lam, reference):
            table.add_row(*row)
        console.print(table)


def markdown_table(evaluation: Evaluation, lam: float, reference: str) -> str:
    """The same as Markdown."""
    header = table_header(evaluation, reference)
    lines = ["| " + " | ".join(header) + " |", "|---" + "|--:" * (len(header) - 1) + "|"]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in table_rows(evaluation, lam, reference)]) + "\n"


def save_markdown(evaluation: Evaluation, folder: str | Path) -> None:
    """Write evaluation.md: a table for each lam, compared with the first policy."""
    parts = [
        f"## {evaluation.scenario.name}, lam = {lam:g} m/mJ, {evaluation.episodes} paired episodes\n\n"
        + markdown_table(evaluation, lam, evaluation.policies[0])
        + f"\nMeans with 95 % bootstrap intervals; {about_the_bound(evaluation)}.\n"
        + "".join(f"\n{line}\n" for line in best_in_hindsight(evaluation, lam))
        for lam in evaluation.lams
    ]
    with replacing(Path(folder) / "evaluation.md") as path:
        path.write_text("\n".join(parts))


def draw_front(evaluation: Evaluation, lam: float, emphasis: str | None = None):
    """Figure of mean error against energy with intervals, and the curve of equal return through one policy.

    Policies that differ by a number at the end of their names are joined by a line, and labelled by the number. The
    floor of all nodes awake is drawn as the mean error of a round Gaussian of its RMS (sqrt(pi) / 2 of it).

    Args:
        lam: one of the evaluation's.
        emphasis: the policy to make stand out.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 5.2), layout="constrained")
    axes = figure.subplots()
    points = {}
    for policy in evaluation.policies:
        s = evaluation.summary(policy, lam)
        points[policy] = s["energy_mj"], s["error_m"]
        numbered = stem_of(policy) != policy and stem_of(policy) in evaluation.families()
        _draw_point(axes, policy, *points[policy], strong=policy == emphasis, numbered=numbered)
    for stem in evaluation.families():
        family = sorted(
            (points[policy][0].mean, points[policy][1].mean) for policy in points if stem_of(policy) == stem
        )
        axes.plot(*zip(*family), color=FAMILY, linewidth=1, label=plain(evaluation.family_name(stem)), zorder=1)
    draw_floor(axes, evaluation)
    energies = [energy.mean for energy, _ in points.values()]
    if max(energies) > NARROW * min(energies) > 0:
        axes.set_xscale("log")
        plain_ticks(axes.xaxis)
    if emphasis is not None:
        energy, error = points[emphasis]
        limits = axes.axis()
        xs = np.linspace(*limits[:2], 1000)
        ys = error.mean + lam * (energy.mean - xs)
        axes.plot(xs, ys, "--", color=GREY, linewidth=1, label=plain(f"return of {emphasis}"), zorder=1)
        axes.axis(limits)
    axes.legend(frameon=False)
    axes.set_xlabel("energy [mJ per period]")
    axes.set_ylabel("mean error [m]")
    axes.set_title(plain(f"{evaluation.scenario.name}, lam = {lam:g} m/mJ, {evaluation.episodes} paired episodes"))
    axes.grid(alpha=0.3)
    return figure


def plain_ticks(axis) -> None:
    """Numbers in full at 1, 2, 3, 5 and 7 of each decade of a logarithmic axis."""
    axis.set_major_formatter(lambda value, _: f"{value:g}")
    axis.set_minor_formatter(lambda value, _: f"{value:g}" if f"{value:e}"[0] in "2357" else "")
    axis.set_tick_params(which="both", labelsize=9)


def draw_floor(axes, evaluation: Evaluation) -> None:
    """A line at the mean error of a round Gaussian of the floor's RMS, if there is a bound."""
    floor = evaluation.floor_m()
    if floor is not None:
        kind = {"bound": "floor", "reference": "reference"}[bound_kind(evaluation.scenario)]
        label = f"{kind}: all nodes, {floor:.3g} m RMS"
        axes.axhline(ROUND * floor, color=FLOOR, linewidth=1, linestyle=":", label=label)


def _draw_point(axes, policy: str, energy, error, strong: bool, numbered: bool) -> None:
    colour = EMPHASIS if strong else FAMILY if numbered else OTHER
    axes.errorbar(
        energy.mean,
        error.mean,
        xerr=[[energy.mean - energy.low], [energy.high - energy.mean]],
        yerr=[[error.mean - error.low], [error.high - error.mean]],
        fmt="*" if strong else "o",
        markersize=15 if strong else 5,
        color=colour,
        zorder=3 if strong else 2,
    )
    label = policy.removeprefix(stem_of(policy)) if numbered else policy
    place = (-11, -11) if numbered else (7, 5)
    axes.annotate(
        plain(label), (energy.mean, error.mean), xytext=place, textcoords="offset points", fontsize=9, color=colour
    )
