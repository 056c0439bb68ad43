"""Nearly constant velocity, and nothing else: a target that knows of no border."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from wsn_env.compiled import draws
from wsn_env.models.motion.base import FARTHEST_M, FASTEST_MS, Motion, set_state
from wsn_env.models.motion.prediction import advance
from wsn_env.models.quantity import quantity


@dataclass(frozen=True)
class Free(Motion):
    """Nearly constant velocity from a normal start about the field's middle; the target may leave the field.

        x(0) ~ N(middle, spread_m^2), v(0) ~ N(0, speed_ms^2) along each axis; x(k+1) = F x(k) + G a, a ~ N(0, q^2)

    Nothing is drawn again or reflected: the law of the track is the one that the Cramer-Rao bound supposes, and with
    filter_q = acceleration_ms2 the filter's.
    """

    allocates: ClassVar[bool] = False
    bounded: ClassVar[bool] = False
    fitting_q: ClassVar[float] = 0.025
    spread_m: float = quantity(
        8.0, "sd of the start about the field's middle, along each axis", above=0, at_most=FARTHEST_M
    )
    speed_ms: float = quantity(0.15, "sd of the velocity at the start, along each axis", above=0, at_most=FASTEST_MS)
    acceleration_ms2: float = quantity(0.025, "sd of the white acceleration on the track (q)", at_least=0, at_most=1000)

    @property
    def process_noise_ms2(self) -> float | None:
        """That of the settings."""
        return self.acceleration_ms2

    @property
    def start_sds(self) -> tuple[float, float] | None:
        """Those of the settings [m, m/s]."""
        return self.spread_m, self.speed_ms

    @staticmethod
    def draw(m: Any, stream: Any, course: Any, track: np.ndarray) -> None:
        x, y = draws.normal_pair(stream, 0)
        vx, vy = draws.normal_pair(stream, 1)
        middle_x, middle_y = 0.5 * course.side_m, 0.5 * course.depth_m
        start_x, start_y = middle_x + m.spread_m * x, middle_y + m.spread_m * y
        set_state(track[0], start_x, m.speed_ms * vx, start_y, m.speed_ms * vy)
        for k in range(len(track) - 1):
            ax, ay = draws.normal_pair(stream, 2 + k)
            advance(track[k], course.period_s, m.acceleration_ms2 * ax, m.acceleration_ms2 * ay, track[k + 1])
