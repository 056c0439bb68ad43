"""The memoryless estimate of the paper's static-cluster system: the plain mean of a period's measurements."""

import numpy as np

from wsn_env.filters.base import MemorylessTracker
from wsn_env.models.sections import Position
from wsn_env.scenario import Scenario


class SnapshotTracker(MemorylessTracker):
    """Mean of the reported positions; of the reporting nodes' own positions where only a strength is measured."""

    def __init__(self, scenario: Scenario, threads: int = 1, fast: bool = False):
        super().__init__(scenario)
        m = scenario.measurement
        self._positions_reported = isinstance(m, Position)
        self._variance = m.noise_m**2 if self._positions_reported else scenario.radius_m**2 / 2

    def locate(self, nodes, places, values):
        """The mean, if anybody reported."""
        n = len(nodes)
        points = values if self._positions_reported else places
        return (points.sum(axis=0) / n, self._variance / n * np.eye(2)) if n else None
