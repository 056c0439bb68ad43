"""Action spaces and their translation into a Cluster. Each takes (B, ...) actions and a View, and refuses with a
ValueError what is not in its space: NumPy's and Gymnasium's own checks would take longer than the translation."""

from __future__ import annotations

from typing import Any, Literal, Protocol

import numpy as np
from gymnasium import spaces

from wsn_env.compiled.kernels import Pinned, kernel, lean_piece, over_rows, threads_for_short
from wsn_env.envs.expectations import PLACES, REPORTS, Expectations, outlook_of
from wsn_env.envs.merit import KEEP, ORDERS, RANKED, rank_row
from wsn_env.models.measurement.base import Order
from wsn_env.models.quantity import short, suggest
from wsn_env.models.state import KEEP_CLUSTER, Cluster, knowledge_at
from wsn_env.scenario import Scenario
from wsn_env.scenario.constants import common_constants
from wsn_env.simulation.view import View

ActionName = Literal["menu", "subset", "radius", "scores", "nodes", "cluster"]

MENU_MEMBERS = 8  # the menu's largest number of further members
GROUP = MENU_MEMBERS + 1  # entries for each rule of who leads: KEEP, BEST, AHEAD
MENU_ENTRIES = 1 + 3 * GROUP


class Action(Protocol):
    """What every one has; each space is of one environment."""

    space: Any  # the class's own, of Gymnasium

    def cluster(self, action: Any, view: View) -> Cluster:
        """The cluster that the actions (B, ...) name, as `World.advance` takes it."""
        ...

    def masks(self, view: View) -> np.ndarray:
        """(B, n) bool: which entries of each component make sense now."""
        ...


class MenuAction:
    """Discrete(28): 0 keeps the cluster as it is. 1 + n keeps the head, 10 + n moves it to the best node, 19 + n to the
    node nearest to a point 0.3 sensing radii ahead of the prediction; each with the n best further members, n = 0..8.
    Without a living head, keeping it means moving it to the best."""

    def __init__(self, scenario: Scenario, order: Order, candidates: int, threads: int = 1) -> None:
        if candidates <= MENU_MEMBERS:
            raise ValueError(f"candidates = {candidates}: the menu must have at least {MENU_MEMBERS + 1}")
        self.space: spaces.Discrete = spaces.Discrete(MENU_ENTRIES)
        self._by, self._candidates, self._ring_m = ORDERS.index(order), candidates, scenario.ring_m
        self._depth = PLACES if order == "nearest" else REPORTS
        self._expectations, self._constants = Expectations(scenario, candidates, threads), common_constants(scenario)
        self._read, self._threads = Pinned(_read_menu), threads

    def cluster(self, action: Any, view: View) -> Cluster:
        """The cluster that the menu's entries name."""
        known = view.knowledge
        rows = len(known.row)
        choices = self._by, np.ascontiguousarray(_whole_numbers(action, self.space, rows), np.int64)
        found = self._candidates, self._expectations.of(view, self._depth).table
        cluster = Cluster(np.empty(rows, np.int64), np.empty((rows, GROUP), np.int32))
        threads = threads_for_short(rows, self._threads)
        if over_rows(self._read, rows, threads, self._constants, known.handle, choices, found, cluster[:]):
            raise _refusal(action, self.space)
        return cluster

    def masks(self, view: View) -> np.ndarray:
        """(B, 28) bool: what differs from all smaller entries; counts beyond the living, or keeping no head, do not."""
        living = (view.nearest(self._candidates, self._ring_m)[0] >= 0).sum(axis=1)
        n = np.arange(GROUP)
        standing = view.head >= 0
        valid = np.ones((len(living), self.space.n), dtype=bool)
        valid[:, 1 : 1 + GROUP] = standing[:, None] & (n <= np.maximum(living - 1, 0)[:, None])
        valid[:, 1 + GROUP :] = np.tile(n <= (living - 1)[:, None], 2)
        return valid


@kernel
def _read_menu(start, stop, cs, handle, choices, found, cluster):
    """Fill in the clusters that the menu's entries name.

    Args:
        cs: the scenario's common constants.
        handle: of what the network knows (Knowledge).
        choices: the place in ORDERS, and entries (B,).
        found: how many candidates, and the table of Expected.
        cluster: heads (B,) and members (B, M), filled.

    Returns: how many choices are not in the menu.
    """
    known, ranking, strange = knowledge_at(handle), np.empty(found[0], RANKED), 0
    for b in range(start, stop):
        strange += not 0 <= choices[1][b] < MENU_ENTRIES
        _read_entry(b, cs[0], known, choices, found, ranking, cluster)
    return strange


@lean_piece
def _read_entry(b, c, known, choices, found, ranking, cluster):
    (by, entries), (candidates, table), (heads, members) = choices, found, cluster
    entry = entries[b]
    members[b] = -1
    if entry == 0 and known.network.row[b].head >= 0:
        heads[b] = KEEP_CLUSTER
        return
    rule, further = (entry - 1) // GROUP, (entry - 1) % GROUP
    if entry <= 0:
        rule, further = KEEP, 0
    outlook = outlook_of(known, b, candidates, table)
    leader = rank_row(by, rule, outlook, c, ranking)
    heads[b] = outlook.nodes[leader].node if leader >= 0 else -1
    slot = 0
    for k in range(len(ranking)):
        place = ranking[k].place
        if further > 0 and place >= 0 and outlook.nodes[place].node != heads[b]:
            members[b, slot] = outlook.nodes[place].node
            slot += 1
            further -= 1


class SubsetAction:
    """MultiDiscrete [K + 1] + [2] * K: the head (0: keep it, j: the j-th nearest); which of the K nearest are in."""

    def __init__(self, scenario: Scenario, order: Order, candidates: int, threads: int = 1) -> None:
        self.space: spaces.MultiDiscrete = spaces.MultiDiscrete([candidates + 1] + [2] * candidates)
        self._candidates, self._ring_m = candidates, scenario.ring_m

    def cluster(self, action: Any, view: View) -> Cluster:
        """The cluster that the entries name."""
        action = _in_range(action, self.space, len(view.row))
        nodes = view.nearest(self._candidates, self._ring_m)[0]
        named = np.take_along_axis(nodes, np.maximum(action[:, :1] - 1, 0), axis=1)[:, 0]
        head = np.where(action[:, 0] == 0, view.head, named)
        return Cluster(head, np.where(action[:, 1:] == 1, nodes, -1).astype(np.int32))

    def masks(self, view: View) -> np.ndarray:
        """(B, K + 1 + 2 K) bool: heads, then out/in for each candidate."""
        exists = view.nearest(self._candidates, self._ring_m)[0] >= 0
        keep = (view.head >= 0) | ~exists.any(axis=1)
        choice = np.stack([np.ones_like(exists), exists], axis=2).reshape(len(exists), -1)
        return np.concatenate([keep[:, None], exists, choice], axis=1)


class RadiusAction:
    """Box(1) in [0, 1]: all living nodes within so much of two sensing radii of the prediction, among the nearest. The
    head stays while the prediction is within 0.8 sensing radii of it; then the nearest node leads."""

    NEAR = 0.8

    def __init__(self, scenario: Scenario, order: Order, candidates: int, threads: int = 1) -> None:
        self.space: spaces.Box = spaces.Box(0.0, 1.0, (1,), np.float32)
        self._candidates, self._radius_m = candidates, scenario.radius_m

    def cluster(self, action: Any, view: View) -> Cluster:
        """The nodes within the radius."""
        action = _in_box(action, self.space, len(view.row))
        nodes, distances = view.nearest(self._candidates)
        members = np.where(distances <= 2.0 * self._radius_m * action, nodes, -1)
        standing = view.head >= 0
        offset = view.positions[view.rows, np.maximum(view.head, 0)] - view.prediction
        near = (offset * offset).sum(axis=1) <= (self.NEAR * self._radius_m) ** 2
        return Cluster(np.where(standing & near, view.head, nodes[:, 0]), members.astype(np.int32))

    def masks(self, view: View) -> np.ndarray:
        """Refused: numbers have no mask."""
        raise AttributeError("action 'radius' is a number: it has no masks")


class ScoresAction:
    """Box(K) in [-1, 1]: of the K nearest candidates those above 0 are members and the highest is the head."""

    def __init__(self, scenario: Scenario, order: Order, candidates: int, threads: int = 1) -> None:
        self.space: spaces.Box = spaces.Box(-1.0, 1.0, (candidates,), np.float32)
        self._candidates, self._ring_m = candidates, scenario.ring_m

    def cluster(self, action: Any, view: View) -> Cluster:
        """The cluster that the scores name."""
        action = _in_box(action, self.space, len(view.row))
        nodes = view.nearest(self._candidates, self._ring_m)[0]
        head = np.where(nodes >= 0, action, -np.inf).argmax(axis=1)
        return Cluster(nodes[view.rows, head], np.where(action > 0, nodes, -1).astype(np.int32))

    def masks(self, view: View) -> np.ndarray:
        """Refused: numbers have no mask."""
        raise AttributeError("action 'scores' are numbers: they have no masks")


class NodesAction:
    """MultiDiscrete([2] * S): who is awake. The head is the chosen node nearest to the prediction; if none is chosen,
    the living node nearest to it, alone."""

    def __init__(self, scenario: Scenario, order: Order, candidates: int, threads: int = 1) -> None:
        self.space: spaces.MultiDiscrete = spaces.MultiDiscrete([2] * scenario.field.nodes)

    def cluster(self, action: Any, view: View) -> Cluster:
        """The cluster of the chosen nodes."""
        chosen = _in_range(action, self.space, len(view.row)) == 1
        living = chosen & view.alive
        distance = np.where(living, view.distance, np.inf)
        head = np.where(living.any(axis=1), distance.argmin(axis=1), view.nearest_living())
        return Cluster.of(head, chosen)

    def masks(self, view: View) -> np.ndarray:
        """(B, 2 S) bool: out/in for each node; the dead can only stay out."""
        return np.stack([np.ones_like(view.alive), view.alive], axis=2).reshape(len(view.period), -1)


class ClusterAction:
    """Dict(head: Discrete(S), members: MultiDiscrete([2] * S)): the full choice."""

    def __init__(self, scenario: Scenario, order: Order, candidates: int, threads: int = 1) -> None:
        nodes = scenario.field.nodes
        self.space: spaces.Dict = spaces.Dict(
            {"head": spaces.Discrete(nodes), "members": spaces.MultiDiscrete([2] * nodes)}
        )

    def cluster(self, action: Any, view: View) -> Cluster:
        """The choice itself."""
        if not isinstance(action, dict) or action.keys() != self.space.spaces.keys():
            raise _refusal(action, self.space)
        head, members = (_in_range(action[name], self.space[name], len(view.row)) for name in ("head", "members"))
        return Cluster.of(head, members == 1)

    def masks(self, view: View) -> np.ndarray:
        """(B, S + 2 S) bool: heads, then out/in for each node."""
        choice = np.stack([np.ones_like(view.alive), view.alive], axis=2).reshape(len(view.period), -1)
        return np.concatenate([view.alive, choice], axis=1)


def _whole_numbers(action: Any, space: Any, rows: int) -> np.ndarray:
    """The actions as an array (rows, ...) of integers."""
    array = action if type(action) is np.ndarray else _as_array(action, space)
    kind = array.dtype.kind
    if kind not in "iub" or array.shape != (rows, *space.shape):
        raise _refusal(action, space)
    # Discrete spaces contain Python's True, and a mask is a choice of nodes.
    return array.astype(np.int64) if kind == "b" else array


def _in_range(action: Any, space: Any, rows: int) -> np.ndarray:
    """The actions as an array, if they are in the space."""
    array = _whole_numbers(action, space, rows)
    most = space.n - 1 if isinstance(space, spaces.Discrete) else space.nvec - 1
    if (array < 0).any() or (array > most).any():
        raise _refusal(action, space)
    return array


def _in_box(action: Any, space: Any, rows: int) -> np.ndarray:
    """The actions as an array (rows, ...), if they are in the space."""
    array = _as_array(action, space)
    if array.dtype.kind not in "fiu" or array.shape != (rows, *space.shape):
        raise _refusal(action, space)
    if not ((array >= space.low) & (array <= space.high)).all():  # NaN is not
        raise _refusal(action, space)
    return array


def _as_array(action: Any, space: Any) -> np.ndarray:
    try:
        return np.asarray(action)
    except ValueError:  # lists of unequal lengths
        raise _refusal(action, space) from None


def _refusal(action: Any, space: Any) -> ValueError:
    return ValueError(f"action {short(repr(action))} is not in {short(str(space))}, one for each row")


ACTIONS: dict[str, Any] = {
    "menu": MenuAction,
    "subset": SubsetAction,
    "radius": RadiusAction,
    "scores": ScoresAction,
    "nodes": NodesAction,
    "cluster": ClusterAction,
}


def make_action(name: ActionName, scenario: Scenario, order: Order, candidates: int, threads: int = 1) -> Action:
    """An action by name, that shares a large batch among so many threads.

    Raises:
        ValueError: for an unknown name or order, or too few candidates.
    """
    if name not in ACTIONS:
        raise ValueError(f"action {name!r} is unknown: {suggest(name, ACTIONS)}")
    if order not in ORDERS:
        raise ValueError(f"order {order!r} is unknown: {suggest(order, ORDERS)}")
    return ACTIONS[name](scenario, order, candidates, threads)
