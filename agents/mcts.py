"""A policy that looks ahead along a tree of its choices: Monte Carlo tree search in worlds drawn from the belief."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from wsn_env.agents.imagined import draw_worlds, place_nodes, take_rows
from wsn_env.agents.planner import ROWS, Planner
from wsn_env.envs.actions import GROUP, MENU_ENTRIES
from wsn_env.envs.rewards import belief_cost
from wsn_env.evaluation.policies import Policy
from wsn_env.models.quantity import check_quantity
from wsn_env.models.state import Cluster, State
from wsn_env.simulation.view import View

RULE = -1  # what the rule would do, among the choices


@dataclass
class Node:
    """Where the same choices have led."""

    untried: list[int]  # choices, the most promising last
    visits: int = 0
    cost: float = 0.0  # sum over the visits of the discounted cost to go [m]
    children: dict[int, Node] = field(default_factory=dict)


@dataclass(frozen=True)
class Mcts(Planner):
    """UCT with progressive widening (Kocsis & Szepesvari, 2006; Coulom, 2007), open loop: a node of the tree is what
    has been chosen so far, whatever was reported (Perez Liebana et al., 2015).

    A simulation plays `worlds` drawn from the belief, the same ones each time: choices along the tree as far as it
    goes, a new one at its edge, then the rule to the horizon. A node visited N times has up to `width` N^`widening`
    choices, the rule's own first, then those of the menu whose size is nearest to it; of these that is taken whose mean
    cost, less `exploration` standard deviations times sqrt(ln N / n), is least. In the end it is the choice of least
    mean cost. Filter, rule and costs are the planner's, whose `doubt` does not count.
    """

    worlds: int = 48
    simulations: int = 48
    width: float = 1.5
    widening: float = 0.5
    exploration: float = 0.5

    def __post_init__(self) -> None:
        super().__post_init__()
        check_quantity("Mcts", "worlds", self.worlds, at_least=4, at_most=ROWS, whole=True)
        check_quantity("Mcts", "simulations", self.simulations, at_least=1, whole=True)
        check_quantity("Mcts", "width", self.width, at_least=1)
        check_quantity("Mcts", "widening", self.widening, at_least=0, at_most=1)
        check_quantity("Mcts", "exploration", self.exploration, at_least=0)

    def _plan(self, view: View, scratch: State) -> tuple[int, np.ndarray]:
        """The head and the members for a view of one row."""
        rule, lam = self.rule_for(view.lam[0]), float(view.lam[0])
        size = int((rule.act(view).members[0] >= 0).sum())
        entries = sorted(range(1, MENU_ENTRIES), key=lambda entry: abs((entry - 1) % GROUP - size))
        order = [*reversed(entries), 0, RULE]
        masks = self._menu.masks(view)[0]
        root = Node([entry for entry in order if entry == RULE or masks[entry]])
        place_nodes(scratch, view)
        totals: list[float] = []
        for _ in range(self.simulations):
            state = take_rows(scratch, slice(self.worlds))
            draw_worlds(state, view, self._world, 0, self.worlds)
            spread = float(np.std(totals)) if len(totals) > 1 else 0.0
            totals.append(self._simulate(root, order, state, rule, lam, spread))
        best = min(root.children, key=lambda choice: root.children[choice].cost / root.children[choice].visits)
        cluster = self._cluster(best, view, rule)
        return int(cluster.head[0]), cluster.members[0]

    def _simulate(self, root: Node, order: list[int], state: State, rule: Policy, lam: float, spread: float) -> float:
        """Play worlds once along the tree, which grows by a node; the discounted cost [m]."""
        path, costs, node = [root], np.zeros(self.horizon), root
        grows = True
        for period in range(self.horizon):
            choice = RULE
            if grows:
                choice, node, grows = self._descend(node, order, spread)
                path.append(node)
            cluster = self._cluster(choice, View(state.knowledge), rule)
            state, outcome = self._world.step(state, cluster, donate=True)
            cost = belief_cost(outcome.row, self.scenario.counted_m) + lam * outcome.energy_mj
            costs[period] = self.discount**period * cost.mean()
        to_go = costs[::-1].cumsum()[::-1]
        for depth, visited in enumerate(path):
            visited.visits += 1
            visited.cost += to_go[max(depth - 1, 0)]  # its own choice's, too
        return float(to_go[0])

    def _descend(self, node: Node, order: list[int], spread: float) -> tuple[int, Node, bool]:
        """A choice at a node, where it leads, and whether it has led there before."""
        if node.untried and len(node.children) < self.width * max(node.visits, 1) ** self.widening:
            choice = node.untried.pop()
            node.children[choice] = Node(list(order))
            return choice, node.children[choice], False

        def bound(choice: int) -> float:
            child = node.children[choice]
            doubt = spread * math.sqrt(math.log(node.visits) / child.visits)
            return child.cost / child.visits - self.exploration * doubt

        choice = min(node.children, key=bound)
        return choice, node.children[choice], True

    def _cluster(self, choice: int, view: View, rule: Policy) -> Cluster:
        """What a choice means in every row."""
        return rule.act(view) if choice == RULE else self._menu.cluster(np.full(len(view.row), choice), view)
