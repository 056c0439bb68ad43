"""NumPy at its best: float32, structure of arrays (B, 4, P), everything in place, the counting resampler."""

import numpy as np

from benchmarks.filters.implementation import Implementation
from benchmarks.filters.problem import Problem

F = np.float32


class Tuned(Implementation):
    """All rows in each call of NumPy."""

    batches = True
    package = "numpy"

    def __init__(self, problem: Problem):
        shape = problem.rows, problem.count
        self.x, self.moved = (np.empty((shape[0], 4, shape[1]), F) for _ in range(2))
        self.noise = np.empty((shape[0], 2, shape[1]), F)
        self.log_weights, self.weights, self.a, self.b = (np.empty(shape, F) for _ in range(4))
        self.cumulated = np.empty(shape)
        self.rng = np.random.Generator(np.random.SFC64(problem.seed))  # the fastest of NumPy's
        self.sensors, self.values = problem.sensors.astype(F), problem.values.astype(F)
        super().__init__(problem)

    def restart(self) -> None:
        """Clouds and weights."""
        self.x[:] = self.problem.particles
        self.log_weights[:] = 0

    def advance(self, period: int) -> None:
        """Predict, weigh, estimate, resample."""
        self._predict()
        if self.problem.measurement == "position":
            self._weigh_positions(self.values[:, period])
        else:
            self._weigh_strengths(self.sensors[:, period], self.values[:, period, :, 0])
        self._estimate()
        if self.problem.resampling:
            self._resample()

    def estimate(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """As found."""
        return self.mean, self.cov, self.n_eff

    def _predict(self) -> None:
        t, q = F(self.problem.period_s), F(self.problem.q)
        position, velocity, noise = self.x[:, 0::2], self.x[:, 1::2], self.noise
        self.rng.standard_normal(out=noise, dtype=F)
        np.multiply(noise, q * t, out=noise)  # the change of the velocity; half of it, times t, of the position
        for axis in range(2):
            np.multiply(velocity[:, axis], t, out=self.a)
            position[:, axis] += self.a
        velocity += noise
        np.multiply(noise, F(0.5) * t, out=noise)
        position += noise

    def _squared_distances(self, points) -> np.ndarray:
        """(B, P) to the points (B, 2), in `a`."""
        np.subtract(self.x[:, 0], points[:, 0:1], out=self.a)
        np.subtract(self.x[:, 2], points[:, 1:2], out=self.b)
        np.multiply(self.a, self.a, out=self.a)
        np.multiply(self.b, self.b, out=self.b)
        return np.add(self.a, self.b, out=self.a)

    def _weigh_positions(self, positions) -> None:
        for member in range(positions.shape[1]):
            squared = self._squared_distances(positions[:, member])
            squared *= F(0.5 / self.problem.noise**2)
            self.log_weights -= squared

    def _weigh_strengths(self, sensors, strengths) -> None:
        p = self.problem
        for member in range(sensors.shape[1]):
            residual = self._squared_distances(sensors[:, member])
            np.maximum(residual, F(p.floor), out=residual)
            np.log(residual, out=residual)
            residual *= F(p.slope)
            residual += (strengths[:, member] - F(p.level))[:, None]
            np.multiply(residual, residual, out=residual)
            residual *= F(0.5 / p.noise**2)
            self.log_weights -= residual

    def _estimate(self) -> None:
        w, d = self.weights, self.moved
        self.log_weights -= self.log_weights.max(axis=1, keepdims=True)
        np.exp(self.log_weights, out=w)
        w /= w.sum(axis=1, keepdims=True)
        self.mean = (self.x @ w[:, :, None])[:, :, 0]
        np.subtract(self.x, self.mean[:, :, None], out=d)
        self.cov = (d * w[:, None]) @ d.transpose(0, 2, 1)
        self.n_eff = 1 / np.einsum("bp,bp->b", w, w)

    def _resample(self) -> None:
        """How many particles end before each slot; their running count is the slot's ancestor."""
        rows, count = self.weights.shape
        cumulated = np.cumsum(self.weights, axis=1, out=self.cumulated)
        scaled = cumulated[:, :-1] * (count / cumulated[:, -1:])
        scaled -= self.rng.random((rows, 1))
        scaled += 1.0
        slots = np.minimum(scaled.astype(np.int64), count)
        for row in range(rows):
            ancestors = np.cumsum(np.bincount(slots[row], minlength=count + 1)[:count])
            np.take(self.x[row], ancestors, axis=1, out=self.moved[row], mode="clip")
        self.x, self.moved = self.moved, self.x
        self.log_weights[:] = 0
