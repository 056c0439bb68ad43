"""Nodes of a region that die together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from wsn_env.compiled import draws
from wsn_env.models.fault.base import Fault, draw_period, fail_at
from wsn_env.models.field import squared_distance
from wsn_env.models.quantity import quantity


@dataclass(frozen=True)
class RegionalFailure(Fault):
    """In a period that is drawn uniformly all nodes die that stand within a disc about a uniform point of the field."""

    region_m: float = quantity(25.0, "radius of the disc", at_least=0, at_most=1e6)

    @staticmethod
    def strike(f: Any, stream: Any, positions: np.ndarray, condition: np.ndarray) -> None:
        x, y = f.side_m * draws.uniform(stream, 0), f.depth_m * draws.uniform(stream, 1)
        period = draw_period(stream, 2, f.periods)
        for node in range(len(condition)):
            if squared_distance(positions, node, x, y) <= f.region_m * f.region_m:
                fail_at(condition[node], period)
