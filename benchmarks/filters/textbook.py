"""The particle filter as a textbook writes it: NumPy in double precision, particles (P, 4), weights that multiply."""

import numpy as np

from benchmarks.filters.implementation import Implementation
from benchmarks.filters.problem import constant_velocity


class ParticleFilter:
    """A bootstrap filter over particles (P, 4) = x, vx, y, vy [m, m/s]."""

    def __init__(self, particles: np.ndarray, period_s: float, q: float, noise: float, rng: np.random.Generator):
        self.particles = particles
        self.weights = np.full(len(particles), 1 / len(particles))
        self.transition, self.noise_gain = constant_velocity(period_s)
        self.q, self.noise, self.rng = q, noise, rng

    def predict(self) -> None:
        """Constant velocity with white acceleration (eqs. 6, 8)."""
        noise = self.rng.normal(0, self.q, (len(self.particles), 2))
        self.particles = self.particles @ self.transition.T + noise @ self.noise_gain.T

    def weigh(self, positions) -> None:
        """Multiply the weights with the likelihood of each reported position (m, 2) (eq. 7)."""
        for z in positions:
            squared = np.sum((self.particles[:, [0, 2]] - z) ** 2, axis=1)
            self.weights *= np.exp(-0.5 * squared / self.noise**2)
        self._normalise()

    def weigh_strengths(self, sensors, strengths, level: float, slope: float, floor: float) -> None:
        """The same for strengths (m,) [dB] at sensors (m, 2): level - slope ln(max(d^2, floor)) (eq. 1)."""
        for sensor, z in zip(sensors, strengths):
            squared = np.sum((self.particles[:, [0, 2]] - sensor) ** 2, axis=1)
            expected = level - slope * np.log(np.maximum(squared, floor))
            self.weights *= np.exp(-0.5 * (z - expected) ** 2 / self.noise**2)
        self._normalise()

    def _normalise(self) -> None:
        self.weights += 1e-300
        self.weights /= np.sum(self.weights)

    def estimate(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean (4,) and covariance (4, 4)."""
        mean = np.average(self.particles, weights=self.weights, axis=0)
        deviation = self.particles - mean
        return mean, (deviation * self.weights[:, None]).T @ deviation

    def effective_size(self) -> float:
        """N_eff (eq. 14)."""
        return 1 / np.sum(self.weights**2)

    def resample(self) -> None:
        """Systematic resampling."""
        count = len(self.particles)
        slots = (np.arange(count) + self.rng.random()) / count
        chosen = np.searchsorted(np.cumsum(self.weights), slots)
        self.particles = self.particles[np.minimum(chosen, count - 1)]
        self.weights = np.full(count, 1 / count)


class Textbook(Implementation):
    """A filter of the class above on one row."""

    kind = ParticleFilter
    package = "numpy"

    def restart(self) -> None:
        """A new filter."""
        p = self.problem
        cloud = p.particles[0].T.astype(float)
        self.filter = self.kind(cloud, p.period_s, p.q, p.noise, np.random.default_rng(p.seed))

    def advance(self, period: int) -> None:
        """Predict, weigh, estimate, resample."""
        p, f = self.problem, self.filter
        f.predict()
        if p.measurement == "position":
            f.weigh(p.values[0, period])
        else:
            f.weigh_strengths(p.sensors[0, period], p.values[0, period, :, 0], p.level, p.slope, p.floor)
        self.found = *f.estimate(), f.effective_size()
        if p.resampling:
            f.resample()

    def estimate(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """With a leading axis of one row."""
        return tuple(np.asarray(part)[None] for part in self.found)
