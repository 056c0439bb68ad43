"""The cluster follows the strongest signal (patent CN103152791)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from wsn_env.agents.base import ViewPolicy
from wsn_env.models.quantity import check_quantity
from wsn_env.models.state import Cluster
from wsn_env.simulation.geometry import distances_to
from wsn_env.simulation.view import View


@dataclass(frozen=True)
class StrongestSignal(ViewPolicy):
    """Head: the node that reported the strongest signal in the last period; members: the living nodes within one hop.

    The old head stays unless another node was stronger by `hysteresis_db`; one that kept silent itself gives way to
    any. Without a report the cluster's head stays; with no head yet it is the living node nearest to the prediction.
    No motion model.

    A signal is the level in dB, or the power, that a node reports; where nodes report positions, one that falls with
    the square of the distance to what the node reports.
    """

    hysteresis_db: float = 3.0
    hop_m: float | None = None  # None: the modem's; the sensing radius where the radio has no limit
    sees_lam = False

    def __post_init__(self) -> None:
        check_quantity("StrongestSignal", "hysteresis_db", self.hysteresis_db, at_least=0)
        check_quantity("StrongestSignal", "hop_m", self.hop_m, above=0, optional=True)

    def act(self, view: View) -> Cluster:
        """Follow, for every row."""
        heard = view.detected & view.alive & view.sees  # a state of 0 is no signal
        signal = np.where(heard, self.scenario.measurement.signals(view.measured, view.positions), -np.inf)
        strongest = signal.argmax(axis=1)
        standing = view.head >= 0
        own = np.where(standing, signal[view.rows, np.maximum(view.head, 0)], -np.inf)
        best = signal[view.rows, strongest]
        stay = standing & ((best == -np.inf) | (best < self.scenario.measurement.raised(own, self.hysteresis_db)))
        head = np.where(stay, view.head, np.where(best > -np.inf, strongest, view.nearest_living()))
        centre = view.positions[view.rows, np.maximum(head, 0)]
        members = view.alive & (distances_to(view.positions, centre) <= self._hop_m()) & (head >= 0)[:, None]
        return Cluster.of(head, members)

    def _hop_m(self) -> float:
        if self.hop_m is not None:
            return self.hop_m
        hop_m = self.scenario.radio.hop_m
        return hop_m if math.isfinite(hop_m) else self.scenario.radius_m
