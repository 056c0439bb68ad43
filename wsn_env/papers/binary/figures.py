"""What the experiments of Zhou, Cheng & Xing (2009) show, as pictures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from wsn_env.envs.rendering.colours import BLACK, BLUE, GREEN, GREY, PURPLE, VERMILION
from wsn_env.evaluation.intervals import Measured
from wsn_env.papers.binary.readings import transmitting_nodes
from wsn_env.papers.binary.results import Results
from wsn_env.papers.binary.systems import SWEPT, vary
from wsn_env.papers.binary.tables import SWEEPS, error_over_time
from wsn_env.papers.sheet import new_axes, tidy, write_sheet
from wsn_env.reports.pictures import write_picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LOOKS: dict[str, tuple[str, dict[str, Any]]] = {
    "centroid": ("centroid", dict(color=VERMILION, linestyle="--")),
    "raw": ("fix, v given", dict(color=GREY, linestyle=":")),
    "paper": ("paper's filter", dict(color=BLACK, linestyle="-")),
    "mid": ("mid-period fix", dict(color=BLUE, linestyle="-.")),
    "ekf": ("EKF of ranges", dict(color=GREEN, linestyle="-")),
    "particle": ("particle filter", dict(color=PURPLE, linestyle="--")),
}
COUNTS = {  # system: what is counted, its closed form
    "centroid": ("nodes that detect", "ρ π R²"),
    "paper": ("boundary nodes", "2 ρ (π R² - lens(|v| T))"),
}


def write_figures(out: Path, results: Results) -> None:
    """Every picture, and the table of the error over time."""
    write_sheet(out / "error.csv", error_over_time(results, LOOKS))
    write_picture(out / "error.png", draw_error(results))
    for name in SWEEPS:
        write_picture(out / f"{name}.png", draw_sweep(results, name))


def draw_error(results: Results) -> Figure:
    """Error over time."""
    figure, axes = new_axes("Error over time: N = 600, R = 60 m, T = 1 s", "time [s]", "mean error over the runs [m]")
    sheet = error_over_time(results, LOOKS)
    time, *columns = (np.array(column, dtype=float) for column in zip(*sheet.rows, strict=True))
    for values, (label, style) in zip(columns, LOOKS.values(), strict=True):
        axes.plot(time, values, label=label, linewidth=1.5, **style)
    axes.set(xlim=(0, time[-1]), ylim=(0, 20))
    axes.legend(frameon=False, ncols=3, loc="upper center")
    return figure


def draw_sweep(results: Results, name: str) -> Figure:
    """Error of the systems, and how many nodes transmit, over a quantity; bars are two standard errors each way."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    _draw_errors(left, results, name)
    _draw_counts(right, results, name)
    return figure


def _draw_errors(axes: Axes, results: Results, name: str) -> None:
    """The mean; over sampling periods the RMS, by which the paper's filter and the centroid cross."""
    field, values, label = _of(name)
    what, measure = ("RMS", results.rms_m) if name == "period" else ("mean", results.mean_m)
    for system in SWEPT:
        text, style = LOOKS[system]
        measured = np.array([measure(setting) for setting in vary(system, field, values)])
        _draw_points(axes, values, measured, label=text, **style)
    axes.set(title="Location error", xlabel=label, ylabel=f"{what} error [m]")
    _finish(axes)


def _draw_counts(axes: Axes, results: Results, name: str) -> None:
    """Measured, and in closed form."""
    field, values, label = _of(name)
    fine = np.linspace(values[0], values[-1], 50)
    for system, (text, formula) in COUNTS.items():
        colour = LOOKS[system][1]["color"]
        counts = np.array([Measured.mean(results.reporting(setting)) for setting in vary(system, field, values)])
        _draw_points(axes, values, counts, label=text, color=colour, linestyle="")
        lines = [transmitting_nodes(setting) for setting in vary(system, field, fine)]
        axes.plot(fine, lines, color=colour, linewidth=1.2, label=formula)
    axes.set(title="Transmitting nodes (ANTNP)", xlabel=label, ylabel="nodes a period")
    _finish(axes)


def _of(name: str) -> tuple[str, tuple[float, ...], str]:
    """Field of a setting, its values, label of the axis."""
    field, values, heading = SWEEPS[name]
    words, _, unit = heading.rpartition(" ")
    return field, values, heading if unit == "N" else f"{words} [{unit}]"


def _draw_points(axes: Axes, values: tuple[float, ...], measured: np.ndarray, **style: Any) -> None:
    """Figures and their standard errors (n, 2)."""
    axes.errorbar(
        values, measured[:, 0], 2 * measured[:, 1], marker="o", markersize=3.5, capsize=2, linewidth=1.5, **style
    )


def _finish(axes: Axes) -> None:
    """From 0, with room for the legend."""
    tidy(axes)
    axes.set_ylim(0, 1.25 * axes.get_ylim()[1])
    axes.legend(frameon=False, ncols=3 if len(axes.get_legend_handles_labels()[0]) > 4 else 2, loc="upper center")
