"""An evaluation for people: a table in the terminal or in Markdown, and the picture of error against energy."""

from __future__ import annotations

from pathlib import Path

from wsn_env.evaluation import Evaluation, stem_of
from wsn_env.files import replacing

EMPHASIS, FAMILY, OTHER = "#D55E00", "#0072B2", "#333333"
HEADER = ("policy", "return", "{} minus it", "RMS m", "energy mJ/period", "awake", "lost")


def table_rows(evaluation: Evaluation, lam: float, reference: str) -> list[tuple[str, ...]]:
    """Best return first; means with 95 % intervals, and the paired difference of the reference's return minus each."""
    rows = []
    for policy in evaluation.policies:
        s = evaluation.summary(policy, lam)
        difference = "" if policy == reference else _interval(evaluation.difference(reference, policy, lam), 2, "+")
        rows.append(
            (
                s["return"].mean,
                (
                    policy,
                    _interval(s["return"], 1),
                    difference,
                    _interval(s["rms_m"], 3),
                    _interval(s["energy_mj"], 4),
                    f"{s['members'].mean:.1f}",
                    f"{s['lost'].mean:.2f}",
                ),
            )
        )
    return [row for _, row in sorted(rows, key=lambda pair: -pair[0])]


def _interval(value, digits: int, sign: str = "") -> str:
    return f"{value.mean:{sign}.{digits}f} [{value.low:{sign}.{digits}f}, {value.high:{sign}.{digits}f}]"


def best_in_hindsight(evaluation: Evaluation, lam: float) -> list[str]:
    """A line on the best member of each numbered family, if there is one."""
    best = [f"{evaluation.best_of(stem, lam)} of {stem}0, 1, ..." for stem in evaluation.families()]
    return [f"best in hindsight: {', '.join(best)}"] if best else []


def wide_console():
    """For the terminal, or as wide as a table wants where the output is a file or a pipe."""
    from rich.console import Console

    console = Console()
    return console if console.is_terminal else Console(width=140)


def print_tables(evaluation: Evaluation, reference: str | None = None, console=None) -> None:
    """One table for each lam."""
    from rich.table import Table

    reference = reference or evaluation.policies[0]
    console = console or wide_console()
    for lam in evaluation.lams:
        title = f"{evaluation.scenario.name}, lam = {lam:g} m/mJ, {evaluation.episodes} paired episodes"
        caption = f"means, 95 % bootstrap intervals; {reference} minus it: paired difference of returns"
        table = Table(title=title, caption="\n".join([caption, *best_in_hindsight(evaluation, lam)]))
        for name in HEADER:
            table.add_column(name.format(reference), justify="left" if name == "policy" else "right")
        for row in table_rows(evaluation, lam, reference):
            table.add_row(*row)
        console.print(table)


def markdown_table(evaluation: Evaluation, lam: float, reference: str) -> str:
    """The same as Markdown."""
    lines = [
        "| " + " | ".join(name.format(reference) for name in HEADER) + " |",
        "|---" + "|--:" * (len(HEADER) - 1) + "|",
    ]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in table_rows(evaluation, lam, reference)]) + "\n"


def save_markdown(evaluation: Evaluation, folder: str | Path) -> None:
    """Write evaluation.md: a table for each lam, compared with the first policy."""
    parts = [
        f"## {evaluation.scenario.name}, lam = {lam:g} m/mJ, {evaluation.episodes} paired episodes\n\n"
        + markdown_table(evaluation, lam, evaluation.policies[0])
        + "".join(f"\n{line}\n" for line in best_in_hindsight(evaluation, lam))
        for lam in evaluation.lams
    ]
    with replacing(Path(folder) / "evaluation.md") as path:
        path.write_text("\n".join(parts))


def draw_front(evaluation: Evaluation, lam: float, path: str | Path, emphasis: str | None = None) -> None:
    """Picture of mean error against energy with intervals, and the curve of equal return through one policy.

    Policies that differ by a number at the end of their names are joined by a line, and labelled by the number.

    Args:
        path: a PNG file.
        emphasis: the policy to make stand out.
    """
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(8, 5.2), layout="constrained")
    points = {}
    for policy in evaluation.policies:
        s = evaluation.summary(policy, lam)
        points[policy] = s["energy_mj"], s["error_m"]
        _draw_point(axes, policy, *points[policy], strong=policy == emphasis)
    for stem in {stem_of(policy) for policy in points} - set(points):
        family = sorted(
            (points[policy][0].mean, points[policy][1].mean) for policy in points if stem_of(policy) == stem
        )
        axes.plot(*zip(*family), color=FAMILY, linewidth=1, label=f"{stem}0, 1, ...", zorder=1)
    axes.set_xscale("log")
    if emphasis is not None:
        energy, error = points[emphasis]
        limits = axes.axis()
        cost = error.mean + lam * energy.mean
        xs = [limits[0] * (limits[1] / limits[0]) ** (i / 200) for i in range(201)]
        ys = [cost - lam * x for x in xs]
        axes.plot(xs, ys, "--", color="#888888", linewidth=1, label=f"return of {emphasis}", zorder=1)
        axes.axis(limits)
    axes.legend(frameon=False)
    axes.set_xlabel("energy [mJ per period]")
    axes.set_ylabel("mean error [m]")
    axes.set_title(f"{evaluation.scenario.name}, lam = {lam:g} m/mJ, {evaluation.episodes} paired episodes")
    axes.grid(alpha=0.3)
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=140, format="png")
    plt.close(figure)


def _draw_point(axes, policy: str, energy, error, strong: bool) -> None:
    numbered = stem_of(policy) != policy
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
    axes.annotate(label, (energy.mean, error.mean), xytext=place, textcoords="offset points", fontsize=9, color=colour)
