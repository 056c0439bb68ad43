"""The package `pfilter`, with functions for the dynamics, the noise, the observation and its likelihood."""

import numpy as np
import pfilter

from benchmarks.filters.implementation import Implementation
from benchmarks.filters.problem import Problem, constant_velocity


class PFilter(Implementation):
    """Its `update`, with its systematic resampling."""

    package = "pfilter"

    def __init__(self, problem: Problem):
        transition, gain = constant_velocity(problem.period_s)
        self.rng = np.random.default_rng(problem.seed)
        self.period_now = 0
        self.filter = pfilter.ParticleFilter(
            prior_fn=lambda count: problem.particles[0].T.astype(float),
            dynamics_fn=lambda x: x @ transition.T,
            noise_fn=lambda x: x + self.rng.normal(0, problem.q, (problem.count, 2)) @ gain.T,
            observe_fn=self._positions if problem.measurement == "position" else self._strengths,
            weight_fn=self._likelihood,
            resample_fn=pfilter.systematic_resample,
            n_particles=problem.count,
            n_eff_threshold=1.0 if problem.resampling else 0.0,
        )
        columns = slice(0, 2) if problem.measurement == "position" else slice(0, 1)
        self.reports = problem.values[0][:, :, columns].reshape(len(problem.values[0]), -1)
        super().__init__(problem)

    def _positions(self, x):
        return np.tile(x[:, [0, 2]], self.problem.values.shape[2])

    def _strengths(self, x):
        p = self.problem
        offsets = x[:, None, [0, 2]] - p.sensors[0, self.period_now]
        return p.level - p.slope * np.log(np.maximum((offsets**2).sum(axis=-1), p.floor))

    def _likelihood(self, expected, reported):
        return np.exp(-0.5 * ((expected - reported) ** 2).sum(axis=1) / self.problem.noise**2)

    def restart(self) -> None:
        """Cloud with equal weights."""
        self.filter.init_filter()
        self.filter.weights = np.full(self.problem.count, 1 / self.problem.count)

    def advance(self, period: int) -> None:
        """One update."""
        self.period_now = period
        self.filter.update(self.reports[period])

    def estimate(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Its own, but for the factor of NumPy's unbiased covariance."""
        f = self.filter
        sample_share = 1 - np.sum(f.original_weights**2)
        return f.mean_state[None], sample_share * f.cov_state[None], np.array([f.n_eff * self.problem.count])
