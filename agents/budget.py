"""Any policy that takes lam, at a price of energy of the network's own: what is left has to last."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from wsn_env.agents.base import ViewPolicy
from wsn_env.envs.scarcity import MOST, energy_prices
from wsn_env.evaluation.policies import Policy, make_policy
from wsn_env.evaluation.progress import Progress
from wsn_env.evaluation.rollout import rollout
from wsn_env.models.quantity import check_quantity, short
from wsn_env.models.state import Cluster
from wsn_env.scenario import Scenario
from wsn_env.simulation.view import View
from wsn_env.simulation.world import World

PRICES = 8.0, 11.0, 16.0, 22.0  # m/mJ, that `find_price` tries
STEERINGS = 0.7, 1.0, 1.4, 2.0


@dataclass(frozen=True)
class Budget(ViewPolicy):
    """A rule that trades error for energy, at a price that steers what is spent where the target is.

        lam = price * supply^-steering   [m/mJ]

    with `supply` the energy left about the predicted position over what a typical schedule would spend while the target
    is about there in the time left: nodes that it seldom comes to are cheap, and a place that is worn is dear. It is a
    proportional controller, on the logarithmic scale, of the dual variables of "spend no more than there is", one for
    every place. With steering = 0 the price is fixed. The row's own lam does not count.
    """

    rule: str = "greedy"  # a policy's name, or the path of a learned one
    price: float = 16.0  # m/mJ, where what is left is just what is typical
    steering: float = 1.4
    sees_lam = False

    @property
    def fits(self) -> bool:
        """Where batteries have to last."""
        return self.scenario.scarce_energy

    def __post_init__(self) -> None:
        check_quantity("Budget", "price", self.price, above=0, at_most=MOST)
        check_quantity("Budget", "steering", self.steering, at_least=0, at_most=100)
        _ = self._inner

    @cached_property
    def _inner(self) -> Policy:
        try:
            return make_policy(self.rule, self.scenario)
        except ValueError as problem:
            raise ValueError(f"Budget.rule = {short(repr(self.rule))}: {problem}") from problem.__cause__

    @cached_property
    def _scarce(self) -> Scenario:
        return self.scenario.override(scarce_energy=True)

    def act(self, view: View) -> Cluster:
        """What the rule does at the price."""
        return self._inner.act(view.at_lam(self.prices(view)))

    def prices(self, view: View) -> np.ndarray:
        """(B,) of energy now [m/mJ]."""
        return energy_prices(view, self._scarce, self.price, self.steering)


def find_price(rule: str, scenario: Scenario, seeds: Sequence[int], report: Progress) -> tuple[float, float]:
    """Price and steering under which a rule's errors are least, of a few.

    Args:
        rule: a policy's name, or the path of a learned one.
        seeds: of episodes to try them in, apart from those that anything is evaluated on.
    """
    world, errors = World(scenario.override(lam=0.0)), {}
    tried = list(product(PRICES, STEERINGS))
    for number, (price, steering) in enumerate(tried):
        report(number, len(tried), f"price {price:g}, steering {steering:g}")
        policy = Budget(world.scenario, rule, price, steering)
        rows = rollout(policy, world, seeds)
        # An episode counts by ratios: where batteries are drawn the poorest have the largest errors.
        errors[price, steering] = np.mean(np.log([row["error_m"] for row in rows]))
    return min(errors, key=lambda each: errors[each])
