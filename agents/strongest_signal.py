"""The cluster follows the strongest signal (patent CN103152791)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from agents.base import ViewPolicy
from wsn_env.physics.field import distances_to
from wsn_env.sections import Level
from wsn_env.types import Cluster
from wsn_env.view import View


@dataclass(frozen=True)
class StrongestSignal(ViewPolicy):
    """Head: the node that reported the strongest signal in the last period; members: the living nodes within one hop.

    The old head stays unless another node was stronger by `hysteresis_db`; one that kept silent itself gives way to
    any. Without a report the cluster's head stays; with no head yet it is the living node nearest to the prediction.
    No motion model.
    """

    hysteresis_db: float = 3.0
    hop_m: float | None = None  # None: the modem's; the sensing radius where the radio has no limit

    def __post_init__(self):
        measurement = self.scenario.measurement
        if not isinstance(measurement, Level):
            raise ValueError(
                "policy strongest_signal needs a measured level in dB: Scenario.measurement must be a Rssi or Sonar, it"
                f" is a {type(measurement).__name__}"
            )

    def act(self, view: View) -> Cluster:
        """Follow, for every row."""
        level = np.where(view.detected & view.alive, view.measured[:, :, 0], -np.inf)
        strongest = level.argmax(axis=1)
        standing = view.head >= 0
        own = np.where(standing, level[view.rows, np.maximum(view.head, 0)], -np.inf)
        best = level[view.rows, strongest]
        stay = standing & ((best == -np.inf) | (best < own + self.hysteresis_db))
        head = np.where(stay, view.head, np.where(best > -np.inf, strongest, view.nearest_living()))
        centre = view.positions[view.rows, np.maximum(head, 0)]
        members = view.alive & (distances_to(view.positions, centre) <= self._hop_m()) & (head >= 0)[:, None]
        return Cluster.of(head, members)

    def _hop_m(self) -> float:
        if self.hop_m is not None:
            return self.hop_m
        hop_m = self.scenario.radio.hop_m
        return hop_m if math.isfinite(hop_m) else self.scenario.radius_m
