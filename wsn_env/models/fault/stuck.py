"""Sensors that are stuck."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from wsn_env.compiled import draws
from wsn_env.compiled.elementary import HALF_PI, sincos
from wsn_env.models.fault.base import Fault, draw_period
from wsn_env.models.quantity import quantity


@dataclass(frozen=True)
class Stuck(Fault):
    """From a period on that is drawn uniformly a sensor repeats for good what it sensed in one moment.

    That is what it would have sensed then of a target at a uniform point within its sensing radius: a reading, or that
    there is none.
    """

    of_sensing: ClassVar[bool] = True
    share: float = quantity(0.2, "probability that a node has the fault", at_least=0, at_most=1)

    @staticmethod
    def strike(f: Any, stream: Any, positions: np.ndarray, condition: np.ndarray) -> None:
        for node in range(len(condition)):
            own = condition[node]
            if own.stuck_at == 0 and draws.uniform(stream, 4 * node) < f.share:
                own.stuck_at = draw_period(stream, 4 * node + 1, f.periods)
                far = f.radius_m * np.sqrt(draws.uniform(stream, 4 * node + 2))
                s, c = sincos(4.0 * HALF_PI * draws.uniform(stream, 4 * node + 3))
                own.stuck_x, own.stuck_y = positions[node, 0] + far * c, positions[node, 1] + far * s
