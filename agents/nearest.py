"""A cluster of fixed size about the prediction."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from agents.base import ViewPolicy
from wsn_env.types import Cluster
from wsn_env.view import View


@dataclass(frozen=True)
class Nearest(ViewPolicy):
    """The head and its n nearest further members: the living nodes nearest to the prediction.

    The head stays while the prediction is within `hysteresis_m` of it; then the node nearest to the prediction leads.
    """

    n: int = 3
    hysteresis_m: float = 8.0

    def act(self, view: View) -> Cluster:
        """Choose by distance, for every row."""
        nodes = view.nearest(self.n + 1)[0]
        standing = view.head >= 0
        distance = np.where(standing, view.distance[view.rows, np.maximum(view.head, 0)], np.inf)
        head = np.where(standing & (distance <= self.hysteresis_m), view.head, nodes[:, 0])
        others = nodes != head[:, None]
        members = np.where(others & (np.cumsum(others, axis=1) <= self.n), nodes, -1)
        return Cluster(head, members.astype(np.int32))


nearest0, nearest1, nearest2, nearest3, nearest4, nearest5, nearest6, nearest7, nearest8 = (
    partial(Nearest, n=n) for n in range(9)
)
