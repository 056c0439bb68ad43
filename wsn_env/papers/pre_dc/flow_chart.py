"""Fig. 2 of Xiang & Guo (2013): the algorithm as built, as a flow chart."""

from __future__ import annotations

import re
from textwrap import fill
from typing import TYPE_CHECKING, NamedTuple

from wsn_env.envs.rendering.colours import BLUE, DARK, GREEN, VERMILION

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


class Box(NamedTuple):
    """A step or a question."""

    x: float
    y: float  # of the middle
    text: str
    colour: str = BLUE


STEP, ASK, END = BLUE, VERMILION, GREEN
LEFT, RIGHT = 3.0, 9.3
WIDTH, HEIGHT = 5.2, 1.1
LINE = 52  # characters of a line of text in a box
BOXES = {
    "start": Box(LEFT, 14.0, "start: first belief N(truth, P0), no cluster (or a search for the target)", END),
    "keep": Box(
        LEFT,
        12.2,
        "is there a head, is E < Φ0, and is the cluster's joint probability ≥ θ at the prediction (step g, eq. 4)?",
        ASK,
    ),
    "form": Box(
        RIGHT,
        12.2,
        "new head: the living node nearest to the prediction; neighbours join in order of p(d) until the joint"
        " probability exceeds θ; handover, invitations",
    ),
    "sense": Box(
        LEFT, 10.4, "the target moves (eqs. 6, 8); members detect it with p(d) (eqs. 2-3) and measure it (eq. 7)"
    ),
    "weigh": Box(
        LEFT,
        8.6,
        "each that detects it weighs its share of the particles and sends its sums to the head (eqs. 9-15);"
        " a lost packet is sent again, three times at most (assumption d)",
    ),
    "pool": Box(LEFT, 6.8, "the head pools the sums to estimate and covariance (eqs. 9-15)"),
    "ask resampling": Box(LEFT, 5.0, "is N_eff < 2P / 3 (eq. 14)?", ASK),
    "resample": Box(RIGHT, 5.0, "the head broadcasts; systematic resampling"),
    "ask search": Box(LEFT, 3.2, "is the track lost (only where searching is on)?", ASK),
    "search": Box(
        RIGHT,
        3.2,
        "every node wakes; the strongest signal names the head (eq. 1, step a); the position restarts at the"
        " centroid of the nodes that detect",
    ),
    "predict": Box(LEFT, 1.4, "prediction for k + 1, its covariance and E (eq. 16)"),
    "end": Box(RIGHT, 1.4, "after the last period: RMS (eq. 17)", END),
}
DOWN = ("start", "keep", "sense", "weigh", "pool", "ask resampling", "ask search", "predict")
BACK_X = -0.35  # of the way from the last step to the first question


def draw_flow_chart() -> Figure:
    """A column of steps and questions, what a question leads to beside it."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.6, 11.0), layout="constrained")
    axes = figure.subplots()
    axes.set(xlim=(-0.8, 12.1), ylim=(0.6, 14.8), title="Fig. 2: Pre-DC as built, one period after the other")
    axes.set_axis_off()
    for box in BOXES.values():
        _draw_box(axes, box)
    for above, below in zip(DOWN, DOWN[1:], strict=False):
        word = {"keep": "yes: keep the cluster", "ask resampling": "no", "ask search": "no"}.get(above, "")
        _arrow(axes, (LEFT, BOXES[above].y - HEIGHT / 2), (LEFT, BOXES[below].y + HEIGHT / 2), word)
    for question, step, after in (("keep", "form", "sense"), ("ask resampling", "resample", "ask search")):
        _branch(axes, question, step, after)
    _branch(axes, "ask search", "search", "predict")
    edge = LEFT + WIDTH / 2
    _arrow(axes, (edge, BOXES["predict"].y), (RIGHT - WIDTH / 2, BOXES["end"].y), "")
    y, top = BOXES["predict"].y, BOXES["keep"].y
    axes.plot([LEFT - WIDTH / 2, BACK_X, BACK_X], [y, y, top], color=DARK, linewidth=1.2)
    _arrow(axes, (BACK_X, top), (LEFT - WIDTH / 2, top), "")
    axes.text(BACK_X - 0.1, (y + top) / 2, "next period", rotation=90, ha="right", va="center", fontsize=9, color=DARK)
    return figure


def _draw_box(axes: Axes, box: Box) -> None:
    from matplotlib.patches import FancyBboxPatch

    corner = box.x - WIDTH / 2, box.y - HEIGHT / 2
    style = "round,pad=0,rounding_size=0.5" if box.colour == ASK else "round,pad=0,rounding_size=0.1"
    axes.add_patch(
        FancyBboxPatch(corner, WIDTH, HEIGHT, boxstyle=style, fill=False, edgecolor=box.colour, linewidth=1.5)
    )
    axes.text(box.x, box.y, _lines(box.text), ha="center", va="center", fontsize=8.5)


def _lines(text: str) -> str:
    """Broken into lines, but not between "eq." or "step" and what it is."""
    return fill(re.sub(r"(eqs?\.|step) ", "\\1\u00a0", text), LINE, break_on_hyphens=False)


def _branch(axes: Axes, question: str, step: str, after: str) -> None:
    """From a question to the step beside it, and from there back above the next step."""
    word = "no" if question == "keep" else "yes"
    _arrow(axes, (LEFT + WIDTH / 2, BOXES[question].y), (RIGHT - WIDTH / 2, BOXES[step].y), word)
    low = (BOXES[question].y + BOXES[after].y) / 2
    axes.plot([RIGHT, RIGHT], [BOXES[step].y - HEIGHT / 2, low], color=DARK, linewidth=1.2)
    _arrow(axes, (RIGHT, low), (LEFT, low), "")


def _arrow(axes: Axes, start: tuple[float, float], end: tuple[float, float], word: str) -> None:
    axes.annotate(
        "", xy=end, xytext=start, arrowprops=dict(arrowstyle="-|>", color=DARK, linewidth=1.2, shrinkA=0, shrinkB=0)
    )
    down = start[0] == end[0]
    x, y = (start[0] + 0.1, (3 * start[1] + end[1]) / 4) if down else (start[0] + 0.1, start[1] + 0.1)
    axes.text(x, y, word, fontsize=8.5, color=DARK, va="center" if down else "bottom")
