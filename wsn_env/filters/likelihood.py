"""What it tells that of the awake nodes just some reported, particle by particle."""

from typing import Any

import numpy as np

from wsn_env.compiled.kernels import lean_piece
from wsn_env.models.detection.base import weigh_detection, weigh_silence
from wsn_env.models.measurement.base import node_at


@lean_piece
def weigh_awake(x: np.ndarray, log_weights: np.ndarray, network: Any, nodes: np.ndarray, b: int, c: Any) -> None:
    """Add what it tells that of the awake nodes of row b just `nodes` (m,) reported, beside what they measured.

    A report is heard with probability `delivery`, the head's with `head_delivery`. A node without energy tells nothing.
    Adds log probabilities, at most 0 each, to the log weights of the particles x (4, P), in float32.
    """
    positions, battery, standing = network.positions[b], network.battery[b], network.row[b]
    if standing.head < 0 or (c.radio.to_head and battery[standing.head] <= 0.0):  # nobody could be heard
        return
    for k in range(-1, standing.n_members):
        node = standing.head if k < 0 else network.members[b, k]
        reported = False
        for other in nodes:
            reported |= other == node
        delivery = c.radio.head_delivery if k < 0 else c.radio.delivery
        place = node_at(positions, node)
        if reported:
            weigh_detection(c.detection, c.measurement, x, log_weights, place)
        elif battery[node] > 0.0:
            weigh_silence(c.detection, c.measurement, x, log_weights, place, delivery)
