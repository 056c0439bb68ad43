"""One picture of a state: field, batteries, cluster, reports, particles, estimate and truth."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wsn_env.envs.rendering.canvas import Canvas, Colour, text_width
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


class Scene(NamedTuple):
    """What a frame shows of a target."""

    state: State  # after the period
    scenario: Scenario
    trail: Trail  # of the periods up to this one
    row: int  # of the batch
    nodes: np.ndarray  # (S, 2) px, where they stand on the frame

    @property
    def view(self) -> View:
        """What the network knows."""
        return View(self.state.only(self.row).knowledge)

    @property
    def last(self) -> np.void:
        """OUTCOME: what the period brought."""
        return self.trail.last.row[self.row]

    @property
    def hands_over(self) -> bool:
        """Whether the head's role went to another node, which counts where heads receive."""
        return bool(self.last["handover"]) and self.scenario.radio.receiver == "head"

    @property
    def head(self) -> int:
        """The standing head, -1: none."""
        return self.state.network.head[self.row]

    @property
    def periods(self) -> int:
        """How many are done, up to the horizon."""
        return min(self.state.period[self.row], self.scenario.periods)


def frame(state: State, scenario: Scenario, trail: Trail, row: int = 0, size: int = SIZE) -> np.ndarray:
    """A frame (size, size, 3) uint8 of a row, or of the field of several targets that begins with it. Nothing but the
    arguments decides a pixel, and none is changed.

    Args:
        state: after the period.
        scenario: for the field, the sensing radius, who receives.
        trail: of the periods up to this one, for tails, handovers and numbers.
        row: of the batch.
        size: of a side, in pixels.
    """
    plan = plan_of(size, scenario.name, scenario.field.room_m, legend(scenario))
    canvas = Canvas(plan.paper.copy())
    nodes = plan.pixels(state.network.positions[row])
    scenes = [Scene(state, scenario, trail, k, nodes) for k in range(row, row + scenario.targets)]
    _write_head(canvas, plan, scenes)
    if any(scene.last["searched"] for scene in scenes):
        _flash(canvas, plan)
    awake = np.flatnonzero(np.any([scene.view.member[0] for scene in scenes], axis=0))
    if len(awake) and shows_radius(scenario):
        canvas.clip = plan.field
        canvas.shade(nodes[awake], scenario.radius_m * plan.scale, SENSED)
    canvas.clip = widened(plan.field, round(9 * plan.unit) + 1)
    _draw_nodes(canvas, plan, scenes[0])
    for draw in (_draw_cloud, _draw_cluster, _draw_handover, _draw_tracks):
        for scene in scenes:
            draw(canvas, plan, scene)
    return canvas.image


# --- the parts of a frame ---------------------------------------------------------------------------------------


def _flash(canvas: Canvas, plan: Plan) -> None:
    canvas.box(*widened(plan.field, plan.flash), YELLOW)
    canvas.box(*plan.field, FLASH)


def _draw_nodes(canvas: Canvas, plan: Plan, scene: Scene) -> None:
    """Their inside is the paler the less energy they have left; the dead are crossed out."""
    positions, battery_j = scene.nodes, scene.state.residual_j[scene.row]
    share = np.clip(battery_j / scene.state.full_j[scene.row], 0.0, 1.0)
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


def _draw_cloud(canvas: Canvas, plan: Plan, scene: Scene) -> None:
    belief = scene.state.belief
    x, _, y, _ = belief.particles[scene.row]
    if len(x):
        weights = np.exp(belief.log_weights[scene.row])
        left, _, _, bottom = plan.field
        weights *= SEEN * len(x) / max(weights.sum(), 1e-30)
        canvas.cloud(left + x * plan.scale, bottom - y * plan.scale, weights, SKY)


def _draw_cluster(canvas: Canvas, plan: Plan, scene: Scene) -> None:
    """Reports as lines to who receives them; rings about those that see; the awake, the head, the sink."""
    awake, sees = np.flatnonzero(scene.view.member[0]), np.flatnonzero(scene.view.sees[0])
    unit, receiver = plan.unit, scene.scenario.radio.receiver
    head, positions, reports = scene.head, scene.nodes, scene.state.reports
    reported = reports.node[scene.row, : reports.count[scene.row]]
    centre = None
    if receiver == "sink":
        centre = plan.pixels(np.array(scene.scenario.field.room_m) / 2)
    elif receiver == "target":
        centre = plan.pixels(scene.state.track[scene.row, scene.periods, ::2])
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


def _draw_handover(canvas: Canvas, plan: Plan, scene: Scene) -> None:
    """An arrow from the last head to the present one."""
    if not scene.hands_over:
        return
    heads, last = scene.trail.head[scene.row], scene.periods
    old, new = heads[last - 1], heads[last]
    if old >= 0 and new >= 0:
        ends = scene.nodes[old], scene.nodes[new]
        draw_arrow(canvas, *ends, max(2.0, 3.0 * plan.unit), max(6.0, 10.0 * plan.unit))


def _draw_tracks(canvas: Canvas, plan: Plan, scene: Scene) -> None:
    """Where the target was and is; where the head believed it to be and does, with the ellipse of 95 %."""
    unit, row, last, belief = plan.unit, scene.row, scene.periods, scene.state.belief
    fading = np.linspace(FADED, 1.0, max(last, 1))
    target = plan.pixels(scene.state.track[row, : last + 1, ::2])
    canvas.lines(target[:-1], target[1:], max(1.2, 2.4 * unit), GREEN, fading)
    believed = plan.pixels(scene.trail.estimate_m[row, : last + 1])
    canvas.lines(believed[:-1], believed[1:], max(1.0, 1.2 * unit), INK, fading)
    draw_target(canvas, target[-1], unit)
    draw_estimate(canvas, plan.pixels(belief.mean[row, ::2]), unit, plan.scale * _root(belief.cov[row, ::2, ::2]))


def _root(cov) -> np.ndarray:
    """What takes the unit circle to the ellipse of 95 %, y downward."""
    a = max(cov[0, 0], 0.0) ** 0.5
    b = cov[0, 1] / a if a > 0 else 0.0
    c = max(cov[1, 1] - b * b, 0.0) ** 0.5
    return ELLIPSE * np.array(((a, 0.0), (-b, -c)))


# --- words --------------------------------------------------------------------------------------------------------


def _write_head(canvas: Canvas, plan: Plan, scenes: list[Scene]) -> None:
    """Above the field: scenario, period, what is going on; the numbers of the period and of the episode so far: of
    several targets the mean error and the sum of the energies."""
    state, scenario, trail, row, _ = scenes[0]
    font, edge, y = plan.font, _edge(plan), plan.font // 3
    x = canvas.text(edge, y, scenario.name, font, INK) + font if canvas.width >= WORDS_FROM else edge
    words = f"step {state.period[row]} of {scenario.periods}"
    if x + text_width(words, font) > canvas.width - edge:
        words = f"{state.period[row]}/{scenario.periods}"
    taken = canvas.text(x, y, words, font, DIM)
    _write_chips(canvas, plan, _chips(scenes), taken, y)
    if canvas.width < WORDS_FROM:
        return
    y += plan.line
    rows = slice(row, row + len(scenes))
    rms = float(np.sqrt(np.mean([trail.rms_m(state, each.row) ** 2 for each in scenes])))
    error_m, energy_mj = trail.last.error_m[rows].mean(), trail.last.energy_mj[rows].sum()
    error = [("error ", f"{figure(error_m)} m"), ("   rms ", "-" if np.isnan(rms) else f"{figure(rms)} m")]
    energy = [("energy ", joules(energy_mj)), ("   so far ", joules(trail.energy_mj[rows].sum()))]
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


def _edge(plan: Plan) -> int:
    """px that words keep from the sides."""
    return plan.font // 2 + 1


def _chips(scenes: list[Scene]) -> list[tuple[str, Colour, Colour]]:
    """What is going on, each with its ground and ink."""
    scene = scenes[0]
    nodes, alive = len(scene.nodes), scene.state.network.row["alive"][scene.row]
    chips = []
    if alive < nodes:
        chips.append((f"{alive} of {nodes} alive", PAPER, DIM) if alive else ("all dead", PAPER, VERMILION))
    if any(each.last["searched"] for each in scenes):
        chips.append(("search", YELLOW, INK))
    if any(each.hands_over for each in scenes):
        chips.append(("handover", PURPLE, INK))
    return chips


def _write_chips(canvas: Canvas, plan: Plan, chips: list[tuple[str, Colour, Colour]], taken: int, y: int) -> None:
    """Words on coloured grounds from the right edge to what is taken of the line, those that fit."""
    right, pad = canvas.width - _edge(plan), plan.font // 3
    for words, ground, ink in chips:
        left = right - text_width(words, plan.font) - 2 * pad
        if left >= taken + pad:
            canvas.box(left, y - pad // 2, right, y + plan.line - pad // 2, ground)
            canvas.text(left + pad, y, words, plan.font, ink, ground)
            right = left - pad


def figure(value: float) -> str:
    """A number with three digits, whole ones in full."""
    return f"{value:.0f}" if value >= 99.95 else f"{value:#.3g}" if value >= 1e-3 else f"{value:.2g}"


def joules(energy_mj: float) -> str:
    """An energy in a unit that suits it."""
    return f"{figure(energy_mj / 1000)} J" if energy_mj >= 999.5 else f"{figure(energy_mj)} mJ"
