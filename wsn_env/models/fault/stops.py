"""A target that stops."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from wsn_env.models.fault.base import Fault, delay, draw_period
from wsn_env.models.motion.base import set_state
from wsn_env.models.quantity import quantity


@dataclass(frozen=True)
class Stops(Fault):
    """The target stops at once, stands, and goes on as it would have gone; in periods that are drawn uniformly.

    What the horizon leaves no room for is cut off.
    """

    stops: int = quantity(1, "how often", at_least=0, at_most=1000, whole=True)
    stop_s: float = quantity(20.0, "how long it stands", at_least=0, at_most=1e7)

    @staticmethod
    def change_track(f: Any, stream: Any, track: np.ndarray) -> None:
        standing: Any = min(np.int64(f.stop_s / f.period_s + 0.5), len(track))
        last = len(track) - 1
        for stop in range(f.stops):
            first = draw_period(stream, stop, f.periods)
            delay(track, first, standing)
            for k in range(first, min(first + standing, last + 1)):
                set_state(track[k], track[first - 1, 0], 0.0, track[first - 1, 2], 0.0)
