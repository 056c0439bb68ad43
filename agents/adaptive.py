"""A cluster about the prediction that grows when the belief is wide and shrinks when it is sharp."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from wsn_env.agents.base import ViewPolicy
from wsn_env.agents.nearest import check_order, surround, usual_hysteresis_m
from wsn_env.agents.tuned import nearest_lam, tuned
from wsn_env.models.quantity import check_quantity
from wsn_env.models.state import Cluster
from wsn_env.simulation.view import View


class Switch(NamedTuple):
    """How the cluster's size goes with the belief's spread, at one lam."""

    lam: float  # m/mJ
    few: int  # further members while the spread is at most spread_m
    many: int  # above it
    spread_m: float
    hysteresis_m: float  # the head stays while the prediction is within it


@dataclass(frozen=True)
class Adaptive(ViewPolicy):
    """The head and few or many further members, by the spread of the prediction (eq. 16 of Xiang & Guo, 2013): nearest
    first, or first in the greedy order of information.

    Each row takes the switch whose lam is nearest to its own on the logarithmic scale.
    """

    order: str = "nearest"
    switches: Sequence[Sequence[float]] | None = None  # None: tuned for the scenario's name and order; else a usual one

    def __post_init__(self) -> None:
        check_order(self.order)
        switches: Sequence[Any] | None = self.switches
        if switches is None:
            switches = tuned(self.scenario, RULES[self.order])
        if switches is None:
            switches = [
                (self.scenario.lam_range[0], 1, 4, 0.1 * self.scenario.radius_m, usual_hysteresis_m(self.scenario))
            ]
        switches = tuple(sorted(Switch(*switch) for switch in switches))
        check_switches(switches)
        object.__setattr__(self, "switches", switches)

    def act(self, view: View) -> Cluster:
        """Choose, for every row."""
        table = np.array(self.switches)
        _, few, many, spread_m, hysteresis_m = table[nearest_lam(table[:, 0], view.lam)].T
        sizes = np.where(view.spread_m > spread_m, many, few).astype(int)
        most = int(table[:, Switch._fields.index("many")].max())
        return surround(view, self.scenario, self.order, hysteresis_m, sizes, most)


def check_switches(switches: Sequence[Switch]) -> None:
    """Raise ScenarioError where a switch is not what it may be."""
    check_quantity("Adaptive", "len(switches)", len(switches), at_least=1)
    for switch in switches:
        for name in ("lam", "spread_m", "hysteresis_m"):
            check_quantity("Switch", name, getattr(switch, name), at_least=0)
        check_quantity("Switch", "few", switch.few, at_least=0, whole=True)
        check_quantity("Switch", "many", switch.many, at_least=switch.few, whole=True)


RULES = {"nearest": "adaptive", "information": "adaptive_informed"}
adaptive_informed: Callable[..., Adaptive] = partial(Adaptive, order="information")
