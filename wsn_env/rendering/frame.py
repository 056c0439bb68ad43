"""One picture of a state: field, batteries, cluster, reports, particles, estimate and truth."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from wsn_env.rendering.canvas import Canvas, ellipse, text_width
from wsn_env.rendering.trail import Trail
from wsn_env.scenario import Scenario
from wsn_env.types import State

# Okabe and Ito's palette: told apart by colour-blind eyes too.
INK = (0, 0, 0)
ORANGE, SKY, GREEN, YELLOW = (230, 159, 0), (86, 180, 233), (0, 158, 115), (240, 228, 66)
BLUE, VERMILLION, PURPLE = (0, 114, 178), (213, 94, 0), (204, 121, 167)
PAPER, FLASH, FRAME, DIM = (255, 255, 255), (255, 250, 205), (170, 170, 170), (105, 105, 105)
CROSS = (140, 140, 140)
FULL, EMPTY = (125, 133, 140), (232, 234, 236)  # a node's inside, by its battery
SENSED = ((243, 243, 239), (233, 233, 228), (223, 223, 217), (213, 213, 206))  # by how many awake nodes sense there

SIZE, SMALLEST = 600, 64  # pixels
WORDS_FROM = 240  # smaller frames have neither numbers nor legend
ELLIPSE = 5.991**0.5  # of a Gaussian in two dimensions 95 % lie within so many sds
SEEN = 1.5  # how many points a particle is
FADED = 0.2  # the opacity of a tail's beginning


class Plan(NamedTuple):
    """Where things are on a frame of a size, and what never changes on it."""

    paper: np.ndarray  # (size, size, 3) uint8: legend and field, empty
    font: int  # px
    line: int  # px from a line of text to the next
    unit: float  # px that are one of SIZE's
    scale: float  # px/m
    field: tuple[int, int, int, int]  # left, top, right, bottom

    def pixels(self, points) -> np.ndarray:
        """(..., 2) from m."""
        return np.array((self.field[0], self.field[3])) + np.asarray(points) * (self.scale, -self.scale)


def frame(state: State, scenario: Scenario, trail: Trail, row: int = 0, size: int = SIZE) -> np.ndarray:
    """A frame (size, size, 3) uint8 of a row. Nothing but the arguments decides a pixel, and none is changed.

    Args:
        state: after the period.
        scenario: for the field, the sensing radius, who receives.
        trail: of the periods up to this one, for tails, handovers and numbers.
        row: of the batch.
        size: of a side, in pixels.
    """
    plan = _plan(size, scenario.name, scenario.field.room_m, legend(scenario))
    canvas = Canvas(plan.paper.copy())
    told = trail.last.row[row]
    _write_head(canvas, plan, state, scenario, row, told, trail)
    if told["searched"]:
        _flash(canvas, plan)
    awake = _awake(state, row)
    positions = plan.pixels(state.network.positions[row])
    if len(awake) and shows_radius(scenario):
        canvas.clip = plan.field
        canvas.shade(positions[awake], scenario.radius_m * plan.scale, SENSED)
    canvas.clip = _widened(plan.field, round(9 * plan.unit) + 1)
    _draw_nodes(canvas, plan, state, scenario, row, positions)
    _draw_cloud(canvas, plan, state, row)
    _draw_cluster(canvas, plan, state, scenario, row, positions, awake)
    if told["handover"] and scenario.radio.receiver == "head":
        _draw_handover(canvas, plan, positions, trail.head[row], state.period[row])
    _draw_tracks(canvas, plan, state, scenario, row, trail)
    return canvas.image


def shows_radius(scenario: Scenario) -> bool:
    """Whether nodes sense up to a radius that fits into the field."""
    return not scenario.hears and scenario.radius_m < max(scenario.field.room_m)


def legend(scenario: Scenario) -> tuple[tuple[str, str], ...]:
    """(symbol, words) of what a scenario's frames may show."""
    receiver = scenario.radio.receiver
    entries = [("node", "node"), ("low", "battery low"), ("dead", "dead"), ("member", "awake")]
    entries += [("head", "head")] * (receiver == "head") + [("sink", "sink")] * (receiver == "sink")
    entries += [("radius", "sensing range")] * shows_radius(scenario)
    entries += [("heard", _heard(scenario)), ("report", "report")]
    entries += [("handover", "handover")] * (receiver == "head")
    entries += [("cloud", "particles")] * (scenario.tracking.tracker == "particle")
    return (*entries, ("estimate", "estimate, 95 %"), ("target", "target"))


def _heard(scenario: Scenario) -> str:
    if scenario.binary:
        return "detects"
    return "has heard" if scenario.hears or scenario.radio.receiver == "target" else "detected"


# --- the parts of a frame ---------------------------------------------------------------------------------------


def _flash(canvas: Canvas, plan: Plan) -> None:
    left, top, right, bottom = plan.field
    wide = max(2, round(4 * plan.unit))
    canvas.box(left - wide, top - wide, right + wide, bottom + wide, YELLOW)
    canvas.box(left, top, right, bottom, FLASH)


def _awake(state: State, row: int) -> np.ndarray:
    """The nodes of the standing cluster, its head first."""
    network = state.network
    head, members = network.head[row], network.members[row, : network.n_members[row]]
    return np.concatenate([[head], members]) if head >= 0 else members.astype(np.int64)


def _draw_nodes(canvas, plan, state, scenario, row, positions) -> None:
    """Their inside is the paler the less energy they have left; the dead are crossed out."""
    share = np.clip(state.network.battery[row] / scenario.radio.battery_j, 0.0, 1.0)
    alive, radius = share > 0, _node_radius(plan, len(positions))
    canvas.discs(positions[alive], radius, FULL)
    if (share[alive] < 0.98).any() and radius > 1.5:
        inside = np.array(EMPTY) + share[alive, None] * np.subtract(FULL, EMPTY)
        canvas.discs(positions[alive], radius - max(0.9, 0.3 * radius), inside)
    _draw_crosses(canvas, positions[~alive], 0.8 * radius, max(1.0, 1.2 * plan.unit))


def _draw_crosses(canvas, centres, reach, width) -> None:
    for way in (np.array((reach, reach)), np.array((reach, -reach))):
        canvas.lines(centres - way, centres + way, width, CROSS)


def _node_radius(plan: Plan, nodes: int) -> float:
    """Of a sleeping node on the picture: 2.5 to 3.5 px on a usual frame, less where they are many."""
    left, top, right, bottom = plan.field
    spacing = ((right - left) * (bottom - top) / nodes) ** 0.5
    return min(max(0.11 * spacing, 0.7), max(3.5 * plan.unit, 1.8))


def _draw_cloud(canvas, plan, state, row) -> None:
    x, _, y, _ = state.belief.particles[row]
    if len(x):
        weights = np.exp(state.belief.log_weights[row])
        left, _, _, bottom = plan.field
        weights *= SEEN * len(x) / max(weights.sum(), 1e-30)
        canvas.cloud(left + x * plan.scale, bottom - y * plan.scale, weights, SKY)


def _draw_cluster(canvas, plan, state, scenario, row, positions, awake) -> None:
    """Reports as lines to who receives them; rings about those that detected; the awake, the head, the sink."""
    unit, receiver = plan.unit, scenario.radio.receiver
    head = state.network.head[row]
    reported = state.reports.node[row, : state.reports.count[row]]
    centre = None
    if receiver == "sink":
        centre = plan.pixels(np.array(scenario.field.room_m) / 2)
    elif receiver == "target":
        centre = plan.pixels(_target(state, scenario, row))
    elif head >= 0:
        centre = positions[head]
    if centre is not None and len(reported):
        canvas.lines(positions[reported], np.broadcast_to(centre, (len(reported), 2)), max(1.2, 2.2 * unit), ORANGE)
    radius = max(5.5 * unit, 2.2)
    leads = head >= 0 and receiver == "head"
    seen = _detecting(state, row, awake, reported)
    ring = radius + max(3.5 * unit, 1.8)
    canvas.discs(positions[seen[seen != head]] if leads else positions[seen], ring, ORANGE, hole=ring - 2 * unit)
    canvas.discs(positions[awake], radius, BLUE)
    if leads:
        wide = radius + max(2.5 * unit, 1.2)
        if head in seen:
            ring = wide + max(3.5 * unit, 1.8)
            canvas.discs(centre, ring, ORANGE, hole=ring - 2 * unit)
        canvas.discs(centre, wide + max(unit, 0.7), PAPER)
        canvas.discs(centre, wide, VERMILLION)
    elif receiver == "sink":
        canvas.discs(centre, 1.3 * radius + max(unit, 0.7), PAPER, square=True)
        canvas.discs(centre, 1.3 * radius, VERMILLION, square=True)


def _detecting(state, row, awake, reported) -> np.ndarray:
    """Who reported in the period; of binary sensors those, awake or asked, whose state is 1."""
    bitmap = state.reports.bitmap[row]
    if not len(bitmap):
        return reported
    asked = np.union1d(awake, reported).astype(np.int64)
    return asked[bitmap[asked] > 0]


def _draw_handover(canvas, plan, positions, heads, period) -> None:
    """An arrow from the last head to the present one."""
    period = min(period, len(heads) - 1)
    old, new = heads[period - 1], heads[period]
    if old >= 0 and new >= 0:
        _arrow(canvas, positions[old], positions[new], max(2.0, 3.0 * plan.unit), max(6.0, 10.0 * plan.unit))


def _arrow(canvas, start, end, width, barb) -> None:
    along = (end - start) / max(np.hypot(*(end - start)), 1e-9)
    across = np.array((-along[1], along[0]))
    tip = start + 0.62 * (end - start)
    starts = np.stack([start, tip, tip])
    ends = np.stack([end, tip - barb * (along + 0.55 * across), tip - barb * (along - 0.55 * across)])
    canvas.lines(starts, ends, width, PURPLE)


def _draw_tracks(canvas, plan, state, scenario, row, trail) -> None:
    """Where the target was and is; where the head believed it to be and does, with the ellipse of 95 %."""
    unit, belief = plan.unit, state.belief
    last = min(state.period[row], scenario.periods)
    fading = np.linspace(FADED, 1.0, max(last, 1))
    target = plan.pixels(state.track[row, : last + 1, ::2])
    canvas.lines(target[:-1], target[1:], max(1.2, 2.4 * unit), GREEN, fading)
    believed = plan.pixels(trail.estimate_m[row, : last + 1])
    canvas.lines(believed[:-1], believed[1:], max(1.0, 1.2 * unit), INK, fading)
    _draw_target(canvas, target[-1], unit)
    _draw_estimate(canvas, plan.pixels(belief.mean[row, ::2]), unit, plan.scale * _root(belief.cov[row, ::2, ::2]))


def _target(state, scenario, row) -> np.ndarray:
    return state.track[row, min(state.period[row], scenario.periods), ::2]


def _root(cov) -> np.ndarray:
    """What takes the unit circle to the ellipse of 95 %, y downward."""
    a = max(cov[0, 0], 0.0) ** 0.5
    b = cov[0, 1] / a if a > 0 else 0.0
    c = max(cov[1, 1] - b * b, 0.0) ** 0.5
    return ELLIPSE * np.array(((a, 0.0), (-b, -c)))


def _draw_target(canvas, centre, unit) -> None:
    radius = max(6.0 * unit, 3.2)
    canvas.discs(centre, radius, GREEN, hole=radius - max(2.6 * unit, 1.4))


def _draw_estimate(canvas, centre, unit, axes) -> None:
    outline = ellipse(centre, axes)
    arm = max(5.0 * unit, 2.6)
    ends = np.array(((arm, 0.0), (0.0, arm)))
    width = np.repeat((max(1.0, 1.5 * unit), max(1.2, 1.8 * unit)), (len(outline) - 1, 2))
    starts, ends = np.concatenate([outline[:-1], centre - ends]), np.concatenate([outline[1:], centre + ends])
    canvas.lines(starts, ends, width, INK)


# --- words --------------------------------------------------------------------------------------------------------


def _write_head(canvas, plan, state, scenario, row, told, trail) -> None:
    """Above the field: scenario, period, what is going on; the numbers of the period and of the episode so far."""
    font, edge, y = plan.font, plan.font // 2 + 1, plan.font // 3
    x = canvas.text(edge, y, scenario.name, font, INK) if canvas.width >= WORDS_FROM else edge - font
    canvas.text(x + font, y, f"period {state.period[row]} of {scenario.periods}", font, DIM)
    right = canvas.width - edge
    nodes, alive = state.network.battery.shape[1], state.network.row["alive"][row]
    if alive < nodes:
        words = f"{alive} of {nodes} alive" if alive else "all dead"
        right -= text_width(words, font)
        canvas.text(right, y, words, font, DIM if alive else VERMILLION)
        right -= font // 2
    if told["searched"]:
        right = _chip(canvas, plan, right, y, "search", YELLOW, INK)
    if told["handover"] and scenario.radio.receiver == "head":
        _chip(canvas, plan, right, y, "handover", PURPLE, INK)
    if canvas.width < WORDS_FROM:
        return
    y += plan.line
    rms = trail.rms_m(state, row)
    error = [("error ", f"{figure(told['error_m'])} m"), ("   rms ", "-" if np.isnan(rms) else f"{figure(rms)} m")]
    energy = [("energy ", joules(told["energy_mj"])), ("   so far ", joules(trail.energy_mj[row]))]
    _write(canvas, edge, y, error, font)
    width = sum(text_width(label + value, font) for label, value in energy)
    _write(canvas, canvas.width - edge - width, y, energy, font)


def _write(canvas, x, y, pairs, font) -> None:
    for label, value in pairs:
        x = canvas.text(canvas.text(x, y, label, font, DIM), y, value, font, INK)


def _chip(canvas, plan, right, y, words, colour, ink) -> int:
    """A word on a coloured ground, ending at `right`; returns where the next may end."""
    pad = plan.font // 3
    left = right - text_width(words, plan.font) - 2 * pad
    canvas.box(left, y - pad // 2, right, y + plan.line - pad // 2, colour)
    canvas.text(left + pad, y, words, plan.font, ink, colour)
    return left - pad


def figure(value: float) -> str:
    """A number with about three digits."""
    return f"{value:.{2 if value < 9.995 else 1 if value < 99.95 else 0}f}"


def joules(energy_mj: float) -> str:
    """An energy in a unit that suits it."""
    return f"{figure(energy_mj / 1000)} J" if energy_mj >= 999.5 else f"{figure(energy_mj)} mJ"


@lru_cache(maxsize=16)
def _plan(size: int, name: str, room_m: tuple[float, float], entries: tuple[tuple[str, str], ...]) -> Plan:
    """The plan of frames of this size."""
    font, unit = max(10, round(size / 40)), size / SIZE
    line = round(1.32 * font)
    edge = round(12 * unit) + 2
    lines = _flowed(entries, font, size - font) if size >= WORDS_FROM else []
    head = (2 if lines else 1) * line + font // 3
    low = size - len(lines) * line - (font // 2 if lines else 0)
    wide, tall = size - 2 * edge, low - head - edge // 2 - line - 2
    scale = min(wide / room_m[0], tall / room_m[1])
    left, top = round((size - scale * room_m[0]) / 2), head + edge // 2 + round((tall - scale * room_m[1]) / 2)
    field = (left, top, left + round(scale * room_m[0]), top + round(scale * room_m[1]))
    paper = np.full((size, size, 3), PAPER, np.uint8)
    plan = Plan(paper, font, line, unit, scale, field)
    canvas = Canvas(paper)
    canvas.box(*_widened(field, 1), FRAME)
    canvas.box(*field, PAPER)
    for number, entries_of_line in enumerate(lines):
        y = low + number * line
        for x, symbol, words in entries_of_line:
            _draw_symbol(canvas, plan, symbol, np.array((x + 0.6 * font, y + 0.62 * font)))
            canvas.text(round(x + 1.5 * font), y, words, font, INK)
    _draw_ruler(canvas, plan, room_m)
    paper.flags.writeable = False
    return plan


def _flowed(entries, font, width) -> list[list[tuple[int, str, str]]]:
    """Entries of a legend by lines, with the x of each."""
    lines, x = [[]], font // 2
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
        _draw_crosses(canvas, centre[None], 3.6 * unit, max(1.0, 1.2 * unit))
    elif symbol == "member":
        canvas.discs(centre, radius, BLUE)
    elif symbol == "head":
        canvas.discs(centre, radius + max(2.0 * unit, 1.0), VERMILLION)
    elif symbol == "sink":
        canvas.discs(centre, 1.3 * radius, VERMILLION, square=True)
    elif symbol == "radius":
        canvas.discs(centre, 0.5 * plan.font, SENSED[1])
    elif symbol == "heard":
        ring = radius + max(2.5 * unit, 1.5)
        canvas.discs(centre, ring, ORANGE, hole=ring - max(2 * unit, 1.2))
    elif symbol == "report":
        canvas.lines(centre - ends, centre + ends, max(1.5, 2.2 * unit), ORANGE)
    elif symbol == "handover":
        _arrow(canvas, centre - ends, centre + ends, max(1.5, 2.5 * unit), max(3.0, 5.0 * unit))
    elif symbol == "cloud":
        points = centre[:, None] + 0.24 * plan.font * np.random.default_rng(0).standard_normal((2, 60))
        canvas.cloud(*points, np.full(60, SEEN), SKY)
    elif symbol == "estimate":
        _draw_estimate(canvas, centre, 0.6 * unit, 0.5 * plan.font * np.array(((1.0, 0.0), (0.0, 0.75))))
    else:
        _draw_target(canvas, centre, unit)


def _draw_ruler(canvas, plan, room_m) -> None:
    """A length on the field's lower edge."""
    wished = room_m[0] / 5
    power = 10.0 ** np.floor(np.log10(wished))
    length = max(step * power for step in (1, 2, 5) if step * power <= wished)
    left, _, _, bottom = plan.field
    end = left + length * plan.scale
    canvas.lines((left, bottom), (end, bottom), max(2.0, 3.0 * plan.unit), DIM)
    canvas.text(round(end) + plan.font // 2, bottom + round(0.12 * plan.font), f"{length:g} m", plan.font, DIM)


def _widened(box, by: int) -> tuple[int, int, int, int]:
    return box[0] - by, box[1] - by, box[2] + by, box[3] + by
