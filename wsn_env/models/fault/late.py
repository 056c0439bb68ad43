"""Reports that come late."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from wsn_env.models.fault.base import Fault, either
from wsn_env.models.quantity import quantity


@dataclass(frozen=True)
class Late(Fault):
    """A node sends its report a period late with this probability, to whoever leads then, in or out of the cluster.

    Whoever gets it takes it for one of the present. What is late is dropped where the node has a newer one to send. A
    head's own report is never late.
    """

    probability: float = quantity(0.2, "of the fault, for a node in a period", at_least=0, at_most=1)

    @staticmethod
    def strike(f: Any, stream: Any, positions: np.ndarray, condition: np.ndarray) -> None:
        for node in range(len(condition)):
            condition[node].late = either(condition[node].late, f.probability)
