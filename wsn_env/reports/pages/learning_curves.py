"""Learning curves of a training, for its report."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from wsn_env.envs.rendering.colours import BLUE
from wsn_env.learning.held_out import HELD_OUT
from wsn_env.reports.pages.page import image, section

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CURVES = {  # of a training's progress.csv without a lead: the mean, its standard error, what it is
    "rollout/episode_rms_m": ("rollout/episode_rms_se_m", "RMS error of an episode [m]"),
    "rollout/ep_rew_mean": ("rollout/ep_rew_se", "training return, scaled"),
}
LOWEST_LEAD = -15.0  # percent; what is worse still is not drawn
STEPS = "time/total_timesteps"
NORMAL_95 = 1.96
FEW = 10  # points are drawn, too


def learning_sections(folder: Path) -> list[str]:
    """The learning curves of a run; none if it has none."""
    progress = read_progress(folder)
    steps = progress.get(STEPS)
    if steps is None:
        return []
    if any(name.startswith(HELD_OUT) for name in progress):
        told = (
            "Return over the best rule's at the same trade-off, on held-out episodes that are always the same, with"
            " 95 % intervals at the end; 0: as good as the best of greedy, adaptive and nearest0..8."
        )
        return [section("Learning", f"<p>{told}</p>", image(_draw_lead(steps, progress), "learning curves"))]
    drawn = [name for name in CURVES if name in progress and np.isfinite(progress[name]).any()]
    if not drawn:
        return []
    curves = image(_draw_curves(steps, progress, drawn), "learning curves")
    return [section("Learning", "<p>Means over the last episodes, with 95 % intervals.</p>", curves)]


def read_progress(folder: str | Path) -> dict[str, np.ndarray]:
    """Columns of all progress-STEPS/progress.csv of a run, in the order of the steps; what is missing is NaN.

    Folders of other names are none of it. Of a run that was killed, a line that was cut short is left out, and so is
    what a resumed one has trained again.
    """
    files = {path.parent.name.partition("-")[2]: path for path in Path(folder).glob("progress-*/progress.csv")}
    begins = {int(steps): path for steps, path in files.items() if steps.isdecimal() and path.is_file()}
    starts = sorted(begins)
    rows: list[dict[str, float]] = []
    for start, resumed in zip(starts, [*starts[1:], np.inf]):
        whole, _, _cut_short = begins[start].read_text(encoding="utf-8", errors="replace").rpartition("\n")
        read = map(_numbers, csv.DictReader(whole.splitlines()))
        rows += [row for row in read if row.get(STEPS, np.nan) <= resumed]
    names = dict.fromkeys(chain.from_iterable(rows))
    return {name: np.array([row.get(name, np.nan) for row in rows]) for name in names}


def _numbers(row: dict[str, Any]) -> dict[str, float]:
    """A line's numbers; none of a line that holds something else."""
    try:
        return {name: float(value or "nan") for name, value in row.items()}
    except (TypeError, ValueError):
        return {}


def _draw_lead(steps: np.ndarray, progress: dict[str, np.ndarray]) -> Figure:
    from matplotlib import colormaps
    from matplotlib.figure import Figure

    leads = {
        name: float(name.removeprefix(HELD_OUT))
        for name in progress
        if name.startswith(HELD_OUT) and name[-3:] != "_se"
    }
    figure = Figure(figsize=(7.5, 4), layout="constrained")
    axes = figure.subplots()
    axes.axhline(0.0, color="black", linewidth=1)
    lowest = 0.0
    for place, (name, lam) in enumerate(sorted(leads.items(), key=lambda item: item[1])):
        finite = np.isfinite(progress[name])
        told, lead, half = steps[finite], progress[name][finite], NORMAL_95 * progress[f"{name}_se"][finite][-1]
        colour = colormaps["viridis"](0.05 + 0.85 * place / max(len(leads) - 1, 1))
        axes.plot(told, lead, color=colour, linewidth=1.5, marker="o", markersize=3, label=f"lam {lam:g}")
        axes.errorbar(told[-1] * 1.03 ** (place + 1), lead[-1], half, color=colour, capsize=3, linewidth=1.2)
        lowest = min(lowest, float(lead.min(initial=0.0)))
    axes.set(xlabel="time steps of training", ylabel="return over the best baseline [%]")
    axes.set_ylim(bottom=max(1.1 * lowest, LOWEST_LEAD))
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter(_in_millions)
    axes.xaxis.set_minor_formatter(lambda value, _: "")
    axes.grid(alpha=0.3)
    figure.legend(loc="outside right center", fontsize="small", frameon=False)
    return figure


def _in_millions(value: float, _: Any) -> str:
    return f"{value / 1e6:g} M" if value >= 1e5 else f"{value:,.0f}"


def _draw_curves(steps: np.ndarray, progress: dict[str, np.ndarray], names: Sequence[str]) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.5 * len(names), 3.4), layout="constrained")
    for axes, name in zip(np.atleast_1d(figure.subplots(1, len(names))), names):
        error, what = CURVES[name]
        finite = np.isfinite(progress[name])
        marker = "o" if finite.sum() < FEW else None
        axes.plot(steps[finite], progress[name][finite], color=BLUE, linewidth=1.5, marker=marker)
        if error in progress:
            half = NORMAL_95 * progress[error][finite]
            ends = progress[name][finite] - half, progress[name][finite] + half
            axes.fill_between(steps[finite], *ends, color=BLUE, alpha=0.25, linewidth=0)
        axes.set(xlabel="time steps of training", ylabel=what)
        axes.xaxis.set_major_formatter(_in_millions)
        axes.xaxis.get_major_locator().set_params(nbins=5)
        axes.grid(alpha=0.3)
    return figure
