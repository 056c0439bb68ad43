"""A random cluster near the prediction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wsn_env.agents.base import ViewPolicy
from wsn_env.agents.strongest import highest_scoring
from wsn_env.compiled.draws import uniforms
from wsn_env.models.quantity import check_quantity
from wsn_env.models.state import Cluster
from wsn_env.simulation.view import View


@dataclass(frozen=True)
class Random(ViewPolicy):
    """Among the living nodes that can detect at the prediction, each is a member with probability one half and any may
    be the head; the nearest living node leads where none can. With `n`: any head and n further members, wherever they
    stand. Draws on the view's `random_bits`, so it is repeatable."""

    n: int | None = None
    sees_lam = False

    def __post_init__(self) -> None:
        check_quantity("Random", "n", self.n, at_least=0, whole=True, optional=True)

    def act(self, view: View) -> Cluster:
        """Throw the dice, for every row."""
        if self.n is not None:
            return highest_scoring(uniforms(view.random_bits, view.alive.shape[1]), view, self.n)
        able = self.detection(view) > 0
        nodes = able.shape[1]
        u = uniforms(view.random_bits, 2 * nodes)
        head = np.where(able, u[:, :nodes], -1.0).argmax(axis=1)
        head = np.where(able.any(axis=1), head, view.nearest_living())
        return Cluster.of(head, able & (u[:, nodes:] < 0.5))
