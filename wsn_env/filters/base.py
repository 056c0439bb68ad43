"""What trackers without particles share."""

from typing import Any

import numpy as np

from wsn_env.models.state import Belief, Network, Reports
from wsn_env.scenario import Scenario


class MomentTracker:
    """Base of the trackers whose whole belief is a mean and a covariance: final classes add `correct`."""

    particles = 0

    def start(self, keys: np.ndarray, periods: np.ndarray, rows: np.ndarray, belief: Belief) -> None:
        """Nothing to spread."""

    def relocate(self, keys: np.ndarray, periods: np.ndarray, rows: np.ndarray, belief: Belief) -> None:
        """Nothing to move but what a search has set."""


class MemorylessTracker(MomentTracker):
    """Base of the trackers that take each period's reports alone: final classes add `locate`.

    Where these do not suffice, the last estimate stays, and its variance grows by (rest_sd_ms T)^2.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._growth = (scenario.tracking.rest_sd_ms * scenario.period_s) ** 2

    def locate(self, nodes: np.ndarray, places: np.ndarray, values: np.ndarray) -> Any:
        """Where the target is.

        Args:
            nodes: (n,) who reported.
            places: (n, 2) where they stand [m].
            values: (n, 2) what they measured.

        Returns: the point (2,) [m] and its covariance (2, 2) [m^2]; None: the reports do not suffice.
        """
        raise NotImplementedError

    def correct(
        self,
        keys: np.ndarray,
        periods: np.ndarray,
        belief: Belief,
        network: Network,
        reports: Reports,
        resampled: np.ndarray,
    ) -> None:
        """Replace the estimate by the period's, in place."""
        for b in range(len(keys)):
            nodes, values = reports.node[b, : reports.count[b]], reports.value[b, : reports.count[b]]
            found = self.locate(nodes, network.positions[b, nodes], values)
            belief.mean[b, [1, 3]] = 0.0
            if found is None:
                belief.cov[b, [0, 2], [0, 2]] += self._growth
            else:
                belief.mean[b, [0, 2]], belief.cov[b] = found[0], 0.0
                belief.cov[b, ::2, ::2] = found[1]
