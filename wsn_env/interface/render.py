"""One picture of a state: field, batteries, cluster, particles, estimate and truth."""

from __future__ import annotations

import numpy as np

from wsn_env.scenario import Scenario
from wsn_env.types import State

# Okabe and Ito's palette: told apart by colour-blind eyes too.
PAPER, INK, GREY = (255, 255, 255), (40, 40, 40), (190, 190, 190)
MEMBER, HEAD, CLOUD, ESTIMATE, TRUTH, REPORT = (
    (0, 114, 178),
    (213, 94, 0),
    (86, 180, 233),
    (0, 0, 0),
    (0, 158, 115),
    (230, 159, 0),
)
SIZE, MARGIN, SHOWN = 600, 24, 1000  # pixels; particles drawn at most


def check_render_mode(render_mode: str | None, metadata: dict) -> None:
    """Raise ValueError unless the mode is one of the metadata's."""
    if render_mode is not None and render_mode not in metadata["render_modes"]:
        raise ValueError(f"render_mode = {render_mode!r}: allowed are None, {', '.join(metadata['render_modes'])}")


def frame(state: State, scenario: Scenario, row: int = 0) -> np.ndarray:
    """A frame (SIZE, SIZE, 3) uint8 of a row.

    Args:
        state: only read.
        scenario: for the side of the field and the sensing radius.
    """
    from PIL import Image, ImageDraw

    scale = (SIZE - 2 * MARGIN) / max(scenario.field.room_m)
    network, belief = state.network, state.belief

    def pixel(x, y):
        return MARGIN + x * scale, SIZE - MARGIN - y * scale

    image = Image.new("RGB", (SIZE, SIZE), PAPER)
    draw = ImageDraw.Draw(image)

    def disc(x, y, radius, **paint):
        px, py = pixel(x, y)
        draw.ellipse((px - radius, py - radius, px + radius, py + radius), **paint)

    draw.rectangle((MARGIN, MARGIN, SIZE - MARGIN, SIZE - MARGIN), outline=GREY)
    particles = belief.particles[row]
    for i in range(0, particles.shape[1], max(1, particles.shape[1] // SHOWN)):
        disc(particles[0, i], particles[2, i], 1, fill=CLOUD)
    for (x, y), battery in zip(network.positions[row], network.battery[row]):
        disc(x, y, 2, fill=GREY if battery > 0 else PAPER, outline=GREY)
    past = state.track[row, : state.period[row] + 1]
    if len(past) > 1:
        draw.line([pixel(x, y) for x, y in past[:, ::2]], fill=TRUTH, width=2)

    head, target = network.head[row], state.track[row, min(state.period[row], scenario.periods), ::2]
    middle = tuple(extent / 2 for extent in scenario.field.room_m)
    receivers = {"head": network.positions[row, head], "sink": middle, "target": target}
    if head >= 0:
        receiver = receivers[scenario.radio.receiver]
        for node in state.reports.node[row, : state.reports.count[row]]:
            draw.line((*pixel(*network.positions[row, node]), *pixel(*receiver)), fill=REPORT, width=2)
        for node in (head, *network.members[row, : network.n_members[row]]):
            disc(*network.positions[row, node], 5, fill=MEMBER)
        if scenario.radio.receiver == "head":
            disc(*receiver, scenario.radius_m * scale, outline=HEAD)
        if scenario.radio.receiver != "target":
            disc(*receiver, 7, fill=HEAD)
    if scenario.binary:
        disc(*belief.mean[row, ::2], scenario.ring_m * scale, outline=MEMBER)
    _cross(draw, *pixel(*belief.mean[row, ::2]), ESTIMATE)
    disc(*target, 5, outline=TRUTH, width=3)
    receiving = {"head": "head", "sink": "sink", "target": ""}[scenario.radio.receiver]
    legend = (
        (receiving, HEAD if receiving else PAPER),
        ("member", MEMBER),
        ("report", REPORT),
        ("particles", CLOUD),
        ("estimate", ESTIMATE),
        ("target", TRUTH),
    )
    for k, (word, colour) in enumerate(legend):
        x = MARGIN + 94 * k
        draw.rectangle((x, SIZE - 17, x + 9, SIZE - 8), fill=colour)
        draw.text((x + 14, SIZE - 19), word, fill=INK)
    draw.text((MARGIN, 6), f"{scenario.name}   period {state.period[row]} of {scenario.periods}", fill=INK)
    return np.asarray(image)


def _cross(draw, x, y, colour):
    draw.line((x - 7, y, x + 7, y), fill=colour, width=2)
    draw.line((x, y - 7, x, y + 7), fill=colour, width=2)
