"""Sensors with a bias."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from wsn_env.compiled import draws
from wsn_env.compiled.elementary import HALF_PI, sincos
from wsn_env.models.fault.base import Fault
from wsn_env.models.quantity import quantity


@dataclass(frozen=True)
class Biased(Fault):
    """A sensor senses the target so far beside where it is, throughout, in a direction that is drawn uniformly."""

    of_sensing: ClassVar[bool] = True
    share: float = quantity(0.2, "probability that a node has the fault", at_least=0, at_most=1)
    bias_m: float = quantity(5.0, "how far beside", at_least=0, at_most=1e6)

    @staticmethod
    def strike(f: Any, stream: Any, positions: np.ndarray, condition: np.ndarray) -> None:
        for node in range(len(condition)):
            if draws.uniform(stream, 2 * node) < f.share:
                s, c = sincos(4.0 * HALF_PI * draws.uniform(stream, 2 * node + 1))
                condition[node].off_x += f.bias_m * c
                condition[node].off_y += f.bias_m * s
