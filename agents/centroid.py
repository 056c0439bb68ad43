"""The cluster follows the centroid of the nodes that detect."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wsn_env.agents.base import ViewPolicy
from wsn_env.models.state import Cluster
from wsn_env.simulation.geometry import distances_to
from wsn_env.simulation.view import View


@dataclass(frozen=True)
class Centroid(ViewPolicy):
    """Head: the living node nearest to the centroid of the nodes that detected last; members: the living nodes within
    the sensing radius of it. No motion model.

    Without a detection the cluster stays; with no cluster yet, the estimate stands for the centroid.
    """

    sees_lam = False

    def act(self, view: View) -> Cluster:
        """Follow, for every row."""
        count = view.sees.sum(axis=1)
        centre = view.mean[:, ::2].copy()
        for axis in (0, 1):
            total = np.cumsum(np.where(view.sees, view.positions[:, :, axis], 0.0), axis=1)[:, -1]
            centre[:, axis] = np.where(count > 0, total / np.maximum(count, 1), centre[:, axis])
        distance = np.where(view.alive, distances_to(view.positions, centre), np.inf)
        stay = (count == 0) & (view.head >= 0)
        head = np.where(stay, view.head, distance.argmin(axis=1))
        members = np.where(stay[:, None], view.member, distance <= self.scenario.radius_m)
        return Cluster.of(head, members)
