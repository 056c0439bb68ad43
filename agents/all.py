"""Everybody awake, always."""

from __future__ import annotations

from dataclasses import dataclass

from wsn_env.agents.base import FEW_NODES, ViewPolicy
from wsn_env.models.state import Cluster
from wsn_env.simulation.view import View


@dataclass(frozen=True)
class All(ViewPolicy):
    """All living nodes; head: the nearest to the prediction."""

    sees_lam = False

    @property
    def fits(self) -> bool:
        """Where nodes are few."""
        return self.scenario.field.nodes <= FEW_NODES

    def act(self, view: View) -> Cluster:
        """Wake everybody, for every row."""
        return Cluster.of(view.nearest_living(), view.alive)
