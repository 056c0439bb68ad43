"""The naive environment with Stone Soup's predictor, updater and resampler in it, an update for each report."""

from datetime import datetime, timedelta

import numpy as np
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.models.transition.linear import LinearGaussianTimeInvariantTransitionModel
from stonesoup.predictor.particle import ParticlePredictor
from stonesoup.resampler.particle import SystematicResampler
from stonesoup.types.array import CovarianceMatrix, StateVector, StateVectors
from stonesoup.types.detection import Detection
from stonesoup.types.hypothesis import SingleHypothesis
from stonesoup.types.state import ParticleState
from stonesoup.updater.particle import ParticleUpdater

from benchmarks.filters.problem import constant_velocity

START = datetime(2025, 1, 1)


class StoneSoupFilter:
    """As `benchmarks.filters.textbook.ParticleFilter`, for `NaiveEnv`."""

    def __init__(self, particles: np.ndarray, period_s: float, q: float, noise: float, rng: np.random.Generator):
        self.transition, gain = constant_velocity(period_s)
        motion = LinearGaussianTimeInvariantTransitionModel(
            transition_matrix=self.transition,
            covariance_matrix=CovarianceMatrix(q**2 * gain @ gain.T),
            seed=int(rng.integers(2**31)),
        )
        self.predictor, self.updater = ParticlePredictor(motion), ParticleUpdater(None)
        self.resampler, self.period = SystematicResampler(), timedelta(seconds=period_s)
        self.model = LinearGaussian(4, (0, 2), noise**2 * np.eye(2))
        count = len(particles)
        self.state = ParticleState(StateVectors(particles.T), weight=np.full(count, 1 / count), timestamp=START)

    def predict(self) -> None:
        """A period on."""
        self.state = self.predictor.predict(self.state, timestamp=self.state.timestamp + self.period)

    def weigh(self, positions) -> None:
        """With each reported position (m, 2)."""
        for z in positions:
            report = Detection(StateVector(z), timestamp=self.state.timestamp, measurement_model=self.model)
            self.state = self.updater.update(SingleHypothesis(self.state, report))

    def estimate(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean (4,) and covariance (4, 4)."""
        return np.asarray(self.state.mean, float).ravel(), np.asarray(self.state.covar, float)

    def effective_size(self) -> float:
        """N_eff (eq. 14)."""
        return 1 / np.sum(np.exp(2 * self.state.log_weight))

    def resample(self) -> None:
        """Systematic resampling."""
        self.state = self.resampler.resample(self.state)
