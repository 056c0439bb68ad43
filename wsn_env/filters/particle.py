"""The cluster particle filter (Xiang & Guo, 2013, eqs. 9-15); its arithmetic stands in `kernels`."""

import numpy as np

from wsn_env.compiled import kernels as compiling
from wsn_env.compiled.kernels import over_rows, threads_for
from wsn_env.filters import kernels
from wsn_env.models.state import Belief, Network, Reports
from wsn_env.scenario import Scenario
from wsn_env.scenario.constants import constants


class ParticleTracker:
    """A bootstrap filter with systematic resampling at N_eff < 2P/3.

    Fusion "joint": members send z and every particle is weighed with the product of the likelihoods. "pooled" (the
    paper): particle i is weighed by member i mod m only, and the head pools the members' sums. A period without
    reports only predicts.
    """

    def __init__(self, scenario: Scenario, threads: int = 1, fast: bool = False) -> None:
        self.particles: int = scenario.tracking.particles
        self.threads = threads
        self._filter_rows = compiling.fast(kernels.filter_rows) if fast else kernels.filter_rows
        self._constants = constants(scenario)
        field = scenario.field
        self.maps: np.ndarray = scenario.measurement.residual_maps(field.nodes, field.room_m)
        self._anywhere = scenario.tracking.velocity_s is not None and scenario.tracking.start != "known"

    def start(self, keys: np.ndarray, periods: np.ndarray, rows: np.ndarray, belief: Belief) -> None:
        """Draw the clouds of the marked rows from N(mean, cov), in place; of walkers whose start is not known, from all
        over the room."""
        threads = threads_for(rows, self.threads)
        if self._anywhere:
            over_rows(kernels.scatter_rows, len(keys), threads, self._constants, keys, periods, rows, belief.handle)
            return
        over_rows(kernels.spread_rows, len(keys), threads, keys, periods, rows, belief.handle)

    def relocate(self, keys: np.ndarray, periods: np.ndarray, rows: np.ndarray, belief: Belief) -> None:
        """Draw the positions of the marked rows' particles from N(mean, cov), in place; keep the velocities."""
        threads = threads_for(rows, self.threads)
        over_rows(kernels.relocate_rows, len(keys), threads, keys, periods, rows, belief.handle)

    def correct(
        self,
        keys: np.ndarray,
        periods: np.ndarray,
        belief: Belief,
        network: Network,
        reports: Reports,
        resampled: np.ndarray,
    ) -> None:
        """Predict, weigh, read mean and covariance, resample, in place."""
        handles = belief.handle, network.handle, reports.handle
        arguments = self._constants, self.maps, (keys, periods), handles, resampled
        over_rows(self._filter_rows, len(keys), self.threads, *arguments)
