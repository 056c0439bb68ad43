"""Bursts of losses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from wsn_env.compiled import draws
from wsn_env.models.fault.base import Fault
from wsn_env.models.quantity import quantity


@dataclass(frozen=True)
class Bursts(Fault):
    """Each node's link is good or bad, a Markov chain from period to period (Gilbert, 1960; Elliott, 1963).

    Over a good link a try of a report arrives as the radio says (`packet_success`), over a bad one with `bad_success`,
    in all tries of a period alike. An episode begins with the chain's stationary distribution, bad with probability
    to_bad / (to_bad + to_good). Of two such faults the first counts.
    """

    to_bad: float = quantity(0.05, "probability, in a period, that a good link turns bad", above=0, at_most=1)
    to_good: float = quantity(0.2, "probability that a bad one turns good", above=0, at_most=1)
    bad_success: float = quantity(0.0, "probability that one try arrives over a bad link", at_least=0, at_most=1)

    @staticmethod
    def strike(f: Any, stream: Any, positions: np.ndarray, condition: np.ndarray) -> None:
        for node in range(len(condition)):
            own = condition[node]
            if own.to_bad > 0.0:
                continue
            own.to_bad, own.to_good, own.bad_success = f.to_bad, f.to_good, f.bad_success
            own.bad = draws.uniform(stream, node) * (f.to_bad + f.to_good) < f.to_bad
