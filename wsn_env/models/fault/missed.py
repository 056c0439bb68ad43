"""Detections that are missed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from wsn_env.models.fault.base import Fault, either
from wsn_env.models.quantity import quantity


@dataclass(frozen=True)
class Missed(Fault):
    """A node senses no target in a period with this probability, beside what its detection rule leaves out.

    No filter knows of it: one that weighs silence takes it for what the rule says.
    """

    of_sensing: ClassVar[bool] = True
    probability: float = quantity(0.2, "of the fault, for a node in a period", at_least=0, at_most=1)

    @staticmethod
    def strike(f: Any, stream: Any, positions: np.ndarray, condition: np.ndarray) -> None:
        for node in range(len(condition)):
            condition[node].misses = either(condition[node].misses, f.probability)
