"""Random turns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from wsn_env.compiled import draws
from wsn_env.compiled.elementary import HALF_PI, sincos
from wsn_env.models.motion.base import FASTEST_MS, Motion, heading_of, reflect
from wsn_env.models.motion.prediction import advance
from wsn_env.models.quantity import quantity

if TYPE_CHECKING:
    from wsn_env.scenario import Scenario


@dataclass(frozen=True)
class Turns(Motion):
    """Random turns: constant speed, now and then a new heading within a quarter turn; reflected at the border."""

    fitting_q: ClassVar[float] = 0.2
    speed_ms: float = quantity(1.0, "speed", above=0, at_most=FASTEST_MS)
    turn_probability: float = quantity(0.1, "probability of a turn in a period", at_least=0, at_most=1)

    def check(self, scenario: Scenario) -> None:
        """At most a side in a period."""
        fastest = scenario.field.side_m / scenario.period_s
        if self.speed_ms > fastest:
            raise self._limit("speed_ms", f"at most {fastest} m/s, a side of the field in a period")

    @staticmethod
    def draw(m: Any, stream: Any, course: Any, track: np.ndarray) -> None:
        track[0, 0] = course.side_m * (0.1 + 0.8 * draws.uniform(stream, 0))
        track[0, 2] = course.side_m * (0.1 + 0.8 * draws.uniform(stream, 1))
        heading = 4.0 * HALF_PI * draws.uniform(stream, 2)
        for k in range(len(track)):
            if k > 0:
                if draws.uniform(stream, 2 * k + 1) < m.turn_probability:
                    heading += 2.0 * HALF_PI * (draws.uniform(stream, 2 * k + 2) - 0.5)
                advance(track[k - 1], course.period_s, 0.0, 0.0, track[k])
            s, c = sincos(heading)
            if course.bounded:
                if track[k, 0] < 0.0 or track[k, 0] > course.side_m:  # the mirror turns the heading too
                    c = -c
                if track[k, 2] < 0.0 or track[k, 2] > course.side_m:
                    s = -s
                reflect(track[k], 0, course.side_m)
                reflect(track[k], 2, course.side_m)
                heading = heading_of(s, c)
            track[k, 1] = m.speed_ms * c
            track[k, 3] = m.speed_ms * s
