"""A wave across the field."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from wsn_env.compiled.elementary import HALF_PI, sincos
from wsn_env.models.motion.base import FASTEST_MS, Motion, set_state
from wsn_env.models.quantity import quantity

if TYPE_CHECKING:
    from wsn_env.scenario import Scenario


@dataclass(frozen=True)
class Sine(Motion):
    """One full wave across the field: x advances at a constant speed, y swings about the middle."""

    allocates: ClassVar[bool] = False
    fitting_q: ClassVar[float] = 0.2
    speed_ms: float = quantity(0.9, "speed along x", above=0, at_most=FASTEST_MS)
    amplitude_m: float = quantity(25.0, "swing along y", at_least=0)
    turn_s: float = quantity(100.0, "time of one wave", above=0)

    def check(self, scenario: Scenario) -> None:
        """The wave must fit the field and the period."""
        if self.turn_s < scenario.period_s:
            raise self._limit("turn_s", f"at least a period, {scenario.period_s} s")
        if self.amplitude_m > scenario.field.side_m / 2:
            raise self._limit("amplitude_m", f"at most half the side, {scenario.field.side_m / 2} m")

    @staticmethod
    def draw(m: Any, stream: Any, course: Any, track: np.ndarray) -> None:
        w = 4.0 * HALF_PI / m.turn_s
        for k in range(len(track)):
            t = k * course.period_s
            s, c = sincos(w * t)
            x, y = 0.05 * course.side_m + m.speed_ms * t, course.side_m / 2 + m.amplitude_m * s
            set_state(track[k], x, m.speed_ms, y, m.amplitude_m * w * c)
