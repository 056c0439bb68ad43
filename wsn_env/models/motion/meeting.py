"""Targets that meet."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from wsn_env.compiled import draws
from wsn_env.compiled.elementary import HALF_PI, sincos
from wsn_env.models.motion.base import FARTHEST_M, FASTEST_MS, Motion, set_state
from wsn_env.models.motion.prediction import advance
from wsn_env.models.quantity import quantity


@dataclass(frozen=True)
class Meeting(Motion):
    """Through the middle of the field at half of the horizon, in a direction of its own: several targets meet there.

    Straight, but for noise. From which side a target comes is drawn uniformly over all directions.
    """

    allocates: ClassVar[bool] = False
    speed_ms: float = quantity(0.8, "speed", above=0, at_most=FASTEST_MS)
    miss_m: float = quantity(2.0, "sd, along x and y, of where it is at half time", at_least=0, at_most=FARTHEST_M)
    acceleration_ms2: float = quantity(0.02, "sd of the white acceleration", at_least=0, at_most=1000)

    @property
    def fitting_q(self) -> float:  # type: ignore[override]
        """As a crossing's: twice the track's own, and no less than 0.05."""
        return max(2.0 * self.acceleration_ms2, 0.05)

    @property
    def process_noise_ms2(self) -> float | None:
        """That of the settings."""
        return self.acceleration_ms2

    @staticmethod
    def draw(m: Any, stream: Any, course: Any, track: np.ndarray) -> None:
        s, c = sincos(4.0 * HALF_PI * draws.uniform(stream, 0))
        off_x, off_y = draws.normal_pair(stream, 1)
        until = 0.5 * (len(track) - 1) * course.period_s
        vx, vy = m.speed_ms * c, m.speed_ms * s
        x, y = 0.5 * course.side_m + m.miss_m * off_x, 0.5 * course.depth_m + m.miss_m * off_y
        set_state(track[0], x - until * vx, vx, y - until * vy, vy)
        for k in range(len(track) - 1):
            ax, ay = draws.normal_pair(stream, 10 + k)
            advance(track[k], course.period_s, m.acceleration_ms2 * ax, m.acceleration_ms2 * ay, track[k + 1])
