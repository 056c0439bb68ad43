"""Any policy that takes lam, at a price of energy of the network's own: what is left has to last."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from wsn_env.agents.base import ViewPolicy
from wsn_env.compiled.elementary import exp, log
from wsn_env.compiled.kernels import kernel
from wsn_env.envs.features import ENERGY_FEATURES, describe_energy
from wsn_env.evaluation.policies import Policy, make_policy
from wsn_env.models.quantity import check_quantity, short
from wsn_env.models.state import Cluster, knowledge_at
from wsn_env.scenario.constants import common_constants
from wsn_env.simulation.view import View

LEAST, MOST = 1e-3, 1e3  # prices [m/mJ]
LEAST_SHARE = 0.01
SUPPLY, LEFT, AHEAD = (ENERGY_FEATURES.index(name) for name in ("supply", "energy_left", "energy_ahead"))


@dataclass(frozen=True)
class Budget(ViewPolicy):
    """A rule that trades error for energy, at a price that steers what is spent.

        lam = price * supply^-steering * (share ahead / share)^-nearby   [m/mJ]

    with `supply` the energy left over what the scenario calls typical for the time left, and the share of the batteries
    about the target's way over that of all of them. It is a proportional controller of the dual variable of "spend no
    more than there is" on the logarithmic scale: what has been saved makes the rest cheaper. With steering = nearby = 0
    the price is fixed. The row's own lam does not count.
    """

    rule: str = "greedy"  # a policy's name, or the path of a learned one
    price: float = 16.0  # m/mJ, where what is left is just what is typical
    steering: float = 0.5
    nearby: float = 0.0
    sees_lam = False

    def __post_init__(self) -> None:
        check_quantity("Budget", "price", self.price, above=0, at_most=MOST)
        for name in ("steering", "nearby"):
            check_quantity("Budget", name, getattr(self, name), at_least=0, at_most=100)
        _ = self._inner

    @cached_property
    def _inner(self) -> Policy:
        try:
            return make_policy(self.rule, self.scenario)
        except ValueError as problem:
            raise ValueError(f"Budget.rule = {short(repr(self.rule))}: {problem}") from problem.__cause__

    def act(self, view: View) -> Cluster:
        """What the rule does at the price."""
        return self._inner.act(view.at_lam(self.prices(view)))

    def prices(self, view: View) -> np.ndarray:
        """(B,) of energy now [m/mJ]."""
        prices, terms = np.empty(len(view.row)), (self.price, self.steering, self.nearby)
        _fill_prices(0, len(prices), common_constants(self.scenario), view.knowledge.handle, terms, prices)
        return prices


@kernel
def _fill_prices(start: int, stop: int, cs: Any, handle: np.ndarray, terms: Any, prices: np.ndarray) -> None:
    """(B,) prices.

    Args:
        cs: the scenario's common constants.
        handle: of what the network knows (Knowledge).
        terms: price, steering, nearby.
    """
    known, told = knowledge_at(handle), np.empty(len(ENERGY_FEATURES))
    price, steering, nearby = terms
    for b in range(start, stop):
        describe_energy(known, b, cs[0], told)
        ahead = log(max(told[AHEAD], LEAST_SHARE)) - log(max(told[LEFT], LEAST_SHARE))
        found = log(price) - steering * 4.0 * told[SUPPLY] - nearby * ahead
        prices[b] = exp(min(max(found, log(LEAST)), log(MOST)))
