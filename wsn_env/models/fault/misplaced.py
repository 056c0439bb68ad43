"""Nodes that stand elsewhere than the network believes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from wsn_env.compiled import draws
from wsn_env.models.fault.base import Fault
from wsn_env.models.quantity import quantity


@dataclass(frozen=True)
class Misplaced(Fault):
    """Every node stands off its known position by a normal error, so that it senses the target off by as much.

    Prices of packets are by the known positions.
    """

    of_sensing: ClassVar[bool] = True
    position_sd_m: float = quantity(1.0, "sd of the error in x and in y", at_least=0, at_most=1e6)

    @staticmethod
    def strike(f: Any, stream: Any, positions: np.ndarray, condition: np.ndarray) -> None:
        for node in range(len(condition)):
            ex, ey = draws.normal_pair(stream, node)
            condition[node].off_x -= f.position_sd_m * ex
            condition[node].off_y -= f.position_sd_m * ey
