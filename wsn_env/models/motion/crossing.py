"""From one side of the field towards another (the default)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from wsn_env.compiled import draws
from wsn_env.models.motion.base import Motion, set_state
from wsn_env.models.motion.prediction import advance
from wsn_env.models.quantity import quantity

if TYPE_CHECKING:
    from wsn_env.scenario import Scenario

TRIES = 100
LEAST_FITTING_Q = 0.05  # m/s^2


@dataclass(frozen=True)
class Crossing(Motion):
    """Towards a uniform point of the inner field from another, in the horizon's time, but for noise (the default).

    The noise is drawn until the whole track lies in the field: a mirror at the border would turn the velocity in an
    instant, which no filter with this q can follow. Where episodes end outside the field it is drawn once.
    """

    allocates: ClassVar[bool] = False
    margin_m: float = quantity(10.0, "end points keep this distance from the border", at_least=0)
    crossing_m: float = quantity(40.0, "least distance between the end points", above=0)
    acceleration_ms2: float = quantity(
        0.025, "sd of the white acceleration on the track (q/2)", at_least=0, at_most=1000
    )

    @property
    def fitting_q(self) -> float:  # type: ignore[override]
        """Twice the track's own, for what the straight line leaves out."""
        return max(2.0 * self.acceleration_ms2, LEAST_FITTING_Q)

    @property
    def process_noise_ms2(self) -> float | None:
        """That of the settings."""
        return self.acceleration_ms2

    def check(self, scenario: Scenario) -> None:
        """The end points must find room."""
        side = scenario.field.side_m
        room = (side - 2 * self.margin_m) * 2**0.5
        if room <= 0:
            raise self._limit("margin_m", f"below half the side, {side / 2} m")
        if self.crossing_m > 0.9 * room:
            allowed = f"at most {0.9 * room:.1f} m in a field of {side} m with a margin of {self.margin_m} m"
            raise self._limit("crossing_m", allowed)

    @staticmethod
    def draw(m: Any, stream: Any, course: Any, track: np.ndarray) -> None:
        steps = len(track) - 1
        inner = course.side_m - 2.0 * m.margin_m
        draw = 0
        while True:  # the first pair of points that lie far enough apart
            x0 = m.margin_m + inner * draws.uniform(stream, draw)
            y0 = m.margin_m + inner * draws.uniform(stream, draw + 1)
            x1 = m.margin_m + inner * draws.uniform(stream, draw + 2)
            y1 = m.margin_m + inner * draws.uniform(stream, draw + 3)
            if (x1 - x0) ** 2 + (y1 - y0) ** 2 >= m.crossing_m**2:
                break
            draw += 4
        duration = steps * course.period_s
        set_state(track[0], x0, (x1 - x0) / duration, y0, (y1 - y0) / duration)
        for attempt in range(TRIES + 1):  # the first noise that keeps the target in the field; at last none
            sd = m.acceleration_ms2 if attempt < TRIES else 0.0
            inside = True
            for k in range(steps):
                ax, ay = draws.normal_pair(stream, 1_000_000 + attempt * steps + k)
                advance(track[k], course.period_s, sd * ax, sd * ay, track[k + 1])
                inside &= 0.0 <= track[k + 1, 0] <= course.side_m and 0.0 <= track[k + 1, 2] <= course.side_m
            if inside or not course.bounded:
                return
