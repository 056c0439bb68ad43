"""The picture of an evaluation: error against energy."""

from __future__ import annotations

from math import pi, sqrt
from typing import TYPE_CHECKING, Any

import numpy as np

from wsn_env.envs.rendering.colours import BLUE, DARK, GREEN, GREY, VERMILION
from wsn_env.evaluation.comparison import Evaluation, stem_of
from wsn_env.evaluation.intervals import Summary
from wsn_env.models.arguments import checked
from wsn_env.models.quantity import short, suggest
from wsn_env.reports.labels import Label, write_labels
from wsn_env.reports.pictures import escape_label

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

EMPHASIS, FAMILY, OTHER, REFERENCE = VERMILION, BLUE, DARK, GREEN
NARROW = 3  # energies that span less are drawn on a linear axis
ROUND = sqrt(pi) / 2  # mean error over RMS of a round Gaussian in the plane


def draw_comparison(evaluation: Evaluation, lam: float, emphasis: str | None = None) -> Figure:
    """Figure of mean error against energy with intervals, and the curve of equal return through one policy.

    Policies that differ by a number at the end of their names are joined by a line, and labelled by the number. The
    reference with all nodes awake is drawn as the mean error of a round Gaussian of its RMS (sqrt(pi) / 2 of it).

    Args:
        lam: one of the evaluation's.
        emphasis: the policy to make stand out.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 5.2), layout="constrained")
    plot_comparison(evaluation, lam, emphasis, figure.subplots())
    return figure


@checked
def plot_comparison(
    evaluation: Evaluation, lam: float | None = None, emphasis: str | None = None, ax: Any = None
) -> Any:
    """Mean error against energy at one trade-off, as `draw_comparison`, for a notebook.

    Args:
        lam: one of the evaluation's; None: the middle one.
        emphasis: the policy to make stand out.
        ax: axes to draw in; None: new ones.

    Returns: the axes.
    """
    if emphasis is not None and emphasis not in evaluation.policies:
        raise ValueError(f"emphasis {emphasis!r} is unknown: {suggest(emphasis, evaluation.policies)}")
    axes = axes_of(ax)
    lam = evaluation.middle_lam if lam is None else lam
    points, labels = {}, []
    for policy in evaluation.policies:
        s = evaluation.summary(policy, lam)
        points[policy] = s["energy_mj"], s["error_m"]
        numbered = stem_of(policy) != policy and stem_of(policy) in evaluation.families()
        strong = policy == emphasis
        colour = EMPHASIS if strong else FAMILY if numbered else OTHER
        _draw_point(axes, *points[policy], colour, strong)
        name = policy.removeprefix(stem_of(policy)) if numbered else policy
        labels.append(Label(name, (points[policy][0].mean, points[policy][1].mean), colour))
    for stem in evaluation.families():
        family = sorted(
            (points[policy][0].mean, points[policy][1].mean) for policy in points if stem_of(policy) == stem
        )
        axes.plot(*zip(*family), color=FAMILY, linewidth=1, label=escape_label(evaluation.family_name(stem)), zorder=1)
    draw_reference_line(axes, evaluation)
    energies = [energy.mean for energy, _ in points.values()]
    if max(energies) > NARROW * min(energies) > 0:
        axes.set_xscale("log")
        label_decades(axes.xaxis)
    if emphasis is not None:
        energy, error = points[emphasis]
        limits = axes.axis()
        xs = np.linspace(*limits[:2], 1000)
        ys = error.mean + lam * (energy.mean - xs)
        axes.plot(xs, ys, "--", color=GREY, linewidth=1, label=escape_label(f"return of {emphasis}"), zorder=1)
        axes.axis(limits)
    axes.legend(frameon=False)
    axes.set_xlabel("energy [mJ per time step]")
    axes.set_ylabel("mean error [m]")
    axes.set_title(
        escape_label(f"{evaluation.scenario.title}, lam = {lam:g} m/mJ, {evaluation.episodes} paired episodes")
    )
    axes.grid(alpha=0.3)
    write_labels(axes, labels)
    return axes


def axes_of(ax: Any) -> Axes:
    """The axes; None: new ones, of a figure that a notebook shows.

    Raises:
        ValueError: no axes.
    """
    import matplotlib.pyplot as plt
    from matplotlib.axes import Axes

    if ax is None:
        return plt.subplots(figsize=(8, 5.2), layout="constrained")[1]
    if not isinstance(ax, Axes):
        raise ValueError(f"ax = {short(repr(ax))}: must be matplotlib's axes, or None")
    return ax


def label_decades(axis: Axis) -> None:
    """Numbers in full at 1, 2, 3, 5 and 7 of each decade of a logarithmic axis."""
    axis.set_major_formatter(lambda value, _: f"{value:g}")
    axis.set_minor_formatter(lambda value, _: f"{value:g}" if f"{value:e}"[0] in "2357" else "")
    axis.set_tick_params(which="both", labelsize=9, length=3.5)


def draw_reference_line(axes: Axes, evaluation: Evaluation) -> None:
    """A line at the mean error of a round Gaussian whose RMS is the reference with all nodes awake, if there is one."""
    all_awake_m = evaluation.reference_all_awake_m()
    if all_awake_m is not None:
        label = f"reference with all nodes awake: {all_awake_m:.3g} m RMS"
        axes.axhline(ROUND * all_awake_m, color=REFERENCE, linewidth=1, linestyle=":", label=label)


def _draw_point(axes: Axes, energy: Summary, error: Summary, colour: str, strong: bool) -> None:
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
