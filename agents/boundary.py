"""The cluster is a ring: the nodes whose state is about to change."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wsn_env.agents.base import ViewPolicy
from wsn_env.models.quantity import check_quantity
from wsn_env.models.state import Cluster
from wsn_env.simulation.view import View


@dataclass(frozen=True)
class Boundary(ViewPolicy):
    """Members: the living nodes whose distance to the prediction is the sensing radius, give or take a band; head: the
    nearest of them to the prediction, or the nearest living node where there is none.

    A binary sensor tells most when the target crosses the edge of its disc. The band is `width_m`, half of the way
    that the target is expected to go in a period, and `sds` sds of the predicted position.
    """

    width_m: float = 5.0
    sds: float = 1.0
    sees_lam = False

    @property
    def fits(self) -> bool:
        """Binary sensors."""
        return self.scenario.measurement.reports_state

    def __post_init__(self) -> None:
        check_quantity("Boundary", "width_m", self.width_m, at_least=0)
        check_quantity("Boundary", "sds", self.sds, at_least=0)

    def act(self, view: View) -> Cluster:
        """Wake the ring, for every row."""
        travel = self.scenario.period_s * np.sqrt(view.predicted_mean[:, 1] ** 2 + view.predicted_mean[:, 3] ** 2)
        band = self.width_m + 0.5 * travel + self.sds * view.spread_m
        offset = abs(view.distance - self.scenario.radius_m)
        ring = view.alive & (offset <= band[:, None])
        nearest = np.where(ring, view.distance, np.inf).argmin(axis=1)
        return Cluster.of(np.where(ring.any(axis=1), nearest, view.nearest_living()), ring)
