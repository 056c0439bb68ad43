"""Trackers on a fingerprint network: its fixes alone, and a Kalman filter on them."""

from typing import Any

import numpy as np

from wsn_env.filters.base import MemorylessTracker, MomentTracker
from wsn_env.filters.fingerprint import trained_network
from wsn_env.filters.kalman import POSITION_ROWS, constant_velocity
from wsn_env.models.state import Belief, Network, Reports
from wsn_env.scenario import Scenario


class GRNNTracker(MemorylessTracker):
    """The network's fix of each period's strengths. Any nodes may have reported: it compares only what was heard."""

    def __init__(self, scenario: Scenario, threads: int = 1, fast: bool = False) -> None:
        super().__init__(scenario)
        self._network = trained_network(scenario)

    def locate(self, nodes: np.ndarray, places: np.ndarray, values: np.ndarray) -> Any:
        """The fix, if anybody reported."""
        return self._network.locate(nodes, values[:, 0]) if len(nodes) else None


class GRNNKalmanTracker(MomentTracker):
    """filterpy's KalmanFilter with the network's fixes as measurements of the position, and their spread as noise."""

    def __init__(self, scenario: Scenario, threads: int = 1, fast: bool = False) -> None:
        from filterpy.kalman import KalmanFilter

        self._network = trained_network(scenario)
        self._filter = KalmanFilter(dim_x=4, dim_z=2)
        self._filter.F, self._filter.Q = constant_velocity(scenario)
        self._filter.H = POSITION_ROWS

    def correct(
        self,
        keys: np.ndarray,
        periods: np.ndarray,
        belief: Belief,
        network: Network,
        reports: Reports,
        resampled: np.ndarray,
    ) -> None:
        """Predict and correct every row, in place."""
        kf = self._filter
        for b in range(len(keys)):
            kf.x, kf.P = belief.mean[b].copy(), belief.cov[b].copy()
            kf.predict()
            n = reports.count[b]
            if n > 0:
                fix, cov = self._network.locate(reports.node[b, :n], reports.value[b, :n, 0])
                kf.update(fix, R=cov)
            belief.mean[b], belief.cov[b] = kf.x, 0.5 * (kf.P + kf.P.T)
