"""The memoryless estimate of the paper's static-cluster system: the plain mean of a period's measurements."""

from wsn_env.scenario import Scenario
from wsn_env.sections import Position
from wsn_env.trackers.base import MomentTracker
from wsn_env.types import Belief, Network, Reports


class SnapshotTracker(MomentTracker):
    """Mean of the reported positions; of the reporting nodes' own positions where only a strength is measured.

    A period without a report keeps the last estimate, with a variance that grows by one step of 1 m/s.
    """

    def __init__(self, scenario: Scenario, threads: int = 1, fast: bool = False):
        m = scenario.measurement
        self._positions_reported = isinstance(m, Position)
        self._variance = m.noise_m**2 if self._positions_reported else scenario.radius_m**2 / 2
        self._growth = scenario.period_s**2

    def correct(self, keys, periods, belief: Belief, network: Network, reports: Reports, resampled) -> None:
        """Replace the estimate by the mean of the reports, in place."""
        for b in range(len(keys)):
            n = reports.count[b]
            belief.mean[b, [1, 3]] = 0.0
            if n == 0:
                belief.cov[b, [0, 2], [0, 2]] += self._growth
                continue
            points = reports.value[b, :n] if self._positions_reported else network.positions[b, reports.node[b, :n]]
            belief.mean[b, [0, 2]] = points.sum(axis=0) / n
            belief.cov[b] = 0.0
            belief.cov[b, [0, 2], [0, 2]] = self._variance / n
