"""Round the field."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from wsn_env.compiled.elementary import HALF_PI, sincos
from wsn_env.models.motion.base import Motion, set_state
from wsn_env.models.quantity import quantity

if TYPE_CHECKING:
    from wsn_env.scenario import Scenario


@dataclass(frozen=True)
class Circle(Motion):
    """Round the middle of the field at a constant speed (1.9 m/s by default)."""

    allocates: ClassVar[bool] = False
    fitting_q: ClassVar[float] = 0.2
    circle_m: float = quantity(30.0, "radius", above=0)
    turn_s: float = quantity(100.0, "time of one round", above=0)

    def check(self, scenario: Scenario) -> None:
        """The circle must fit the field and the period."""
        if self.turn_s < scenario.period_s:
            raise self._limit("turn_s", f"at least a period, {scenario.period_s} s")
        if self.circle_m > scenario.field.side_m / 2:
            raise self._limit("circle_m", f"at most half the side, {scenario.field.side_m / 2} m")

    @staticmethod
    def draw(m: Any, stream: Any, course: Any, track: np.ndarray) -> None:
        w = 4.0 * HALF_PI / m.turn_s
        for k in range(len(track)):
            s, c = sincos(w * k * course.period_s)
            x, y = course.side_m / 2 + m.circle_m * c, course.side_m / 2 + m.circle_m * s
            set_state(track[k], x, -m.circle_m * w * s, y, m.circle_m * w * c)
