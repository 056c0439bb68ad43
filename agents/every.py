"""All together, now and then."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wsn_env.agents.base import FEW_NODES, ViewPolicy
from wsn_env.models.quantity import check_quantity
from wsn_env.models.state import NOBODY, Cluster
from wsn_env.simulation.view import View


@dataclass(frozen=True)
class Every(ViewPolicy):
    """All living nodes in every n-th period, nobody in between; where a head must keep the belief it stays awake."""

    n: int = 4
    sees_lam = False

    @property
    def fits(self) -> bool:
        """Where nodes are few."""
        return self.scenario.field.nodes <= FEW_NODES

    def __post_init__(self) -> None:
        check_quantity("Every", "n", self.n, at_least=1, whole=True)

    def act(self, view: View) -> Cluster:
        """Wake everybody or nobody, for every row."""
        now = view.period % self.n == 0
        between = np.where(view.head >= 0, view.head, view.nearest_living())
        kept = between if self.scenario.radio.receiver == "head" else NOBODY
        return Cluster.of(np.where(now, view.nearest_living(), kept), view.alive & now[:, None])
