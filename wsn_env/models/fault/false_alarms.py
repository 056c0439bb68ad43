"""Reports of targets that are not there: clutter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from wsn_env.models.fault.base import Fault, either
from wsn_env.models.quantity import quantity


@dataclass(frozen=True)
class FalseAlarms(Fault):
    """An awake node that does not sense the target senses one that is not there, with this probability in a period.

    That one is drawn anew in every period: the first of up to 50, at uniform points within the sensing radius, that its
    detection rule detects.
    """

    of_sensing: ClassVar[bool] = True
    probability: float = quantity(0.05, "of the fault, for a node in a period", at_least=0, at_most=1)

    @staticmethod
    def strike(f: Any, stream: Any, positions: np.ndarray, condition: np.ndarray) -> None:
        for node in range(len(condition)):
            condition[node].false_alarms = either(condition[node].false_alarms, f.probability)
