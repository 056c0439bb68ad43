"""Trackers on a fingerprint network: its fixes alone, and a Kalman filter on them."""

from typing import Any

import numpy as np

from wsn_env.filters.base import MemorylessTracker
from wsn_env.filters.fingerprint import trained_network
from wsn_env.filters.kalman import POSITION_ROWS, FilterpyTracker, constant_velocity
from wsn_env.scenario import Scenario


class GRNNTracker(MemorylessTracker):
    """The network's fix of each period's strengths. Any nodes may have reported: it compares only what was heard."""

    def __init__(self, scenario: Scenario, threads: int = 1, fast: bool = False) -> None:
        super().__init__(scenario)
        self._network = trained_network(scenario)

    def locate(self, nodes: np.ndarray, places: np.ndarray, values: np.ndarray) -> Any:
        """The fix, if anybody reported."""
        return self._network.locate(nodes, values[:, 0]) if len(nodes) else None


class GRNNKalmanTracker(FilterpyTracker):
    """filterpy's KalmanFilter with the network's fixes as measurements of the position, and their spread as noise."""

    def __init__(self, scenario: Scenario, threads: int = 1, fast: bool = False) -> None:
        from filterpy.kalman import KalmanFilter

        super().__init__(KalmanFilter(dim_x=4, dim_z=2))
        self._network = trained_network(scenario)
        self._filter.F, self._filter.Q = constant_velocity(scenario)
        self._filter.H = POSITION_ROWS

    def update(self, nodes: np.ndarray, places: np.ndarray, values: np.ndarray) -> None:
        """Correct with the network's fix."""
        fix, cov = self._network.locate(nodes, values[:, 0])
        self._filter.update(fix, R=cov)
