"""A diagonal."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from wsn_env.models.motion.base import FARTHEST_M, FASTEST_MS, Motion, set_state
from wsn_env.models.quantity import quantity


@dataclass(frozen=True)
class Straight(Motion):
    """The diagonal of the reproduction: from a point at a constant velocity, without noise."""

    allocates: ClassVar[bool] = False
    fitting_q: ClassVar[float] = 0.02
    from_m: float = quantity(5.0, "start, both axes", at_least=0, at_most=FARTHEST_M)
    velocity_ms: float = quantity(0.9, "velocity, both axes", at_least=-FASTEST_MS, at_most=FASTEST_MS)

    @staticmethod
    def draw(m: Any, stream: Any, course: Any, track: np.ndarray) -> None:
        for k in range(len(track)):
            x = m.from_m + m.velocity_ms * course.period_s * k
            set_state(track[k], x, m.velocity_ms, x, m.velocity_ms)
