"""A cruise through a wide field."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from wsn_env.compiled import draws
from wsn_env.compiled.elementary import HALF_PI, sincos
from wsn_env.models.motion.base import FASTEST_MS, Motion, set_state
from wsn_env.models.motion.prediction import advance
from wsn_env.models.quantity import quantity

if TYPE_CHECKING:
    from wsn_env.scenario import Scenario

TRIES = 1000


@dataclass(frozen=True)
class Cruise(Motion):
    """From a uniform point of the inner field at a given speed in any direction, with white acceleration.

    Start, heading and noise are drawn until the whole track keeps its distance from the border; where episodes end
    outside the field the first draw is taken. White acceleration of density D [m^2/s^3] is, in periods of T seconds,
    one of sd sqrt(D / T): the positions lack an independent part of variance D T^3 / 12 then, which is negligible
    beside any measurement here.
    """

    allocates: ClassVar[bool] = False
    fitting_q: ClassVar[float] = 0.01
    speed_ms: float = quantity(1.0, "speed at the start", above=0, at_most=FASTEST_MS)
    acceleration_ms2: float = quantity(0.01, "sd of the white acceleration on the track", at_least=0, at_most=1000)
    inset_m: float = quantity(200.0, "starts keep this distance from the border", at_least=0)
    margin_m: float = quantity(60.0, "the whole track keeps this distance from the border", at_least=0)

    @property
    def process_noise_ms2(self) -> float | None:
        """That of the settings."""
        return self.acceleration_ms2

    def check(self, scenario: Scenario) -> None:
        """Starts must find room, and the margin must be out of reach."""
        side = scenario.field.side_m
        if self.inset_m < self.margin_m or self.inset_m >= side / 2:
            raise self._limit("inset_m", f"at least margin_m = {self.margin_m} and below half the side, {side / 2} m")
        fastest = (side - self.inset_m - self.margin_m) / (scenario.periods * scenario.period_s)
        if self.speed_ms > fastest and not scenario.ends_outside:
            allowed = f"at most {fastest:.4g} m/s, from the inner field to the margin in {scenario.periods} periods"
            raise self._limit("speed_ms", allowed)

    @staticmethod
    def draw(m: Any, stream: Any, course: Any, track: np.ndarray) -> None:
        steps = len(track) - 1
        inner, first = course.side_m - 2.0 * m.inset_m, 0
        for attempt in range(2 * TRIES):  # the first that stays inside; after TRIES without noise
            sd = m.acceleration_ms2 if attempt < TRIES else 0.0
            s, c = sincos(4.0 * HALF_PI * draws.uniform(stream, first + 2))
            x = m.inset_m + inner * draws.uniform(stream, first)
            y = m.inset_m + inner * draws.uniform(stream, first + 1)
            set_state(track[0], x, m.speed_ms * c, y, m.speed_ms * s)
            inside = True
            for k in range(steps):
                ax, ay = draws.normal_pair(stream, first // 2 + 2 + k)
                advance(track[k], course.period_s, sd * ax, sd * ay, track[k + 1])
                inside &= m.margin_m <= track[k + 1, 0] <= course.side_m - m.margin_m
                inside &= m.margin_m <= track[k + 1, 2] <= course.side_m - m.margin_m
            if inside or not course.bounded:
                return
            first += 4 + 2 * steps
