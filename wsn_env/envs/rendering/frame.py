"""One picture of a state: field, batteries, cluster, reports, particles, estimate and truth."""

from __future__ import annotations

import numpy as np

from wsn_env.envs.rendering.canvas import Canvas, text_width
from wsn_env.envs.rendering.marks import draw_arrow, draw_crosses, draw_estimate, draw_target
from wsn_env.envs.rendering.palette import (
    BLUE,
    DIM,
    EMPTY,
    FLASH,
    FULL,
    GREEN,
    INK,
    ORANGE,
    PAPER,
    PURPLE,
    SENSED,
    SKY,
    VERMILION,
    YELLOW,
)
from wsn_env.envs.rendering.plan import SEEN, SIZE, WORDS_FROM, Plan, legend, plan_of, shows_radius, widened
from wsn_env.envs.rendering.trail import Trail
from wsn_env.models.state import State
from wsn_env.scenario import Scenario
from wsn_env.simulation.view import View

ELLIPSE = 5.991**0.5  # of a Gaussian in two dimensions 95 % lie within so many sds
FADED = 0.2  # the opacity of a tail's beginning


def frame(state: State, scenario: Scenario, trail: Trail, row: int = 0, size: int = SIZE) -> np.ndarray:
    """A frame (size, size, 3) uint8 of a row. Nothing but the arguments decides a pixel, and none is changed.

    Args:
        state: after the period.
        scenario: for the field, the sensing radius, who receives.
        trail: of the periods up to this one, for tails, handovers and numbers.
        row: of the batch.
        size: of a side, in pixels.
    """
    plan = plan_of(size, scenario.name, scenario.field.room_m, legend(scenario))
    canvas = Canvas(plan.paper.copy())
    told = trail.last.row[row]
    _write_head(canvas, plan, state, scenario, row, told, trail)
    if told["searched"]:
        _flash(canvas, plan)
    view = View.of(state.only(row))
    awake, sees = np.flatnonzero(view.member[0]), np.flatnonzero(view.sees[0])
    positions = plan.pixels(state.network.positions[row])
    if len(awake) and shows_radius(scenario):
        canvas.clip = plan.field
        canvas.shade(positions[awake], scenario.radius_m * plan.scale, SENSED)
    canvas.clip = widened(plan.field, round(9 * plan.unit) + 1)
    _draw_nodes(canvas, plan, state, scenario, row, positions)
    _draw_cloud(canvas, plan, state, row)
    _draw_cluster(canvas, plan, state, scenario, row, positions, awake, sees)
    if told["handover"] and scenario.radio.receiver == "head":
        _draw_handover(canvas, plan, positions, trail.head[row], state.period[row])
    _draw_tracks(canvas, plan, state, scenario, row, trail)
    return canvas.image


# --- the parts of a frame ---------------------------------------------------------------------------------------


def _flash(canvas: Canvas, plan: Plan) -> None:
    canvas.box(*widened(plan.field, plan.flash), YELLOW)
    canvas.box(*plan.field, FLASH)


def _draw_nodes(canvas, plan, state, scenario, row, positions) -> None:
    """Their inside is the paler the less energy they have left; the dead are crossed out."""
    share = np.clip(state.network.battery[row] / scenario.radio.battery_j, 0.0, 1.0)
    alive, radius = share > 0, _node_radius(plan, len(positions))
    canvas.discs(positions[alive], radius, FULL)
    if (share[alive] < 0.98).any() and radius > 1.5:
        inside = np.array(EMPTY) + share[alive, None] * np.subtract(FULL, EMPTY)
        canvas.discs(positions[alive], radius - max(0.9, 0.3 * radius), inside)
    draw_crosses(canvas, positions[~alive], 0.8 * radius, max(1.0, 1.2 * plan.unit))


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


def _draw_cluster(canvas, plan, state, scenario, row, positions, awake, sees) -> None:
    """Reports as lines to who receives them; rings about those that see; the awake, the head, the sink."""
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
    ring = radius + max(3.5 * unit, 1.8)
    canvas.discs(positions[sees[sees != head]] if leads else positions[sees], ring, ORANGE, hole=ring - 2 * unit)
    canvas.discs(positions[awake], radius, BLUE)
    if leads:
        wide = radius + max(2.5 * unit, 1.2)
        if head in sees:
            ring = wide + max(3.5 * unit, 1.8)
            canvas.discs(centre, ring, ORANGE, hole=ring - 2 * unit)
        canvas.discs(centre, wide + max(unit, 0.7), PAPER)
        canvas.discs(centre, wide, VERMILION)
    elif receiver == "sink":
        canvas.discs(centre, 1.3 * radius + max(unit, 0.7), PAPER, square=True)
        canvas.discs(centre, 1.3 * radius, VERMILION, square=True)


def _draw_handover(canvas, plan, positions, heads, period) -> None:
    """An arrow from the last head to the present one."""
    period = min(period, len(heads) - 1)
    old, new = heads[period - 1], heads[period]
    if old >= 0 and new >= 0:
        draw_arrow(canvas, positions[old], positions[new], max(2.0, 3.0 * plan.unit), max(6.0, 10.0 * plan.unit))


def _draw_tracks(canvas, plan, state, scenario, row, trail) -> None:
    """Where the target was and is; where the head believed it to be and does, with the ellipse of 95 %."""
    unit, belief = plan.unit, state.belief
    last = min(state.period[row], scenario.periods)
    fading = np.linspace(FADED, 1.0, max(last, 1))
    target = plan.pixels(state.track[row, : last + 1, ::2])
    canvas.lines(target[:-1], target[1:], max(1.2, 2.4 * unit), GREEN, fading)
    believed = plan.pixels(trail.estimate_m[row, : last + 1])
    canvas.lines(believed[:-1], believed[1:], max(1.0, 1.2 * unit), INK, fading)
    draw_target(canvas, target[-1], unit)
    draw_estimate(canvas, plan.pixels(belief.mean[row, ::2]), unit, plan.scale * _root(belief.cov[row, ::2, ::2]))


def _target(state, scenario, row) -> np.ndarray:
    return state.track[row, min(state.period[row], scenario.periods), ::2]


def _root(cov) -> np.ndarray:
    """What takes the unit circle to the ellipse of 95 %, y downward."""
    a = max(cov[0, 0], 0.0) ** 0.5
    b = cov[0, 1] / a if a > 0 else 0.0
    c = max(cov[1, 1] - b * b, 0.0) ** 0.5
    return ELLIPSE * np.array(((a, 0.0), (-b, -c)))


# --- words --------------------------------------------------------------------------------------------------------


def _write_head(canvas, plan, state, scenario, row, told, trail) -> None:
    """Above the field: scenario, period, what is going on; the numbers of the period and of the episode so far."""
    font, edge, y = plan.font, plan.font // 2 + 1, plan.font // 3
    x = canvas.text(edge, y, scenario.name, font, INK) + font if canvas.width >= WORDS_FROM else edge
    right = canvas.width - edge
    words = f"period {state.period[row]} of {scenario.periods}"
    if x + text_width(words, font) > right:
        words = f"{state.period[row]}/{scenario.periods}"
    taken = canvas.text(x, y, words, font, DIM)
    nodes, alive = state.network.battery.shape[1], state.network.row["alive"][row]
    if alive < nodes:
        words = f"{alive} of {nodes} alive" if alive else "all dead"
        right = _chip(canvas, plan, taken, right, y, words, PAPER, DIM if alive else VERMILION)
    if told["searched"]:
        right = _chip(canvas, plan, taken, right, y, "search", YELLOW, INK)
    if told["handover"] and scenario.radio.receiver == "head":
        _chip(canvas, plan, taken, right, y, "handover", PURPLE, INK)
    if canvas.width < WORDS_FROM:
        return
    y += plan.line
    rms = trail.rms_m(state, row)
    error = [("error ", f"{figure(told['error_m'])} m"), ("   rms ", "-" if np.isnan(rms) else f"{figure(rms)} m")]
    energy = [("energy ", joules(told["energy_mj"])), ("   so far ", joules(trail.energy_mj[row]))]
    taken = _write(canvas, edge, y, error, font)
    for pairs in (energy, energy[:1]):
        left = canvas.width - edge - sum(text_width(label + value, font) for label, value in pairs)
        if left > taken + font // 2:
            _write(canvas, left, y, pairs, font)
            break


def _write(canvas, x, y, pairs, font) -> int:
    """Returns where they end."""
    for label, value in pairs:
        x = canvas.text(canvas.text(x, y, label, font, DIM), y, value, font, INK)
    return x


def _chip(canvas, plan, taken, right, y, words, colour, ink) -> int:
    """A word on a coloured ground between `taken` and `right`, if it fits; returns where the next may end."""
    pad = plan.font // 3
    left = right - text_width(words, plan.font) - 2 * pad
    if left < taken + pad:
        return right
    canvas.box(left, y - pad // 2, right, y + plan.line - pad // 2, colour)
    canvas.text(left + pad, y, words, plan.font, ink, colour)
    return left - pad


def figure(value: float) -> str:
    """A number with three digits, whole ones in full."""
    return f"{value:.0f}" if value >= 99.95 else f"{value:#.3g}" if value >= 1e-3 else f"{value:.2g}"


def joules(energy_mj: float) -> str:
    """An energy in a unit that suits it."""
    return f"{figure(energy_mj / 1000)} J" if energy_mj >= 999.5 else f"{figure(energy_mj)} mJ"
