"""The receivers that heard the beacon best."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wsn_env.agents.base import ViewPolicy
from wsn_env.models.quantity import check_quantity
from wsn_env.models.state import Cluster
from wsn_env.simulation.view import View


@dataclass(frozen=True)
class Strongest(ViewPolicy):
    """The head and n further members: the living nodes whose last level was strongest, however long ago; who has never
    listened comes first. Where nodes do not hear a beacon, the living nodes nearest to the prediction."""

    n: int = 2
    sees_lam = False

    @property
    def fits(self) -> bool:
        """Receivers of a beacon."""
        return self.scenario.measurement.lasting_errors

    def __post_init__(self) -> None:
        check_quantity("Strongest", "n", self.n, at_least=0, whole=True)

    def act(self, view: View) -> Cluster:
        """Choose, for every row."""
        level = view.receivers["latest_db"] if self.scenario.measurement.lasting_errors else -view.distance
        return highest_scoring(level, view, self.n)


def highest_scoring(score: np.ndarray, view: View, n: int) -> Cluster:
    """A cluster of the n + 1 living nodes with the highest score (B, S); the first of them leads."""
    order = np.argsort(np.where(view.alive, -score, np.inf), axis=1, kind="stable")[:, : n + 1]
    nodes = np.where(np.take_along_axis(view.alive, order, axis=1), order, -1)
    return Cluster(nodes[:, 0], nodes.astype(np.int32))
