"""Strengths in dB: what Rssi and Sonar share."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from wsn_env.compiled import draws
from wsn_env.compiled.elementary import F, log, log32
from wsn_env.models.measurement.base import Line, Measurement, Occasion, PositionBelief, level, level_slope, sample

if TYPE_CHECKING:
    from wsn_env.scenario import Scenario

FARTHEST_M = 1e7  # as far as a mean level is followed


class Level(Measurement):
    """Base of strengths in dB, with the mean level

        h(d) = level at 1 m - 10 n log10(d) - absorption d,    d at least `floor_m`

    and Gaussian noise of sd `noise_db`.
    """

    noise_db: float
    floor_m: float
    if TYPE_CHECKING:  # a kind's are constants, quantities or properties

        @property
        def exponent(self) -> float:
            """n."""

        @property
        def absorption_db_per_m(self) -> float:
            """Further loss with the distance."""
    else:
        exponent: float
        absorption_db_per_m: ClassVar[float] = 0.0
    abstract: ClassVar[bool] = True
    allocates: ClassVar[bool] = False
    gaussian: ClassVar[bool] = True

    @property
    def at_1m_db(self) -> float:
        """The first term."""
        raise NotImplementedError

    @property
    def fingerprint_unit(self) -> float:
        """What the widths of a fingerprint network are counted in [dB]."""
        return self.noise_db / 3

    def constants(self, scenario: Scenario) -> dict[str, float]:
        """h as `at_1m - slope ln(max(d, floor_m)^2) - absorption max(d, floor_m)`."""
        slope = 5 * self.exponent / math.log(10)
        return dict(
            at_1m=self.at_1m_db,
            slope=slope,
            absorption=self.absorption_db_per_m,
            noise=self.noise_db,
            floor_m=self.floor_m,
        )

    def mean_db(self, distance_m: float) -> float:
        """h(d)."""
        d = max(distance_m, self.floor_m)
        return self.at_1m_db - 10 * self.exponent * math.log10(d) - self.absorption_db_per_m * d

    def distance_m(self, level_db: float) -> float:
        """Where the mean level falls to this one, by bisection; 0: nowhere so high; FARTHEST_M: not before there."""
        if self.mean_db(self.floor_m) <= level_db:
            return 0.0
        near, far = self.floor_m, max(FARTHEST_M, self.floor_m)
        for _ in range(200):
            middle = math.sqrt(near * far)
            near, far = (middle, far) if self.mean_db(middle) > level_db else (near, middle)
        return far

    def raised(self, signal: np.ndarray, by_db: float) -> np.ndarray:
        """So many dB more."""
        return signal + by_db

    @staticmethod
    def level(m: Any, squared: float) -> float:
        near = max(squared, m.floor_m * m.floor_m, 1e-12)
        return m.at_1m - m.slope * log(near)

    @staticmethod
    def level_slope(m: Any, squared: float) -> float:
        if squared < max(m.floor_m * m.floor_m, 1e-12):
            return 0.0
        return -2.0 * m.slope / squared

    @staticmethod
    def sample(m: Any, stream: Any, node: Any, x: float, y: float) -> tuple[float, float]:
        noise, _ = draws.normal_pair(stream, node.number)
        dx, dy = node.x - x, node.y - y
        return level(m, dx * dx + dy * dy) + m.noise * noise, 0.0

    @staticmethod
    def linearise(m: Any, node: Any, belief: PositionBelief) -> tuple[Any, ...]:
        dx, dy = belief.x - node.x, belief.y - node.y
        squared = dx * dx + dy * dy
        if belief.xx + belief.yy > 0.0:  # smoothed over the belief's own width, which reaches beyond the floor
            squared = max(squared + 0.5 * (belief.xx + belief.yy), m.floor_m * m.floor_m)
        slope = level_slope(m, squared)
        return (Line(level(m, squared), slope * dx, slope * dy, m.noise * m.noise),)

    @staticmethod
    def signal(m: Any, occasion: Occasion, node: Any, x: float, y: float) -> float:
        stream = draws.stream(occasion.key, occasion.period, draws.MEASUREMENT)
        return sample(m, stream, node, x, y)[0]

    @staticmethod
    def weigh(m: Any, px: np.ndarray, py: np.ndarray, log_weights: np.ndarray, node: Any, value: Any) -> None:
        half_precision = F(0.5 / max(m.noise * m.noise, 1e-20))
        sx, sy, z = F(node.x), F(node.y), F(value[0])
        at_1m, slope, floor = F(m.at_1m), F(m.slope), F(max(m.floor_m * m.floor_m, 1e-12))
        for i in range(len(px)):
            dx = px[i] - sx
            dy = py[i] - sy
            r = (z - at_1m) + slope * log32(max(dx * dx + dy * dy, floor))
            log_weights[i] -= half_precision * (r * r)
