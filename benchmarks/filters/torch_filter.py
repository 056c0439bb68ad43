"""torch on the CPU, all rows in each call: eager, and compiled by Inductor."""

import shutil

import numpy as np
import torch

from benchmarks.filters.implementation import Absent, Implementation
from benchmarks.filters.problem import Problem


class Torch(Implementation):
    """Eager. float32 with sums of weights in double."""

    batches = True
    package = "torch"

    def __init__(self, problem: Problem):
        self.generator = torch.Generator().manual_seed(problem.seed)
        self.cloud = torch.tensor(problem.particles)
        self.sensors, self.values = (
            torch.tensor(array, dtype=torch.float32) for array in (problem.sensors, problem.values)
        )
        super().__init__(problem)

    def restart(self) -> None:
        """Clouds with equal weights."""
        self.x = self.cloud.clone()
        self.log_weights = torch.zeros(self.cloud.shape[0], self.cloud.shape[2])

    @torch.no_grad()
    def advance(self, period: int) -> None:
        """One call."""
        arguments = self.x, self.log_weights, self.sensors[:, period], self.values[:, period]
        self.x, self.log_weights, *self.found = self._filter(*arguments)

    def _filter(self, x, log_weights, sensors, values):
        """Predict, weigh, estimate, resample: x (B, 4, P), log weights (B, P), sensors and values (B, m, 2) to the next
        of the first two, mean, covariance, N_eff."""
        p, t = self.problem, self.problem.period_s
        rows, _, count = x.shape
        a = p.q * torch.randn(rows, 2, count, generator=self.generator)
        position = x[:, 0::2] + t * x[:, 1::2] + 0.5 * t * t * a
        velocity = x[:, 1::2] + t * a
        x = torch.stack([position, velocity], dim=2).view(rows, 4, count)
        points = values if p.measurement == "position" else sensors
        squares = (position[:, 0:1] - points[:, :, 0:1]) ** 2 + (position[:, 1:2] - points[:, :, 1:2]) ** 2
        if p.measurement == "rssi":
            expected = p.level - p.slope * torch.log(squares.clamp(min=p.floor))
            squares = (values[:, :, 0:1] - expected) ** 2
        log_weights = log_weights - 0.5 / p.noise**2 * squares.sum(dim=1)
        w = torch.softmax(log_weights, dim=-1)
        mean = torch.bmm(x, w[:, :, None])
        deviation = x - mean
        cov = torch.bmm(deviation * w[:, None], deviation.transpose(1, 2))
        n_eff = 1 / (w * w).sum(dim=-1)
        if p.resampling:
            x, log_weights = self._resampled(x, w), torch.zeros_like(log_weights)
        return x, log_weights, mean[:, :, 0], cov, n_eff

    def _resampled(self, x, w):
        rows, _, count = x.shape
        cumulated = torch.cumsum(w, dim=-1, dtype=torch.float64)
        offset = torch.rand(rows, 1, generator=self.generator)
        slots = (cumulated[:, :-1] * (count / cumulated[:, -1:]) - offset + 1).long().clamp(max=count)
        ends = torch.zeros(rows, count + 1, dtype=torch.long).scatter_add(1, slots, torch.ones_like(slots))
        ancestors = torch.cumsum(ends, dim=1)[:, :count]
        return torch.gather(x, 2, ancestors[:, None].expand(rows, 4, count))

    def estimate(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """As NumPy arrays."""
        return tuple(part.numpy() for part in self.found)


class Compiled(Torch):
    """By torch.compile, for the shapes of the problem."""

    def __init__(self, problem: Problem):
        if shutil.which("g++") is None:
            raise Absent("no C++ compiler g++")
        super().__init__(problem)
        torch.manual_seed(problem.seed)
        self.generator = None  # it knows only the global one
        # The generator of eager torch: Inductor's own is several times slower on a CPU.
        self._filter = torch.compile(self._filter, dynamic=False, options={"fallback_random": True})
