"""Nodes that die at random."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from wsn_env.compiled import draws
from wsn_env.models.fault.base import Fault, draw_period, fail_at
from wsn_env.models.quantity import quantity


@dataclass(frozen=True)
class Failures(Fault):
    """Each node dies with this probability, in a period that is drawn uniformly. What it has left is lost.

    The network learns of it when a node that it calls does not answer.
    """

    share: float = quantity(0.2, "probability that a node has the fault", at_least=0, at_most=1)

    @staticmethod
    def strike(f: Any, stream: Any, positions: np.ndarray, condition: np.ndarray) -> None:
        for node in range(len(condition)):
            if draws.uniform(stream, 2 * node) < f.share:
                fail_at(condition[node], draw_period(stream, 2 * node + 1, f.periods))
