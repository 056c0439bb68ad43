"""The picture of fronts: error against energy at every lam, up to the reference point."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count, cycle
from textwrap import fill
from typing import TYPE_CHECKING

from wsn_env.envs.rendering.colours import GREY, LINES
from wsn_env.evaluation.comparison import Evaluation
from wsn_env.evaluation.front import (
    Fronts,
    Point,
    join_points,
    reference_point,
    split_number,
)
from wsn_env.reports.pictures import escape_label
from wsn_env.reports.plots import draw_reference_line, label_decades

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MARKERS = "osD^vP*X<>p"  # for where colours run out or into each other
MARGIN = 1.2  # of the picture beyond the reference point and the best figures, as a factor
LETTER = (6, 14)  # px that one takes
NARROW = 4  # errors that span less are drawn on a linear axis


Label = tuple[str, tuple[float, float], tuple[int, int], str]  # text, point, offset [pt], colour


def draw_fronts(evaluation: Evaluation, found: Fronts) -> Figure:
    """Figure of mean error against energy: a line through each front, and the reference point's box.

    Energy is logarithmic, so is the error where it spans much. What lies beyond the box is named below the axes.
    """
    from matplotlib.figure import Figure

    error, energy = reference_point(evaluation.scenario)
    top, right = error * MARGIN, energy * MARGIN
    figure = Figure(figsize=(9, 6), layout="constrained")
    axes = figure.subplots()
    axes.set(xscale="log", yscale="log", title=escape_label(front_title(evaluation)))
    beyond: list[Point] = []
    labels: list[Label] = []
    for (name, points), colour, marker, over in zip(found.items(), cycle(LINES), cycle(MARKERS), count(3, -0.01)):
        near = [point for point in points if point.error.mean < top and point.energy.mean < right]
        beyond += [point for point in points if point not in near]
        _draw_line(axes, name, near, colour, marker, over)
        labels += [(*label, colour) for label in _labels(near)]
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
    _write_labels(axes, labels)
    outside = [f"{p.policy}{_at(p)}: {p.energy.mean:.3g} mJ, {p.error.mean:.3g} m" for p in beyond]
    lines = fill("beyond: " + "; ".join(outside), 120) if outside else ""
    axes.set_xlabel(escape_label(f"energy [mJ per period]\n{lines}".rstrip()))
    axes.grid(alpha=0.3, which="both", linewidth=0.5)
    axes.legend(frameon=False, loc="lower left")
    return figure


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


def _labels(points: list[Point]) -> list[tuple[str, tuple[float, float], tuple[int, int]]]:
    """Words, point and offset [pt]: a family's numbers, or the lams at the ends of a policy's front."""
    if len({point.policy for point in points}) > 1:
        return [(split_number(p.policy)[1], (p.energy.mean, p.error.mean), (-9, -11)) for p in points]
    by_lam = sorted(points, key=lambda point: point.lam or 0)
    ends = (by_lam[0], by_lam[-1]) if len(points) > 1 else ()
    return [(_at(p), (p.energy.mean, p.error.mean), (2, 8)) for p in ends]


def _write_labels(axes: Axes, labels: Sequence[Label]) -> None:
    """Those of earlier fronts first; what would lie on another is left out."""
    taken: list[tuple[float, float, int]] = []
    for text, point, place, colour in labels:
        x, y = axes.transData.transform(point) + place
        if all(abs(x - left) > LETTER[0] * max(n, len(text)) or abs(y - low) > LETTER[1] for left, low, n in taken):
            taken.append((x, y, len(text)))
            axes.annotate(escape_label(text), point, xytext=place, textcoords="offset points", fontsize=8, color=colour)


def _at(point: Point) -> str:
    return "" if point.lam is None else f" lam {point.lam:g}"


def front_title(evaluation: Evaluation) -> str:
    """Scenario, lams and number of episodes."""
    lams = evaluation.lams
    span = f"lam = {min(lams):g} to {max(lams):g} m/mJ" if len(lams) > 1 else f"lam = {lams[0]:g} m/mJ"
    return f"{evaluation.scenario.name}, {span}, {evaluation.episodes} paired episodes"
