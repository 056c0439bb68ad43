"""Stone Soup's predictor, updater and resampler for particles."""

from datetime import datetime, timedelta

import numpy as np
from stonesoup.base import Property
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.models.measurement.nonlinear import NonLinearGaussianMeasurement
from stonesoup.models.transition.linear import LinearGaussianTimeInvariantTransitionModel
from stonesoup.predictor.particle import ParticlePredictor
from stonesoup.resampler.particle import SystematicResampler
from stonesoup.types.array import CovarianceMatrix, StateVector, StateVectors
from stonesoup.types.detection import Detection
from stonesoup.types.hypothesis import SingleHypothesis
from stonesoup.types.state import ParticleState
from stonesoup.updater.particle import ParticleUpdater

from benchmarks.filters.implementation import Implementation
from benchmarks.filters.problem import PERIODS, Problem, constant_velocity

START = datetime(2025, 1, 1)


class Strength(NonLinearGaussianMeasurement):
    """Strengths [dB] at k sensors: level - slope ln(max(d^2, floor)) (eq. 1)."""

    sensors: np.ndarray = Property(doc="(k, 2) m")
    level: float = Property(doc="dB")
    slope: float = Property(doc="dB")
    floor: float = Property(doc="m^2")

    @property
    def ndim_meas(self) -> int:
        """k."""
        return len(self.sensors)

    def function(self, state, noise=False, **kwargs):
        """(k, P) without noise."""
        position = np.asarray(state.state_vector[self.mapping, :])
        squared = ((position[None] - self.sensors[:, :, None]) ** 2).sum(axis=1)
        return (self.level - self.slope * np.log(np.maximum(squared, self.floor))).view(StateVectors)

    def rvs(self, *args, **kwargs):
        """Not needed by a filter."""
        raise NotImplementedError


class Stacked(Implementation):
    """The m reports as one long measurement, the quickest way."""

    package = "stonesoup"

    def __init__(self, problem: Problem):
        transition, gain = constant_velocity(problem.period_s)
        process = problem.q**2 * gain @ gain.T
        self.predictor = ParticlePredictor(
            LinearGaussianTimeInvariantTransitionModel(
                transition_matrix=transition, covariance_matrix=CovarianceMatrix(process), seed=problem.seed
            )
        )
        self.updater, self.resampler = ParticleUpdater(None), SystematicResampler()
        self.times = [START + timedelta(seconds=problem.period_s * k) for k in range(PERIODS + 1)]
        self.detections = [self._detections(problem, k) for k in range(PERIODS)]
        super().__init__(problem)

    def _groups(self, members: int) -> list[slice]:
        """Which reports make a measurement."""
        return [slice(0, members)]

    def _detections(self, problem: Problem, period: int) -> list[Detection]:
        sensors, values = problem.sensors[0, period], problem.values[0, period]
        detections = []
        for group in self._groups(len(values)):
            count = len(values[group])
            if problem.measurement == "position":
                model = LinearGaussian(4, (0, 2) * count, problem.noise**2 * np.eye(2 * count))
                value = values[group].reshape(-1, 1)
            else:
                model = Strength(
                    ndim_state=4,
                    mapping=(0, 2),
                    noise_covar=CovarianceMatrix(problem.noise**2 * np.eye(count)),
                    sensors=sensors[group],
                    level=problem.level,
                    slope=problem.slope,
                    floor=problem.floor,
                )
                value = values[group, :1]
            time = self.times[period + 1]
            detections.append(Detection(StateVector(value), timestamp=time, measurement_model=model))
        return detections

    def restart(self) -> None:
        """Cloud with equal weights."""
        count = self.problem.count
        vectors = StateVectors(self.problem.particles[0].astype(float))
        self.posterior = ParticleState(vectors, weight=np.full(count, 1 / count), timestamp=START)

    def advance(self, period: int) -> None:
        """Predict, update, mean and covariance, resample."""
        state = self.predictor.predict(self.posterior, timestamp=self.times[period + 1])
        for detection in self.detections[period]:
            state = self.updater.update(SingleHypothesis(state, detection))
        weights = np.exp(state.log_weight)
        self.found = state.mean, state.covar, 1 / np.sum(weights**2)
        self.posterior = self.resampler.resample(state) if self.problem.resampling else state

    def estimate(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Stone Soup's mean and covariance of the weighted particles."""
        mean, cov, n_eff = self.found
        return np.asarray(mean, float).reshape(1, 4), np.asarray(cov, float)[None], np.array([n_eff])


class Updates(Stacked):
    """One update for each of the m reports, as its tutorials do."""

    def _groups(self, members: int) -> list[slice]:
        return [slice(member, member + 1) for member in range(members)]
