"""Every node that can detect is awake."""

from __future__ import annotations

from dataclasses import dataclass

from wsn_env.agents.base import ViewPolicy
from wsn_env.models.state import Cluster
from wsn_env.simulation.view import View


@dataclass(frozen=True)
class StaticCluster(ViewPolicy):
    """All living nodes that can detect at the prediction; head: the nearest to it."""

    sees_lam = False

    def act(self, view: View) -> Cluster:
        """Wake them, for every row."""
        return Cluster.of(view.nearest_living(), self.detection(view) > 0)
