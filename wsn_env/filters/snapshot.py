"""The memoryless estimate of the paper's static-cluster system: the plain mean of a period's measurements."""

from typing import Any

import numpy as np

from wsn_env.filters.base import MemorylessTracker
from wsn_env.scenario import Scenario


class SnapshotTracker(MemorylessTracker):
    """Mean of the reported positions; of the reporting nodes' own positions where only a strength is measured."""

    def __init__(self, scenario: Scenario, threads: int = 1, fast: bool = False) -> None:
        super().__init__(scenario)
        self._measurement, self._radius_m = scenario.measurement, scenario.radius_m

    def locate(self, nodes: np.ndarray, places: np.ndarray, values: np.ndarray) -> Any:
        """The mean, if anybody reported."""
        n = len(nodes)
        points, variance = self._measurement.fixes(values, places, self._radius_m)
        return (points.sum(axis=0) / n, variance / n * np.eye(2)) if n else None
