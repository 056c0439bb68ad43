"""torch on the CPU, eager, all rows in each call."""

import numpy as np
import torch

from benchmarks.filters.contestant import Contestant
from benchmarks.filters.problem import Problem


class Torch(Contestant):
    """float32 with sums of weights in double."""

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

    @torch.inference_mode()
    def advance(self, period: int) -> None:
        """Predict, weigh, estimate, resample."""
        p, x, t = self.problem, self.x, self.problem.period_s
        rows, _, count = x.shape
        a = p.q * torch.randn(rows, 2, count, generator=self.generator)
        position = x[:, 0::2] + t * x[:, 1::2] + 0.5 * t * t * a
        velocity = x[:, 1::2] + t * a
        x = torch.stack([position, velocity], dim=2).view(rows, 4, count)
        points = self.values[:, period] if p.measurement == "position" else self.sensors[:, period]
        squares = (position[:, 0:1] - points[:, :, 0:1]) ** 2 + (position[:, 1:2] - points[:, :, 1:2]) ** 2
        if p.measurement == "rssi":
            expected = p.level - p.slope * torch.log(squares.clamp_(min=p.floor))
            squares = (self.values[:, period, :, 0:1] - expected) ** 2
        self.log_weights = self.log_weights - 0.5 / p.noise**2 * squares.sum(dim=1)
        w = torch.softmax(self.log_weights, dim=-1)
        mean = torch.bmm(x, w[:, :, None])
        deviation = x - mean
        cov = torch.bmm(deviation * w[:, None], deviation.transpose(1, 2))
        self.found = mean[:, :, 0], cov, 1 / (w * w).sum(dim=-1)
        self.x = self._resampled(x, w) if p.resampling else x

    def _resampled(self, x, w):
        rows, _, count = x.shape
        cumulated = torch.cumsum(w, dim=-1, dtype=torch.float64)
        offset = torch.rand(rows, 1, generator=self.generator)
        slots = (cumulated[:, :-1] * (count / cumulated[:, -1:]) - offset + 1).long().clamp_(max=count)
        ends = torch.zeros(rows, count + 1, dtype=torch.long).scatter_add_(1, slots, torch.ones_like(slots))
        ancestors = torch.cumsum(ends, dim=1)[:, :count]
        self.log_weights = torch.zeros_like(self.log_weights)
        return torch.gather(x, 2, ancestors[:, None].expand(rows, 4, count))

    def estimate(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """As NumPy arrays."""
        return tuple(part.numpy() for part in self.found)
