"""A cluster of fixed size about the prediction: the nearest nodes, or those that tell most."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from wsn_env.agents.base import ViewPolicy
from wsn_env.agents.tuned import tuned
from wsn_env.envs.expectations import REPORTS, Expectations
from wsn_env.envs.merit import order_by_information
from wsn_env.models.quantity import check_quantity, suggest
from wsn_env.models.state import Cluster
from wsn_env.scenario import Scenario
from wsn_env.scenario.constants import common_constants
from wsn_env.simulation.geometry import distances_to
from wsn_env.simulation.view import View

ORDERS = ("nearest", "information")
CANDIDATES = 12  # nearest living nodes that the information order chooses from
RADII = 0.8  # hysteresis in sensing radii where none was tuned


@dataclass(frozen=True)
class Nearest(ViewPolicy):
    """The head and the n best further members: the living nodes nearest to the prediction ("nearest3"), or first in
    the greedy order of information ("informed3"), each next one the best beside those before it.

    The head stays while the prediction is within `hysteresis_m` of it; then the best node of the order leads.
    """

    n: int = 3
    hysteresis_m: float | None = None  # None: tuned for the scenario's name, order and n; else 0.8 sensing radii
    order: str = "nearest"
    sees_lam = False

    def __post_init__(self) -> None:
        check_order(self.order)
        check_quantity("Nearest", "n", self.n, at_least=0, whole=True)
        check_quantity("Nearest", "hysteresis_m", self.hysteresis_m, at_least=0, optional=True)
        if self.hysteresis_m is None:
            table = tuned(self.scenario, self.order) or {}
            object.__setattr__(self, "hysteresis_m", table.get(str(self.n), usual_hysteresis_m(self.scenario)))

    def act(self, view: View) -> Cluster:
        """Choose, for every row."""
        return surround(view, self.scenario, self.order, self.hysteresis_m, self.n, self.n)


def surround(view: View, scenario: Scenario, order: str, hysteresis_m: Any, sizes: Any, most: int) -> Cluster:
    """A head near the prediction and its further members in an order of merit.

    Args:
        order: one of ORDERS.
        hysteresis_m: the head stays while the prediction is within it, a number or (B,) [m].
        sizes: further members, a number or (B,).
        most: no size is larger.
    """
    standing = view.head >= 0
    at = view.positions[view.rows, np.maximum(view.head, 0)][:, None]
    distance = np.where(standing, distances_to(at, view.prediction)[:, 0], np.inf)
    kept = np.where(standing & (distance <= hysteresis_m), view.head, -1)
    if order == "nearest":
        nodes = view.nearest(most + 1)[0]
    else:
        nodes = np.empty((len(kept), most + 1), np.int64)
        expected = Expectations(scenario, max(CANDIDATES, most + 1)).of(view, REPORTS)
        found = expected.nodes, expected.table
        order_by_information(0, len(kept), common_constants(scenario), view.knowledge.handle, kept >= 0, found, nodes)
    head = np.where(kept >= 0, kept, nodes[:, 0])
    others = (nodes >= 0) & (nodes != head[:, None])
    members = np.where(others & (np.cumsum(others, axis=1) <= np.reshape(sizes, (-1, 1))), nodes, -1)
    return Cluster(head, members.astype(np.int32))


def check_order(order: str) -> None:
    """Raise ValueError for an unknown order."""
    if order not in ORDERS:
        raise ValueError(f"order {order!r} is unknown: {suggest(order, ORDERS)}")


def usual_hysteresis_m(scenario: Scenario) -> float:
    """Where none was tuned [m]. A target that receives itself, or a sink for a beacon's receivers, needs no head:
    nothing is saved by staying."""
    receiver = scenario.radio.receiver
    free = receiver == "target" or (receiver == "sink" and scenario.measurement.lasting_errors)
    return 0.0 if free else RADII * scenario.radius_m


informed: Callable[..., Nearest] = partial(Nearest, order="information")
