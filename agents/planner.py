"""A policy that looks ahead: it plays its choices in worlds drawn from the belief, and takes what comes cheapest."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from wsn_env.agents.base import ViewPolicy
from wsn_env.agents.imagined import draw_worlds, imagined_world, place_nodes, take_rows
from wsn_env.agents.nearest import Nearest
from wsn_env.envs.actions import MENU_MEMBERS, MenuAction
from wsn_env.envs.rewards import belief_cost
from wsn_env.evaluation.policies import Policy
from wsn_env.evaluation.rollout import rollout
from wsn_env.models.measurement.base import Order
from wsn_env.models.quantity import check_quantity
from wsn_env.models.state import Cluster, State
from wsn_env.simulation.view import View
from wsn_env.simulation.world import World

ROWS = 320  # worlds played side by side: some 16 for each choice at first
CANDIDATES = 12
REHEARSALS = 20  # episodes, of training seeds
PARTICLES = 200  # where the imagined head needs any


class Choices(NamedTuple):
    """Clusters to choose from, the rule's own first."""

    heads: np.ndarray  # (C,)
    members: np.ndarray  # (C, M)


@dataclass(frozen=True)
class Planner(ViewPolicy):
    """A rollout algorithm (Bertsekas, Rollout, Policy Iteration, and Distributed Reinforcement Learning, 2020, ch. 2).

    Every choice of the menu, and the rule's own, is played for a period in worlds drawn from the belief; then the rule
    goes on to the horizon. All choices meet the same worlds. Those that are dearer than the cheapest by more than
    `doubt` standard errors drop out, round by round. The rule's own choice is taken unless it has dropped out; then
    the cheapest. So the planner does better than its rule, but for chance and for what lies beyond the horizon.

    A period costs the error that the imagined head believes in (the true one where that is wrong beyond doubt; what is
    believed varies less) plus lam times the energy. `World.step` plays it, with a Gaussian filter at the head, or with
    a particle filter where nodes report one bit.
    """

    horizon: int = 8  # periods
    worlds: int = 96  # for each choice that stays in doubt
    doubt: float = 1.0  # standard errors
    discount: float = 1.0  # a period
    particles: int | None = None  # of the imagined filter; 0: it is Gaussian; None: 0 where it can read the reports
    rule: Policy | None = None  # None: the fixed size, see `Nearest`, that rehearsals found best for the row's lam
    order: Order | None = None  # of merit; None: nearest for positions and bits, information for strengths

    def __post_init__(self) -> None:
        if self.scenario.measurement.lasting_errors:
            kind, name = type(self.scenario.measurement).__name__, type(self).__name__.lower()
            why = f"{name} cannot draw errors that last; allowed are others"
            raise ValueError(f"Scenario.measurement = {kind}: {why}")
        check_quantity("Planner", "horizon", self.horizon, at_least=1, whole=True)
        check_quantity("Planner", "worlds", self.worlds, at_least=4, whole=True)
        check_quantity("Planner", "doubt", self.doubt, at_least=0)
        check_quantity("Planner", "discount", self.discount, above=0, at_most=1)
        check_quantity("Planner", "particles", self.particles, at_least=0, whole=True, optional=True)

    @cached_property
    def _order(self) -> Order:
        return self.order or ("information" if self.scenario.measurement.order == "information" else "nearest")

    @cached_property
    def _menu(self) -> MenuAction:
        return MenuAction(self.scenario, self._order, CANDIDATES)

    @cached_property
    def _world(self) -> World:
        usual = PARTICLES if self.scenario.measurement.reports_state else 0
        return imagined_world(self.scenario, self.horizon, usual if self.particles is None else self.particles)

    @cached_property
    def _rehearsals(self) -> tuple[list[Nearest], np.ndarray, np.ndarray]:
        """Fixed sizes with their mean error [m] and energy [mJ] in a period."""
        world = World(self.scenario.override(lam=0.0), threads=1)
        rules = [Nearest(self.scenario, n, order=self._order) for n in range(MENU_MEMBERS + 1)]
        played = [rollout(rule, world, range(REHEARSALS)) for rule in rules]
        means = [[np.mean([row[name] for row in rows]) for rows in played] for name in ("error_m", "energy_mj")]
        return rules, np.array(means[0]), np.array(means[1])

    def rule_for(self, lam: float) -> Policy:
        """What is played after the choice."""
        if self.rule is not None:
            return self.rule
        rules, errors_m, energies_mj = self._rehearsals
        return rules[int((errors_m + lam * energies_mj).argmin())]

    def act(self, view: View) -> Cluster:
        """Plan for every row, one after the other."""
        scratch = self._world.allocate(ROWS)
        chosen = [self._plan(take_rows(view, slice(row, row + 1)), scratch) for row in range(len(view.row))]
        width = max((len(members) for _, members in chosen), default=0)
        members = np.full((len(chosen), width), -1, np.int32)
        for row, (_, own) in enumerate(chosen):
            members[row, : len(own)] = own
        return Cluster(np.array([head for head, _ in chosen], np.int64), members)

    def _plan(self, view: View, scratch: State) -> tuple[int, np.ndarray]:
        """The head and the members for a view of one row."""
        rule, lam = self.rule_for(view.lam[0]), view.lam[0]
        choices = self._list_choices(view, rule)
        left, costs = np.arange(len(choices.heads)), np.empty((len(choices.heads), 0))
        place_nodes(scratch, view)
        while len(left) > 1 and costs.shape[1] < self.worlds:
            done = costs.shape[1]
            count = 2 * min((self.worlds - done + 1) // 2, len(scratch.key) // (2 * len(left)))
            state = take_rows(scratch, slice(len(left) * count))
            draw_worlds(state, view, self._world, done, count)
            first = Cluster(choices.heads[left].repeat(count), choices.members[left].repeat(count, axis=0))
            new = self._discounted_costs(state, first, rule, lam).reshape(len(left), count)
            costs = np.concatenate([costs, new], axis=1)
            stays = _near_cheapest(costs, self.doubt)
            left, costs = left[stays], costs[stays]
        best = 0 if left[0] == 0 else left[costs.mean(axis=1).argmin()]
        return choices.heads[best], choices.members[best]

    def _list_choices(self, view: View, rule: Policy) -> Choices:
        """The rule's own and those of the menu, each once."""
        own = rule.act(view)
        entries = np.flatnonzero(self._menu.masks(view)[0])
        menu = self._menu.cluster(entries, take_rows(view, np.zeros(len(entries), int)))
        width = max(own.members.shape[1], menu.members.shape[1])
        members = np.full((1 + len(entries), width), -1, np.int32)
        members[:1, : own.members.shape[1]], members[1:, : menu.members.shape[1]] = own.members, menu.members
        heads = np.concatenate([own.head, menu.head])
        named = [(head, frozenset(row) - {-1, head}) for head, row in zip(heads.tolist(), members.tolist())]
        first = [named.index(name) for name in dict.fromkeys(named)]
        return Choices(heads[first], members[first])

    def _discounted_costs(self, state: State, choice: Cluster, rule: Policy, lam: float) -> np.ndarray:
        """(B,) discounted costs of the choice and the rule after it [m]; the state's arrays are used up."""
        costs, weight = np.zeros(len(state.key)), 1.0
        for period in range(self.horizon):
            cluster = choice if period == 0 else rule.act(View(state.knowledge))
            state, outcome = self._world.step(state, cluster, donate=True)
            costs += weight * (belief_cost(outcome.row, self.scenario.counted_m) + lam * outcome.energy_mj)
            weight *= self.discount
        return costs


def _near_cheapest(costs: np.ndarray, doubt: float) -> np.ndarray:
    """(C,) bool: which choices are not plainly dearer than the cheapest.

    Args:
        costs: (C, W) in common worlds, 2i and 2i + 1 a pair on both sides of the belief's mean.
        doubt: in standard errors of the mean difference.
    """
    pairs = 0.5 * (costs[:, ::2] + costs[:, 1::2])
    differences = pairs - pairs[pairs.mean(axis=1).argmin()]
    errors = differences.std(axis=1) / max(pairs.shape[1] - 1, 1) ** 0.5
    return differences.mean(axis=1) <= doubt * errors
