"""An evaluation for people: a table in the terminal or in Markdown, and the picture of error against energy."""

from __future__ import annotations

from pathlib import Path

from wsn_env.evaluation import Evaluation, replacing

HEADER = ("policy", "return", "difference to {}", "RMS m", "energy mJ/period", "awake", "lost")


def table_rows(evaluation: Evaluation, lam: float, reference: str) -> list[tuple[str, ...]]:
    """Best return first; means with 95 % intervals, and paired differences of the return."""
    rows = []
    for policy in evaluation.policies:
        s = evaluation.summary(policy, lam)
        difference = "" if policy == reference else _interval(evaluation.difference(policy, reference, lam), 2, "+")
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


def print_tables(evaluation: Evaluation, reference: str | None = None, console=None) -> None:
    """One table for each lam."""
    from rich.console import Console
    from rich.table import Table

    reference = reference or evaluation.policies[0]
    console = console or Console()
    if not console.is_terminal:  # a file or a pipe has room
        console = Console(width=140)
    for lam in evaluation.lams:
        title = f"{evaluation.scenario.name}, lam = {lam:g} m/mJ, {evaluation.episodes} paired episodes"
        table = Table(title=title, caption="means, 95 % bootstrap intervals; difference of returns, paired")
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


def draw_front(evaluation: Evaluation, lam: float, path: str | Path, emphasis: str | None = None) -> None:
    """Picture of RMS against energy with intervals, and the line of equal return through the emphasised policy.

    Args:
        path: a PNG file.
        emphasis: the policy to make stand out.
    """
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(7.5, 5), layout="constrained")
    for policy in evaluation.policies:
        s = evaluation.summary(policy, lam)
        x, y = s["energy_mj"], s["error_m"]
        strong = policy == emphasis
        axes.errorbar(
            x.mean,
            y.mean,
            xerr=[[x.mean - x.low], [x.high - x.mean]],
            yerr=[[y.mean - y.low], [y.high - y.mean]],
            fmt="*" if strong else "o",
            markersize=14 if strong else 5,
            color="#D55E00" if strong else "#0072B2",
            zorder=3 if strong else 2,
        )
        axes.annotate(policy, (x.mean, y.mean), xytext=(6, 5), textcoords="offset points", fontsize=9)
    if emphasis is not None:
        s = evaluation.summary(emphasis, lam)
        lowest, highest = axes.get_xlim()
        cost = s["error_m"].mean + lam * s["energy_mj"].mean
        ends = [max(lowest, 0.0), min(highest, cost / lam if lam else highest)]
        limits = axes.get_ylim()
        axes.plot(ends, [cost - lam * x for x in ends], "--", color="#888888", zorder=1, label="equal return")
        axes.set_ylim(limits)
        axes.legend(frameon=False)
    axes.set_xlabel("energy [mJ per period]")
    axes.set_ylabel("mean error [m]")
    axes.set_title(f"{evaluation.scenario.name}, lam = {lam:g} m/mJ, {evaluation.episodes} episodes")
    axes.grid(alpha=0.3)
    with replacing(path, "wb") as file:
        figure.savefig(file, dpi=140, format="png")
    plt.close(figure)
