"""A node reports where it takes the target to be."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from wsn_env.compiled import draws
from wsn_env.compiled.elementary import F, log
from wsn_env.models.measurement.base import Line, Measurement, Occasion, Order, PositionBelief
from wsn_env.models.quantity import quantity

EXPONENT, NOISE_DB = 2.5, 3.0  # of a received strength, as Rssi has them
LN_10 = 2.302585092994046


@dataclass(frozen=True)
class Position(Measurement):
    """A node's own noisy position of the target: z = (x, y) + noise. Xiang & Guo (2013), eq. 7."""

    noise_m: float = quantity(2.0, "sd of each coordinate", at_least=1e-3, at_most=1e9)

    allocates: ClassVar[bool] = False
    gaussian: ClassVar[bool] = True
    values: ClassVar[int] = 2
    equal_everywhere: ClassVar[bool] = True
    order: ClassVar[Order] = "nearest"

    def fixes(self, values: np.ndarray, places: np.ndarray, radius_m: float) -> tuple[np.ndarray, float]:
        """The reports themselves."""
        return values, self.noise_m**2

    def signals(self, values: np.ndarray, places: np.ndarray) -> np.ndarray:
        """A power that falls with the square of the distance to what the node reports."""
        offset = values - places
        return 1.0 / np.maximum((offset * offset).sum(axis=-1), 1e-6)

    @staticmethod
    def sample(m: Any, stream: Any, node: Any, x: float, y: float) -> tuple[float, float]:
        e0, e1 = draws.normal_pair(stream, node.number)
        return x + m.noise_m * e0, y + m.noise_m * e1

    @staticmethod
    def weigh(m: Any, px: np.ndarray, py: np.ndarray, log_weights: np.ndarray, node: Any, value: Any) -> None:
        half_precision = F(0.5 / max(m.noise_m * m.noise_m, 1e-20))
        zx, zy = F(value[0]), F(value[1])
        for i in range(len(px)):
            dx = px[i] - zx
            dy = py[i] - zy
            log_weights[i] -= half_precision * (dx * dx + dy * dy)

    @staticmethod
    def linearise(m: Any, node: Any, belief: PositionBelief) -> tuple[Any, ...]:
        variance = m.noise_m * m.noise_m
        return Line(belief.x, 1.0, 0.0, variance), Line(belief.y, 0.0, 1.0, variance)

    @staticmethod
    def signal(m: Any, occasion: Occasion, node: Any, x: float, y: float) -> float:
        """The received strength [dB], eq. 1 in its log-distance form."""
        dx, dy = node.x - x, node.y - y
        noise, _ = draws.normal_pair(draws.stream(occasion.key, occasion.period, draws.STRENGTH), node.number)
        return NOISE_DB * noise - 5.0 * EXPONENT / LN_10 * log(max(dx * dx + dy * dy, 1.0))
