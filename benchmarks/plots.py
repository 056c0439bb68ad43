"""A plot of a result as SVG: log axes, Okabe and Ito's colours, a name at the end of each line."""

from __future__ import annotations

import math
from pathlib import Path

from benchmarks.race import Plot
from wsn_env.envs.rendering.colours import BLACK, BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILION
from wsn_env.evaluation.files import replacing

OURS = {"wsn_env, strict": VERMILION, "wsn_env, fast": ORANGE}
COLOURS = (BLUE, GREEN, PURPLE, SKY, BLACK)  # of the others, with another dash in every turn; yellow is too pale
OUR_ENVIRONMENT = "vector environment"  # how its lines begin
DASHES = ("-", "--", ":")
LABEL_POINTS = 11  # height of a line of text


def draw(plot: Plot, path: Path) -> None:
    """Write the drawing; the same data give the same bytes."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    style = {"svg.hashsalt": plot.name, "svg.fonttype": "none", "font.size": 9, "font.family": "sans-serif"}
    with pyplot.rc_context(style):
        figure, axes = pyplot.subplots(figsize=(8, 5 if len(plot.lines) <= 12 else 6.5), layout="constrained")
        colours = {}
        others = [name for name in plot.lines if name not in OURS]
        for name, line in plot.lines.items():
            turn = others.index(name) if name in others else 0
            colours[name] = OURS.get(name) or COLOURS[turn % len(COLOURS)]
            if name.startswith(OUR_ENVIRONMENT):
                colours[name] = VERMILION
            dash = "-" if name in OURS else DASHES[turn // len(COLOURS) % len(DASHES)]
            width = 2.5 if name in OURS else 1.4
            axes.loglog(*zip(*line), dash, color=colours[name], linewidth=width, marker="o", markersize=width + 1.5)
        axes.set(title=plot.title, xlabel=plot.x, ylabel=plot.y)
        axes.grid(which="major", color="#dddddd")
        axes.spines[["top", "right"]].set_visible(False)
        _label(axes, plot, colours)
        with replacing(path) as temporary:
            figure.savefig(temporary, format="svg", metadata={"Date": None})
        pyplot.close(figure)


def _label(axes, plot: Plot, colours: dict[str, str]) -> None:
    """Names beside the lines' ends, moved apart where they would overlap."""
    names = sorted(plot.lines, key=lambda name: plot.lines[name][-1][1])
    low, high = axes.get_ylim()
    height = 72 * axes.get_figure().get_figheight() * 0.85  # of the axes [points]
    per_point = math.log(high / low) / height
    ends = [math.log(plot.lines[name][-1][1]) for name in names]
    places = _move_apart(ends, LABEL_POINTS * per_point)
    for name, end, place in zip(names, ends, places):
        x, y = plot.lines[name][-1]
        axes.annotate(
            name,
            (x, y),
            xytext=(14, (place - end) / per_point),
            textcoords="offset points",
            color=colours[name],
            va="center",
            fontweight="bold" if name in OURS else "normal",
            arrowprops={"arrowstyle": "-", "color": colours[name], "linewidth": 0.5, "shrinkA": 0, "shrinkB": 2},
            annotation_clip=False,
        )


def _move_apart(places: list[float], distance: float) -> list[float]:
    """Ascending places moved as little as it takes to keep a distance: neighbours too near share their mean."""
    groups: list[tuple[float, int]] = []  # centre, members
    for place in places:
        centre, members = place, 1
        while groups and centre - groups[-1][0] < distance * (members + groups[-1][1]) / 2:
            before, count = groups.pop()
            centre, members = (centre * members + before * count) / (members + count), members + count
        groups.append((centre, members))
    return [centre + distance * (i - (count - 1) / 2) for centre, count in groups for i in range(count)]
