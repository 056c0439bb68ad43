"""The particle filter out of a library's parts, as filterpy's book builds it."""

import numpy as np
import scipy.stats
from filterpy.monte_carlo import systematic_resample

from benchmarks.filters.textbook import ParticleFilter, Textbook


class BookFilter(ParticleFilter):
    """SciPy's densities, NumPy's covariance, filterpy's resampling."""

    def weigh(self, positions) -> None:
        """Multiply the weights with the likelihood of each reported coordinate (eq. 7)."""
        for z in positions:
            self.weights *= scipy.stats.norm(self.particles[:, 0], self.noise).pdf(z[0])
            self.weights *= scipy.stats.norm(self.particles[:, 2], self.noise).pdf(z[1])
        self._normalise()

    def weigh_strengths(self, sensors, strengths, level: float, slope: float, floor: float) -> None:
        """The same for strengths (m,) [dB] at sensors (m, 2) (eq. 1)."""
        for sensor, z in zip(sensors, strengths):
            distance = np.linalg.norm(self.particles[:, [0, 2]] - sensor, axis=1)
            expected = level - 2 * slope * np.log(np.maximum(distance, floor**0.5))
            self.weights *= scipy.stats.norm(expected, self.noise).pdf(z)
        self._normalise()

    def estimate(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean (4,) and covariance (4, 4)."""
        mean = np.average(self.particles, weights=self.weights, axis=0)
        return mean, np.cov(self.particles, rowvar=False, aweights=self.weights, ddof=0)

    def resample(self) -> None:
        """Systematic resampling."""
        self.particles = self.particles[systematic_resample(self.weights)]
        self.weights = np.full(len(self.particles), 1 / len(self.particles))


class Book(Textbook):
    """A book's filter on one row."""

    kind = BookFilter
    package = "filterpy"
