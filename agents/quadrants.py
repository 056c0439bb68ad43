"""Taking turns, so that the awake nodes lie all round."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wsn_env.agents.base import FEW_NODES, ViewPolicy
from wsn_env.agents.strongest import highest_scoring
from wsn_env.models.quantity import check_quantity
from wsn_env.models.state import Cluster
from wsn_env.simulation.view import View

OPPOSITE_FIRST = (0, 2, 1, 3)


@dataclass(frozen=True)
class Quadrants(ViewPolicy):
    """Round-robin: n + 1 nodes a period, one quadrant of the field after the other, opposite ones first, whatever is
    believed of the target. Blind to it, and yet hard to beat where geometry counts more than strength."""

    n: int = 2
    sees_lam = False

    @property
    def fits(self) -> bool:
        """Where nodes are few."""
        return self.scenario.field.nodes <= FEW_NODES

    def __post_init__(self) -> None:
        check_quantity("Quadrants", "n", self.n, at_least=0, whole=True)

    def act(self, view: View) -> Cluster:
        """Choose, for every row."""
        nodes = view.alive.shape[1]
        turn = _order_of_turns(view.positions, np.array(self.scenario.field.room_m) / 2)
        waited = (turn - view.period[:, None] * (self.n + 1)) % nodes
        return highest_scoring(-waited, view, self.n)


def _order_of_turns(positions: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """(B, S) each node's place in the round: the first of every quadrant, then the second of every quadrant, ..."""
    right, up = positions[:, :, 0] > middle[0], positions[:, :, 1] > middle[1]
    around = np.where(up, np.where(right, 2, 1), np.where(right, 3, 0))  # clockwise from the origin
    quadrant = np.array(OPPOSITE_FIRST)[around]
    within = np.zeros(quadrant.shape, np.int64)
    for q in range(4):
        inside = quadrant == q
        within += np.where(inside, np.cumsum(inside, axis=1) - 1, 0)
    order = np.argsort(4 * within + quadrant, axis=1, kind="stable")
    turn = np.empty_like(order)
    np.put_along_axis(turn, order, np.broadcast_to(np.arange(order.shape[1]), order.shape), axis=1)
    return turn
