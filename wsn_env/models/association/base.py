"""What an association has to say: whether reports name their target, and how a head weighs its belief with them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from wsn_env.compiled.kernels import lean_piece
from wsn_env.models.kinds import Kind, by_kind
from wsn_env.models.measurement.base import AtHead

if TYPE_CHECKING:
    from wsn_env.scenario import Scenario


@dataclass(frozen=True)
class Association(Kind):
    """Base of all associations.

    A kind has

        weigh_reports(a, head, c, maps, scratch)
            Weigh the particles of the row `head.b` with all that its head has heard in a period, in place; of the
            residual maps and (P,) float32 as a measurement's `weigh_period` has them. `a` holds the kind's constants.
    """

    abstract: ClassVar[bool] = True
    role: ClassVar[str] = "association"
    required: ClassVar[tuple[str, ...]] = ("weigh_reports",)
    optional: ClassVar[tuple[str, ...]] = ("associate",)

    names_targets: ClassVar[bool] = True  # whether a report says of which target it is

    def room_a_node(self, targets: int) -> int:
        """How many measurements one node reports at most."""
        return 1

    def check(self, scenario: Scenario) -> None:
        """Raise ScenarioError where it does not fit the rest of the scenario."""


@by_kind
def weigh_reports(a: Any, head: AtHead, c: Any, maps: np.ndarray, scratch: Any) -> Any:
    """Weigh the particles with all that a head has heard in a period, in place."""


@lean_piece
def heard_of_target(reports: Any, b: int) -> int:
    """How many reports of its target a row has; where they do not say it, 1 or 0: whether any node has probably
    measured it, whichever of its measurements that is."""
    if reports.share.shape[1] == 0:
        return reports.count[b]
    missed, own = 1.0, 0.0
    for k in range(reports.count[b]):
        if k > 0 and reports.node[b, k] != reports.node[b, k - 1]:
            missed, own = missed * (1.0 - own), 0.0
        own = min(own + reports.share[b, k], 1.0)
    return 1 if missed * (1.0 - own) <= 0.5 else 0


@lean_piece
def expected_reports(reports: Any, b: int) -> float:
    """How many reports of its target a row has; where they do not say it, the expected number."""
    if reports.share.shape[1] == 0:
        return float(reports.count[b])
    total = 0.0
    for k in range(reports.count[b]):
        total += reports.share[b, k]
    return total


@lean_piece
def nodes_heard(reports: Any, b: int) -> int:
    """How many nodes a row's reports are of; a node's measurements stand together."""
    count = 0
    for k in range(reports.count[b]):
        count += k == 0 or reports.node[b, k] != reports.node[b, k - 1]
    return count


@lean_piece
def is_of_target(reports: Any, b: int, k: int) -> bool:
    """Whether a row's report number k is of its target, or probably so where it does not say it."""
    return reports.share.shape[1] == 0 or reports.share[b, k] >= 0.5
