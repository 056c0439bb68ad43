"""Received power."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from wsn_env.compiled import draws
from wsn_env.compiled.elementary import F, exp, exp32, log, log32
from wsn_env.compiled.kernels import lean_piece
from wsn_env.models.measurement.base import Line, Measurement, Occasion, PositionBelief, sample
from wsn_env.models.quantity import ScenarioError, quantity

if TYPE_CHECKING:
    from wsn_env.scenario import Scenario


@lean_piece
def power(m: Any, squared: float) -> float:
    """Mean power at a squared distance [m^2]."""
    near = max(squared, m.floor_m * m.floor_m, 1e-12)
    return m.amplitude * exp(-(m.slope * log(near)))


MOST_RATIO = 1e18  # of the amplitude to the noise


@dataclass(frozen=True)
class RssiPower(Measurement):
    """Received power: a max(d, floor)^-beta + noise (eq. 1 as printed, 2 <= beta <= 4)."""

    amplitude: float = quantity(100.0, "power a at 1 m, in any unit", at_least=1e-30, at_most=1e15)
    exponent: float = quantity(2.0, "beta", at_least=2, at_most=4)
    noise: float = quantity(0.2, "sd, in the same unit", at_least=1e-30, at_most=1e15)
    floor_m: float = quantity(1.0, "nearer than this the power grows no more", at_least=1e-6, at_most=1e6)

    allocates: ClassVar[bool] = False
    gaussian: ClassVar[bool] = True

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.amplitude <= MOST_RATIO * self.noise:
            least = self.amplitude / MOST_RATIO
            raise ScenarioError(
                f"RssiPower.noise = {self.noise}: must be at least {least:g}, amplitude / {MOST_RATIO:g}"
            )

    @property
    def fingerprint_unit(self) -> float:
        """A third of the noise stands for the decibel."""
        return self.noise / 3

    def constants(self, scenario: Scenario) -> dict[str, float]:
        """The mean as `amplitude exp(-slope ln(max(d, floor_m)^2))`."""
        return dict(amplitude=self.amplitude, slope=self.exponent / 2, noise=self.noise, floor_m=self.floor_m)

    def squared_ranges(self, values: np.ndarray, most_m: float) -> tuple[np.ndarray, np.ndarray]:
        """Squared distances that powers (n,) speak of, by eq. 1 turned round, and their sds to first order [m^2].

        Args:
            most_m: a weaker power, and one that noise has made negative, is taken to come from this far.
        """
        powers = np.maximum(values, self.amplitude * most_m**-self.exponent)
        squared = np.minimum((self.amplitude / powers) ** (2 / self.exponent), most_m**2)
        return squared, squared * (2 * self.noise / (self.exponent * powers))

    @staticmethod
    def sample(m: Any, stream: Any, node: Any, x: float, y: float) -> tuple[float, float]:
        noise, _ = draws.normal_pair(stream, node.number)
        dx, dy = node.x - x, node.y - y
        return power(m, dx * dx + dy * dy) + m.noise * noise, 0.0

    @staticmethod
    def signal(m: Any, occasion: Occasion, node: Any, x: float, y: float) -> float:
        stream = draws.stream(occasion.key, occasion.period, draws.MEASUREMENT)
        return sample(m, stream, node, x, y)[0]

    @staticmethod
    def linearise(m: Any, node: Any, belief: PositionBelief) -> tuple[Any, ...]:
        dx, dy = belief.x - node.x, belief.y - node.y
        squared = dx * dx + dy * dy
        if belief.xx + belief.yy > 0.0:  # smoothed over the belief's own width, which reaches beyond the floor
            squared = max(squared + 0.5 * (belief.xx + belief.yy), m.floor_m * m.floor_m)
        slope = 0.0
        if squared >= max(m.floor_m * m.floor_m, 1e-12):
            slope = -2.0 * m.slope / squared * power(m, squared)
        return (Line(power(m, squared), slope * dx, slope * dy, m.noise * m.noise),)

    @staticmethod
    def weigh(m: Any, px: np.ndarray, py: np.ndarray, log_weights: np.ndarray, node: Any, value: Any) -> None:
        sx, sy = F(node.x), F(node.y)
        slope, floor = F(m.slope), F(max(m.floor_m * m.floor_m, 1e-12))
        log_floor = log32(floor)
        top = F(m.amplitude * exp(-m.slope * np.float64(log_floor)) / m.noise)  # at the floor, the greatest there is
        z = F(value[0] / m.noise)  # powers in units of the noise: their own may be too small for float32
        for i in range(len(px)):
            dx = px[i] - sx
            dy = py[i] - sy
            r = z - top * exp32(-slope * (log32(max(dx * dx + dy * dy, floor)) - log_floor))
            log_weights[i] -= F(0.5) * (r * r)
