"""Random waypoints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from wsn_env.compiled import draws
from wsn_env.models.motion.base import FASTEST_MS, Motion, set_state
from wsn_env.models.quantity import quantity

if TYPE_CHECKING:
    from wsn_env.scenario import Scenario


@dataclass(frozen=True)
class Waypoint(Motion):
    """Random waypoint: straight at a constant speed to a uniform point of the field, then to the next."""

    allocates: ClassVar[bool] = False
    fitting_q: ClassVar[float] = 0.2
    speed_ms: float = quantity(1.0, "speed", above=0, at_most=FASTEST_MS)

    def check(self, scenario: Scenario) -> None:
        """At most a side in a period."""
        fastest = scenario.field.side_m / scenario.period_s
        if self.speed_ms > fastest:
            raise self._limit("speed_ms", f"at most {fastest} m/s, a side of the field in a period")

    @staticmethod
    def draw(m: Any, stream: Any, course: Any, track: np.ndarray) -> None:
        x = course.side_m * draws.uniform(stream, 0)
        y = course.side_m * draws.uniform(stream, 1)
        goal_x = course.side_m * draws.uniform(stream, 2)
        goal_y = course.side_m * draws.uniform(stream, 3)
        draw = 4
        for k in range(len(track)):
            if k > 0:
                left = m.speed_ms * course.period_s
                while True:
                    distance = np.sqrt((goal_x - x) ** 2 + (goal_y - y) ** 2)
                    if distance > left:
                        x += (goal_x - x) * left / distance
                        y += (goal_y - y) * left / distance
                        break
                    left -= distance
                    x, y = goal_x, goal_y
                    goal_x = course.side_m * draws.uniform(stream, draw)
                    goal_y = course.side_m * draws.uniform(stream, draw + 1)
                    draw += 2
            distance = np.sqrt((goal_x - x) ** 2 + (goal_y - y) ** 2)
            scale = m.speed_ms / distance if distance > 0.0 else 0.0
            set_state(track[k], x, scale * (goal_x - x), y, scale * (goal_y - y))
