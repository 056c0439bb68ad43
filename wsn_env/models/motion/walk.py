"""A walk in a room."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from wsn_env.compiled import draws
from wsn_env.models.motion.base import FASTEST_MS, Motion, set_state
from wsn_env.models.quantity import ScenarioError, quantity

if TYPE_CHECKING:
    from wsn_env.scenario import Scenario

MOST_LEGS = 100  # in a period: across what the margin leaves of the room


@dataclass(frozen=True)
class Walk(Motion):
    """A walk in a room: straight to a uniform point of it, then to the next, each leg at a speed of its own."""

    allocates: ClassVar[bool] = False
    fitting_q: ClassVar[float] = 0.2
    slowest_ms: float = quantity(0.14, "least speed of a leg", above=0, at_most=FASTEST_MS)
    fastest_ms: float = quantity(0.73, "greatest speed of a leg", above=0, at_most=FASTEST_MS)
    margin_m: float = quantity(1.0, "goals keep this distance from the walls", at_least=0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.slowest_ms > self.fastest_ms:
            raise ScenarioError(f"Walk.slowest_ms = {self.slowest_ms}: must be at most fastest_ms = {self.fastest_ms}")

    def check(self, scenario: Scenario) -> None:
        """The goals must find room, and no leg may leave it in a period."""
        room = min(scenario.field.room_m)
        if self.margin_m >= room / 2:
            raise self._limit("margin_m", f"below half the room, {room / 2} m")
        fastest = min(room, MOST_LEGS * (room - 2 * self.margin_m)) / scenario.period_s
        if self.fastest_ms > fastest:
            raise self._limit("fastest_ms", f"at most {fastest:.4g} m/s with a margin of {self.margin_m} m")

    @staticmethod
    def draw(m: Any, stream: Any, course: Any, track: np.ndarray) -> None:
        width, depth = course.side_m - 2.0 * m.margin_m, course.depth_m - 2.0 * m.margin_m
        x = m.margin_m + width * draws.uniform(stream, 0)
        y = m.margin_m + depth * draws.uniform(stream, 1)
        goal_x, goal_y, speed, draw = x, y, 1.0, 2
        for k in range(len(track)):
            left = course.period_s if k > 0 else 0.0  # s
            while True:
                distance = np.sqrt((goal_x - x) ** 2 + (goal_y - y) ** 2)
                if distance > left * speed:
                    x += (goal_x - x) * left * speed / distance
                    y += (goal_y - y) * left * speed / distance
                    break
                left -= distance / speed
                x, y = goal_x, goal_y
                goal_x = m.margin_m + width * draws.uniform(stream, draw)
                goal_y = m.margin_m + depth * draws.uniform(stream, draw + 1)
                speed = m.slowest_ms + (m.fastest_ms - m.slowest_ms) * draws.uniform(stream, draw + 2)
                draw += 3
            distance = np.sqrt((goal_x - x) ** 2 + (goal_y - y) ** 2)
            scale = speed / distance if distance > 0.0 else 0.0
            set_state(track[k], x, scale * (goal_x - x), y, scale * (goal_y - y))
