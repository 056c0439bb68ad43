"""Fronts for people: tables in the terminal, and the picture of error against energy up to the reference point."""

from __future__ import annotations

from itertools import count, cycle
from math import floor, log10
from pathlib import Path
from textwrap import fill

from wsn_env.envs.rendering.colours import GREY, LINES
from wsn_env.evaluation.comparison import Evaluation
from wsn_env.evaluation.front import (
    Fronts,
    Point,
    Volume,
    fronts,
    hypervolumes,
    joined,
    numbered,
    reference_point,
    save_front,
)
from wsn_env.reports.pictures import plain, write_picture
from wsn_env.reports.tables import draw_floor, interval_text, plain_ticks, wide_console

FRONT_FILES = ("front.csv", "front.json", "front.png")

MARKERS = "osD^vP*X<>p"  # for where colours run out or into each other
MARGIN = 1.2  # of the picture beyond the reference point and the best figures, as a factor
LETTER = (6, 14)  # px that one takes
NARROW = 4  # errors that span less are drawn on a linear axis


def report_front(evaluation: Evaluation, out: Path | None = None) -> None:
    """Print the fronts and their hypervolumes; write front.csv, front.json and front.png into a folder, if any."""
    found = fronts(evaluation)
    reference = reference_point(evaluation.scenario)
    volumes = hypervolumes(found, reference)
    print_front(evaluation, found)
    print_hypervolumes(volumes, reference)
    if out is not None:
        save_front(evaluation, found, volumes, out)
        write_picture(out / "front.png", draw_fronts(evaluation, found))


def print_front(evaluation: Evaluation, found: Fronts) -> None:
    """A row for every point."""
    from rich.markup import escape
    from rich.table import Table

    table = Table(title=_title(evaluation), caption="means with 95 % bootstrap intervals")
    for column in ("policy", "lam m/mJ", "mean error m", "energy mJ/period"):
        table.add_column(column, justify="left" if column == "policy" else "right")
    fine, small = map(_digits, reference_point(evaluation.scenario))
    for points in found.values():
        for point in points:
            lam = "any" if point.lam is None else f"{point.lam:g}"
            figures = interval_text(point.error, fine), interval_text(point.energy, small)
            table.add_row(escape(point.policy), lam, *figures)
        table.add_section()
    wide_console().print(table)


def print_hypervolumes(volumes: list[Volume], reference: tuple[float, float]) -> None:
    """A row for every front: its hypervolume, its part of the reference point's box, the paired difference."""
    from rich.markup import escape
    from rich.table import Table

    error, energy = reference
    first = escape(volumes[0].front)
    table = Table(
        title="Hypervolume",
        caption=f"up to the reference point of {error:g} m and {energy:g} mJ; 95 % bootstrap intervals, paired",
    )
    for column in ("front", "hypervolume m mJ", "of the box", f"{first} minus it"):
        table.add_column(column, justify="left" if column == "front" else "right")
    digits = _digits(error * energy)
    for volume in volumes:
        difference = "" if volume.difference is None else interval_text(volume.difference, digits, "+")
        share = f"{100 * volume.hypervolume.mean / (error * energy):.1f} %"
        table.add_row(escape(volume.front), interval_text(volume.hypervolume, digits), share, difference)
    wide_console().print(table)


def draw_fronts(evaluation: Evaluation, found: Fronts):
    """Figure of mean error against energy: a line through each front, and the reference point's box.

    Energy is logarithmic, so is the error where it spans much. What lies beyond the box is named below the axes.
    """
    from matplotlib.figure import Figure

    error, energy = reference_point(evaluation.scenario)
    top, right = error * MARGIN, energy * MARGIN
    figure = Figure(figsize=(9, 6), layout="constrained")
    axes = figure.subplots()
    axes.set(xscale="log", yscale="log", title=plain(_title(evaluation)))
    beyond, labels = [], []
    for (name, points), colour, marker, over in zip(found.items(), cycle(LINES), cycle(MARKERS), count(3, -0.01)):
        near = [point for point in points if point.error.mean < top and point.energy.mean < right]
        beyond += [point for point in points if point not in near]
        _draw_line(axes, name, near, colour, marker, over)
        labels += [(*label, colour) for label in _labels(near)]
    drawn = [point for point in joined(found.values()) if point not in beyond]
    left = min((point.energy.low for point in drawn if point.energy.low > 0), default=energy / 10) / MARGIN
    bottom = min((point.error.low for point in drawn if point.error.low > 0), default=error / 10) / MARGIN**0.5
    axes.plot([left, energy, energy], [error, error, bottom], "--", color=GREY, linewidth=1, zorder=1)
    draw_floor(axes, evaluation)
    corner = dict(xytext=(-4, 5), textcoords="offset points", ha="right")
    axes.annotate("reference point", (energy, error), color=GREY, fontsize=9, **corner)
    if top < NARROW * bottom:
        axes.set_yscale("linear")
    axes.set(xlim=(left, right), ylim=(bottom, top), ylabel="mean error [m]")
    for axis in (axes.xaxis, axes.yaxis):
        if axis.get_scale() == "log":
            plain_ticks(axis)
    _write_labels(axes, labels)
    outside = [f"{p.policy}{_at(p)}: {p.energy.mean:.3g} mJ, {p.error.mean:.3g} m" for p in beyond]
    lines = fill("beyond: " + "; ".join(outside), 120) if outside else ""
    axes.set_xlabel(plain(f"energy [mJ per period]\n{lines}".rstrip()))
    axes.grid(alpha=0.3, which="both", linewidth=0.5)
    axes.legend(frameon=False, loc="lower left")
    return figure


def _digits(scale: float) -> int:
    """Decimals that show a ten-thousandth of what is as large as `scale`, or whole numbers."""
    return max(0, 3 - floor(log10(scale)))


def _draw_line(axes, name: str, points: list[Point], colour: str, marker: str, over: float) -> None:
    if not points:
        return
    points = sorted(points, key=lambda point: (point.energy.mean, -(point.lam or 0)))
    ends = [[(s.mean, s.mean - s.low, s.high - s.mean) for s in (p.energy, p.error)] for p in points]
    (x, x_low, x_high), (y, y_low, y_high) = (zip(*axis) for axis in zip(*ends))
    line = "-" if len(points) > 1 else "none"
    style = dict(color=colour, marker=marker, markersize=6, linestyle=line, linewidth=1.2, elinewidth=1)
    style |= dict(label=plain(name), zorder=over + (len(points) == 1))
    axes.errorbar(x, y, xerr=[x_low, x_high], yerr=[y_low, y_high], **style)


def _labels(points: list[Point]) -> list[tuple[str, tuple[float, float], tuple[int, int]]]:
    """Words, point and offset [pt]: a family's numbers, or the lams at the ends of a policy's front."""
    if len({point.policy for point in points}) > 1:
        return [(numbered(p.policy)[1], (p.energy.mean, p.error.mean), (-9, -11)) for p in points]
    by_lam = sorted(points, key=lambda point: point.lam or 0)
    ends = (by_lam[0], by_lam[-1]) if len(points) > 1 else ()
    return [(_at(p), (p.energy.mean, p.error.mean), (2, 8)) for p in ends]


def _write_labels(axes, labels) -> None:
    """Those of earlier fronts first; what would lie on another is left out."""
    taken = []
    for text, point, place, colour in labels:
        x, y = axes.transData.transform(point) + place
        if all(abs(x - left) > LETTER[0] * max(n, len(text)) or abs(y - low) > LETTER[1] for left, low, n in taken):
            taken.append((x, y, len(text)))
            style = dict(xytext=place, textcoords="offset points", fontsize=8, color=colour)
            axes.annotate(plain(text), point, **style)


def _at(point: Point) -> str:
    return "" if point.lam is None else f" lam {point.lam:g}"


def _title(evaluation: Evaluation) -> str:
    lams = evaluation.lams
    span = f"lam = {min(lams):g} to {max(lams):g} m/mJ" if len(lams) > 1 else f"lam = {lams[0]:g} m/mJ"
    return f"{evaluation.scenario.name}, {span}, {evaluation.episodes} paired episodes"
