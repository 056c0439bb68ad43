"""Where things are on a frame: field, ruler and legend."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from wsn_env.envs.rendering.canvas import Canvas, text_width
from wsn_env.envs.rendering.marks import draw_arrow, draw_crosses, draw_estimate, draw_target
from wsn_env.envs.rendering.palette import BLUE, DIM, EMPTY, FRAME, FULL, INK, ORANGE, PAPER, SENSED, SKY, VERMILION
from wsn_env.scenario import Scenario

SIZE, SMALLEST = 600, 64  # pixels
WORDS_FROM = 280  # smaller frames have neither numbers nor legend
SEEN = 1.5  # how many points a particle is


class Plan(NamedTuple):
    """Where things are on a frame of a size, and what never changes on it."""

    paper: np.ndarray  # (size, size, 3) uint8: legend and field, empty
    font: int  # px
    line: int  # px from a line of text to the next
    unit: float  # px that are one of SIZE's
    scale: float  # px/m
    field: tuple[int, int, int, int]  # left, top, right, bottom
    flash: int  # px about the field that a search colours

    def pixels(self, points: np.ndarray) -> np.ndarray:
        """(..., 2) from m."""
        return np.array((self.field[0], self.field[3])) + np.asarray(points) * (self.scale, -self.scale)


@lru_cache(maxsize=16)
def plan_of(size: int, name: str, room_m: tuple[float, float], entries: tuple[tuple[str, str], ...]) -> Plan:
    """The plan of frames of this size."""
    font, unit = max(10, round(size / 40)), size / SIZE
    line = round(1.32 * font)
    edge = round(12 * unit) + 2
    lines = _break_into_lines(entries, font, size - font) if size >= WORDS_FROM else []
    head = (2 if lines else 1) * line + font // 3
    low = size - len(lines) * line - (font // 2 if lines else 0)
    flash = max(2, round(4 * unit))
    wide, tall = size - 2 * edge, low - head - edge // 2 - line - flash
    scale = min(wide / room_m[0], tall / room_m[1])
    left, top = round((size - scale * room_m[0]) / 2), head + edge // 2 + round((tall - scale * room_m[1]) / 2)
    field = (left, top, left + round(scale * room_m[0]), top + round(scale * room_m[1]))
    paper = np.full((size, size, 3), PAPER, np.uint8)
    plan = Plan(paper, font, line, unit, scale, field, flash)
    canvas = Canvas(paper)
    canvas.box(*widened(field, 1), FRAME)
    canvas.box(*field, PAPER)
    for number, entries_of_line in enumerate(lines):
        y = low + number * line
        for x, symbol, words in entries_of_line:
            _draw_symbol(canvas, plan, symbol, np.array((x + 0.6 * font, y + 0.62 * font)))
            canvas.text(round(x + 1.5 * font), y, words, font, INK)
    _draw_ruler(canvas, plan, room_m)
    paper.flags.writeable = False
    return plan


def legend(scenario: Scenario) -> tuple[tuple[str, str], ...]:
    """(symbol, words) of what a scenario's frames may show."""
    receiver = scenario.radio.receiver
    entries = [("node", "node"), ("low", "battery low"), ("dead", "dead"), ("member", "awake")]
    entries += [("head", "head")] * (receiver == "head") + [("sink", "sink")] * (receiver == "sink")
    entries += [("radius", "sensing range")] * shows_radius(scenario)
    entries += [("heard", _detection_words(scenario)), ("report", "report")]
    entries += [("handover", "handover")] * (receiver == "head")
    entries += [("cloud", "particles")] * (scenario.tracking.tracker == "particle")
    return (*entries, ("estimate", "estimate, 95 %"), ("target", "target"))


def shows_radius(scenario: Scenario) -> bool:
    """Whether nodes sense up to a radius that fits into the field."""
    return not scenario.measurement.lasting_errors and scenario.radius_m < max(scenario.field.room_m)


def _detection_words(scenario: Scenario) -> str:
    verb = scenario.measurement.verb
    return "has heard" if verb == "reported" and scenario.radio.receiver == "target" else verb


def _break_into_lines(entries, font, width) -> list[list[tuple[int, str, str]]]:
    """Entries of a legend by lines, with the x of each."""
    lines: list[list[tuple[int, str, str]]] = [[]]
    x = font // 2
    for symbol, words in entries:
        wide = round(1.5 * font) + text_width(words, font)
        if x + wide > width:
            lines.append([])
            x = font // 2
        lines[-1].append((x, symbol, words))
        x += wide + font
    return lines


def _draw_symbol(canvas, plan, symbol, centre) -> None:
    unit, ends = plan.unit, np.array((0.5 * plan.font, 0.0))
    radius = max(5.5 * unit, 2.2)
    if symbol in ("node", "low"):
        canvas.discs(centre, 4.0 * unit, FULL)
        if symbol == "low":
            canvas.discs(centre, 2.8 * unit, EMPTY)
    elif symbol == "dead":
        draw_crosses(canvas, centre[None], 3.6 * unit, max(1.0, 1.2 * unit))
    elif symbol == "member":
        canvas.discs(centre, radius, BLUE)
    elif symbol == "head":
        canvas.discs(centre, radius + max(2.0 * unit, 1.0), VERMILION)
    elif symbol == "sink":
        canvas.discs(centre, 1.3 * radius, VERMILION, square=True)
    elif symbol == "radius":
        canvas.discs(centre, 0.5 * plan.font, SENSED[1])
    elif symbol == "heard":
        ring = radius + max(2.5 * unit, 1.5)
        canvas.discs(centre, ring, ORANGE, hole=ring - max(2 * unit, 1.2))
    elif symbol == "report":
        canvas.lines(centre - ends, centre + ends, max(1.5, 2.2 * unit), ORANGE)
    elif symbol == "handover":
        draw_arrow(canvas, centre - ends, centre + ends, max(1.5, 2.5 * unit), max(3.0, 5.0 * unit))
    elif symbol == "cloud":
        points = centre[:, None] + 0.24 * plan.font * np.random.default_rng(0).standard_normal((2, 60))
        canvas.cloud(*points, np.full(60, SEEN), SKY)
    elif symbol == "estimate":
        draw_estimate(canvas, centre, 0.6 * unit, 0.5 * plan.font * np.array(((1.0, 0.0), (0.0, 0.75))))
    else:
        draw_target(canvas, centre, unit)


def _draw_ruler(canvas, plan, room_m) -> None:
    """A length below the field."""
    longest_m = room_m[0] / 5
    power = 10.0 ** np.floor(np.log10(longest_m))
    length = max(step * power for step in (1, 2, 5) if step * power <= longest_m)
    left, _, _, bottom = plan.field
    end = left + length * plan.scale
    y = bottom + plan.flash
    canvas.lines((left, y + 0.6 * plan.font), (end, y + 0.6 * plan.font), max(2.0, 3.0 * plan.unit), DIM)
    canvas.text(round(end) + plan.font // 2, y, f"{length:g} m", plan.font, DIM)


def widened(box: Any, by: int) -> tuple[int, int, int, int]:
    return box[0] - by, box[1] - by, box[2] + by, box[3] + by
