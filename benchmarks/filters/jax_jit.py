"""JAX on the CPU: one filter step compiled by XLA, mapped over rows."""

import functools

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.filters.implementation import Implementation
from benchmarks.filters.problem import Problem


class Jax(Implementation):
    """float32; with a single row there is no vmap."""

    batches = True
    package = "jax"

    def __init__(self, problem: Problem):
        jax.config.update("jax_platforms", "cpu")
        self.single = problem.rows == 1
        p = problem
        model = p.measurement, p.resampling, p.period_s, p.q, p.noise, p.level, p.slope, p.floor
        self.filter = compiled(*model, p.count, self.single)
        keys = jax.random.split(jax.random.key(problem.seed), problem.rows)
        first = (lambda array: array[0]) if self.single else (lambda array: array)
        self.keys = first(keys)
        self.cloud = jnp.asarray(first(problem.particles))
        self.sensors, self.values = (
            [jnp.asarray(first(array[:, k]), jnp.float32) for k in range(array.shape[1])]
            for array in (problem.sensors, problem.values)
        )
        super().__init__(problem)

    def restart(self) -> None:
        """Cloud with equal weights."""
        self.x = self.cloud
        self.log_weights = jnp.zeros(self.x.shape[:-2] + self.x.shape[-1:], jnp.float32)

    def advance(self, period: int) -> None:
        """One call; waits for its end."""
        self.keys, self.x, self.log_weights, *self.found = self.filter(
            self.keys, self.x, self.log_weights, self.sensors[period], self.values[period]
        )
        jax.block_until_ready((self.x, self.found))

    def estimate(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """As NumPy arrays."""
        return tuple(np.asarray(part)[None] if self.single else np.asarray(part) for part in self.found)


@functools.cache
def compiled(measurement, resampling, t, q, noise, level, slope, floor, count, single):
    """The filter step: key, x (4, P), log weights (P,), sensors and values (m, 2) to the next of the first three, mean,
    covariance, N_eff; each with a leading axis B unless `single`. JAX compiles it once for a shape."""

    def step(key, x, log_weights, sensors, values):
        key, for_noise, for_slots = jax.random.split(key, 3)
        a = q * jax.random.normal(for_noise, (2, count), jnp.float32)
        position, velocity = x[0::2] + t * x[1::2] + 0.5 * t * t * a, x[1::2] + t * a
        x = jnp.stack([position[0], velocity[0], position[1], velocity[1]])
        if measurement == "position":
            squares = (x[0] - values[:, 0:1]) ** 2 + (x[2] - values[:, 1:2]) ** 2
        else:
            squared = (x[0] - sensors[:, 0:1]) ** 2 + (x[2] - sensors[:, 1:2]) ** 2
            squares = (values[:, 0:1] - level + slope * jnp.log(jnp.maximum(squared, floor))) ** 2
        log_weights = log_weights - 0.5 / noise**2 * squares.sum(axis=0)
        w = jax.nn.softmax(log_weights)
        mean = x @ w
        deviation = x - mean[:, None]
        cov = (deviation * w) @ deviation.T
        if resampling:
            cumulated = jnp.cumsum(w)
            slots = cumulated[:-1] * (count / cumulated[-1]) - jax.random.uniform(for_slots) + 1
            ends = jnp.zeros(count + 1, jnp.int32).at[jnp.minimum(slots.astype(jnp.int32), count)].add(1)
            x, log_weights = x[:, jnp.cumsum(ends)[:count]], jnp.zeros_like(log_weights)
        return key, x, log_weights, mean, cov, 1 / (w @ w)

    return jax.jit(step if single else jax.vmap(step))
