"""The picture of fronts: error against energy at every lam, up to the reference point."""

from __future__ import annotations

from itertools import count, cycle
from textwrap import fill
from typing import TYPE_CHECKING, Any

from wsn_env.envs.rendering.colours import GREY, LINES
from wsn_env.evaluation.comparison import Evaluation
from wsn_env.evaluation.front import (
    Fronts,
    Point,
    find_fronts,
    join_points,
    reference_point,
    split_number,
)
from wsn_env.models.arguments import checked
from wsn_env.reports.labels import Label, write_labels
from wsn_env.reports.pictures import escape_label
from wsn_env.reports.plots import axes_of, draw_reference_line, label_decades

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MARKERS = "osD^vP*d<>p"  # for where colours run out or into each other
MARGIN = 1.2  # of the picture beyond the reference point and the best figures, as a factor
SMALL = 8.0  # points
NARROW = 4  # errors that span less are drawn on a linear axis


def draw_fronts(evaluation: Evaluation, found: Fronts) -> Figure:
    """Figure of mean error against energy: a line through each front, and the reference point's box.

    Energy is logarithmic, so is the error where it spans much. What lies beyond the box is named below the axes.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 6), layout="constrained")
    plot_fronts(evaluation, found, figure.subplots())
    return figure


@checked
def plot_fronts(evaluation: Evaluation, found: Fronts | None = None, ax: Any = None) -> Any:
    """Fronts of mean error against energy over the trade-offs, as `draw_fronts`, for a notebook.

    Args:
        found: some fronts; None: every policy's, those that differ by a number at the end together.
        ax: axes to draw in; None: new ones.

    Returns: the axes.
    """
    axes = axes_of(ax)
    found = find_fronts(evaluation) if found is None else found
    error, energy = reference_point(evaluation.scenario)
    top, right = error * MARGIN, energy * MARGIN
    axes.set(xscale="log", yscale="log", title=escape_label(front_title(evaluation)))
    beyond: list[Point] = []
    labels: list[Label] = []
    for (name, points), colour, marker, over in zip(found.items(), cycle(LINES), cycle(MARKERS), count(3, -0.01)):
        near = [point for point in points if point.error.mean < top and point.energy.mean < right]
        beyond += [point for point in points if point not in near]
        _draw_line(axes, name, near, colour, marker, over)
        labels += [Label(text, point, colour, SMALL) for text, point in _labels(near)]
    drawn = [point for point in join_points(found.values()) if point not in beyond]
    left = min((point.energy.low for point in drawn if point.energy.low > 0), default=energy / 10) / MARGIN
    bottom = min((point.error.low for point in drawn if point.error.low > 0), default=error / 10) / MARGIN**0.5
    axes.plot([left, energy, energy], [error, error, bottom], "--", color=GREY, linewidth=1, zorder=1)
    draw_reference_line(axes, evaluation)
    axes.annotate(
        "reference point",
        (energy, error),
        color=GREY,
        fontsize=9,
        xytext=(-4, 5),
        textcoords="offset points",
        ha="right",
    )
    if top < NARROW * bottom:
        axes.set_yscale("linear")
    axes.set(xlim=(left, right), ylim=(bottom, top), ylabel="mean error [m]")
    for axis in (axes.xaxis, axes.yaxis):
        if axis.get_scale() == "log":
            label_decades(axis)
    outside = [f"{p.policy}{_at(p)}: {p.energy.mean:.3g} mJ, {p.error.mean:.3g} m" for p in beyond]
    lines = fill("beyond: " + "; ".join(outside), 120) if outside else ""
    axes.set_xlabel(escape_label(f"energy [mJ per time step]\n{lines}".rstrip()))
    axes.grid(alpha=0.3, which="both", linewidth=0.5)
    below = -0.12 - 0.035 * len(lines.splitlines())  # the words under the axis
    axes.legend(frameon=False, loc="upper center", bbox_to_anchor=(0.5, below), ncols=4, fontsize=9)
    write_labels(axes, labels)
    return axes


def _draw_line(axes: Axes, name: str, points: list[Point], colour: str, marker: str, over: float) -> None:
    if not points:
        return
    points = sorted(points, key=lambda point: (point.energy.mean, -(point.lam or 0)))
    ends = [[(s.mean, s.mean - s.low, s.high - s.mean) for s in (p.energy, p.error)] for p in points]
    (x, x_low, x_high), (y, y_low, y_high) = (zip(*axis) for axis in zip(*ends))
    line = "-" if len(points) > 1 else "none"
    axes.errorbar(
        x,
        y,
        xerr=[x_low, x_high],
        yerr=[y_low, y_high],
        color=colour,
        marker=marker,
        markersize=6,
        linestyle=line,
        linewidth=1.2,
        elinewidth=1,
        label=escape_label(name),
        zorder=over + (len(points) == 1),
    )


def _labels(points: list[Point]) -> list[tuple[str, tuple[float, float]]]:
    """Words and points: a family's numbers, or the lams at the ends of a policy's front."""
    if len({point.policy for point in points}) > 1:
        return [(split_number(p.policy)[1], (p.energy.mean, p.error.mean)) for p in points]
    by_lam = sorted(points, key=lambda point: point.lam or 0)
    ends = (by_lam[0], by_lam[-1]) if len(points) > 1 else ()
    return [(_at(p).strip(), (p.energy.mean, p.error.mean)) for p in ends]


def _at(point: Point) -> str:
    return "" if point.lam is None else f" lam {point.lam:g}"


def front_title(evaluation: Evaluation) -> str:
    """Scenario, lams and number of episodes."""
    lams = evaluation.lams
    span = f"lam = {min(lams):g} to {max(lams):g} m/mJ" if len(lams) > 1 else f"lam = {lams[0]:g} m/mJ"
    return f"{evaluation.scenario.title}, {span}, {evaluation.episodes} paired episodes"
