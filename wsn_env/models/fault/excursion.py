"""A target that leaves the field and comes back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from wsn_env.models.fault.base import Fault, delay, draw_period
from wsn_env.models.motion.base import set_state
from wsn_env.models.quantity import ScenarioError, quantity

if TYPE_CHECKING:
    from wsn_env.scenario import Scenario


@dataclass(frozen=True)
class Excursion(Fault):
    """In a period of the first half the target turns to the nearest border, leaves the field, and comes back.

    The period is drawn uniformly. The target goes straight out and back to where it turned, at its mean speed, and from
    there on as it would have gone. What the horizon leaves no room for is cut off.
    """

    outside_m: float = quantity(20.0, "how far from the border it turns back", at_least=0, at_most=1e6)

    def check(self, scenario: Scenario) -> None:
        """Not where that ends the episode."""
        super().check(scenario)
        if scenario.ends_outside:
            raise ScenarioError(f"Scenario.faults = {self}: ends_outside = True ends an episode then; must be False")

    @staticmethod
    def change_track(f: Any, stream: Any, track: np.ndarray) -> None:
        last, way = len(track) - 1, 0.0
        for k in range(len(track)):
            way += np.sqrt(track[k, 1] ** 2 + track[k, 3] ** 2)
        speed = way / len(track)
        if speed <= 0.0:
            return
        turn = draw_period(stream, 0, (f.periods + 1) // 2)
        x, y = track[turn, 0], track[turn, 2]
        gap_x, gap_y = min(x, f.side_m - x), min(y, f.depth_m - y)
        along, across = 0.0, 0.0
        if gap_x < gap_y:
            along = -1.0 if 2.0 * x < f.side_m else 1.0
        else:
            across = -1.0 if 2.0 * y < f.depth_m else 1.0
        way_out = max(min(gap_x, gap_y), 0.0) + f.outside_m
        out: Any = min(np.int64(np.ceil(way_out / (speed * f.period_s))), last)
        delay(track, turn, 2 * out)
        for k in range(turn, min(turn + 2 * out, last + 1)):
            far = f.period_s * speed * min(k - turn, turn + 2 * out - k)
            pace = speed if k < turn + out else -speed
            set_state(track[k], x + along * far, along * pace, y + across * far, across * pace)
