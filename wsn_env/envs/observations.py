"""Observations: a View as arrays, finite and clipped. lam is part of every one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np
from gymnasium import spaces

from wsn_env.compiled.kernels import Pinned, bind, every_row, kernel, lean_piece, over_rows, threads_for
from wsn_env.envs.actions import GROUP, MENU_ENTRIES
from wsn_env.envs.expectations import REPORTS, REPORTS_AHEAD, Expectations, Expected, outlook_of
from wsn_env.envs.feature import BOUND, Feature
from wsn_env.envs.features import (
    CANDIDATE_FEATURES,
    WIDTH,
    belief_features,
    clip,
    describe_candidate,
    describe_merit,
    describe_row,
)
from wsn_env.envs.merit import ORDERS, RANKED, order_row, rank_row
from wsn_env.envs.others import mark_elsewhere
from wsn_env.envs.prospects import describe_entries, describe_standing, entry_features, units_of
from wsn_env.models.measurement.base import Order
from wsn_env.models.motion.modes import COUNT
from wsn_env.models.quantity import suggest
from wsn_env.models.state import Knowledge, knowledge_at
from wsn_env.scenario import Scenario
from wsn_env.scenario.constants import common_constants
from wsn_env.simulation.view import View

ObservationName = Literal["candidates", "menu", "dict", "view"]


class Observation(Protocol):
    """What every one has; its space is of one environment."""

    space: Any  # the class's own, of Gymnasium

    def encode(self, view: View) -> Any:
        """An array or a dict of arrays (B, ...), fresh."""
        ...

    def follow(self, knowledge: Knowledge) -> Follower:
        """For one state whose arrays change in place."""
        ...


class Follower(Protocol):
    """Encodes a state's knowledge again and again."""

    def __call__(self, rows: np.ndarray | None = None) -> tuple[View, Any]:
        """A view of the present knowledge, which shares its arrays, and what `Observation.encode` gives of it.

        Args:
            rows: (B,) bool, in which it has changed since the last call; None: in all.
        """
        ...


@kernel
def _encode_candidates(start, stop, cs, handle, found, out):
    """Fill out (B, n): `belief_features`, then CANDIDATE_FEATURES of each candidate. Only in the rows marked.

    Args:
        cs: the scenario's common constants.
        handle: of what the network knows (Knowledge).
        found: rows (B,) bool; how many candidates; the table of Expected to the depth REPORTS.
    """
    known, ranking = knowledge_at(handle), np.empty(found[1], RANKED)
    for b in range(start, stop):
        if found[0][b]:
            _encode_candidates_of(b, cs[0], known, found, ranking, out)


@lean_piece
def _encode_candidates_of(b, c, known, found, ranking, out):
    _, candidates, table = found
    f, outlook = out[b], outlook_of(known, b, candidates, table)
    heading, first = describe_row(known, b, outlook, c, f)
    own = f[first:]
    own[:] = 0.0
    for k in range(candidates):
        g = own[k * WIDTH : (k + 1) * WIDTH]
        if outlook.nodes[k].node < 0:
            g[2] = BOUND
        else:
            describe_candidate(outlook, k, heading, c.radius_m, g)
    standing = outlook.nodes[candidates].node >= 0
    order_row(outlook, candidates if standing else -1, 0.0, c, ranking)
    describe_merit(outlook, ranking, own)
    clip(f)


@kernel
def _encode_menu(start, stop, cs, handle, found, out, by):
    """Fill out (B, n): `belief_features`, then `entry_features` of each of the menu's entries. Only in the rows marked.

    Args:
        found: as for `_encode_candidates`, to the depth REPORTS_AHEAD.
        by: the place in ORDERS.
        The rest: as `_encode_candidates`.
    """
    known, ranking = knowledge_at(handle), np.empty(found[1], RANKED)
    for b in range(start, stop):
        if found[0][b]:
            _encode_menu_of(b, cs[0], known, by, found, ranking, out)


@lean_piece
def _encode_menu_of(b, c, known, by, found, ranking, out):
    _, candidates, table = found
    f, outlook = out[b], outlook_of(known, b, candidates, table)
    units = units_of(outlook.lam, c)
    if c.tells_others:
        mark_elsewhere(known, b, outlook.nodes)
    heading, first = describe_row(known, b, outlook, c, f)
    width = (len(f) - first) // MENU_ENTRIES
    describe_standing(outlook, heading, units, c, f[first : first + width])
    for rule in range(3):
        leader = rank_row(by, rule, outlook, c, ranking)
        begin = first + (1 + rule * GROUP) * width
        describe_entries(outlook, ranking, leader, heading, units, c, f[begin : begin + GROUP * width])
    clip(f)


class CandidatesObservation:
    """Flat Box float32: `belief_features`, then CANDIDATE_FEATURES of the K living nodes nearest to the prediction.

    `features` has a name, a meaning, a unit and a range for each column.
    """

    depth, kernel = REPORTS, _encode_candidates
    _more: tuple[Any, ...] = ()  # what the kernel wants beside

    def __init__(self, scenario: Scenario, order: Order, candidates: int, threads: int = 1) -> None:
        about_belief, (count, each) = belief_features(scenario), self._choices(scenario, candidates)
        self.belief: int = len(about_belief)
        self.shape: tuple[int, int] = count, len(each)
        self.features: dict[str, Feature] = about_belief | {
            f"{name}[{k}]": feature for k in range(count) for name, feature in each.items()
        }
        size = self.belief + count * len(each)
        self.space: spaces.Box = spaces.Box(-BOUND, BOUND, (size,), np.float32)
        self._candidates, self._threads = candidates, threads
        self.expectations: Expectations = Expectations(scenario, candidates, threads)
        self._constants = common_constants(scenario)
        self._encode = Pinned(self.kernel)

    @staticmethod
    def _choices(scenario: Scenario, candidates: int) -> tuple[int, dict[str, Feature]]:
        return candidates, CANDIDATE_FEATURES

    def encode(self, view: View) -> np.ndarray:
        """(B, n) float32, fresh."""
        rows = len(view.row)
        out = np.empty((rows, *self.space.shape), np.float32)
        self.fill(view.knowledge, every_row(rows), self.expectations.of(view, self.depth), out)
        return out

    def follow(self, knowledge: Knowledge) -> FlatFollower:
        """In arrays that stay, row by row where few have changed."""
        return FlatFollower(self, knowledge)

    def fill(self, knowledge: Knowledge, rows: np.ndarray, expected: Expected, out: np.ndarray) -> None:
        """Encode into an array (B, n), in the rows marked.

        Args:
            expected: of the same knowledge, to this observation's depth.
        """
        over_rows(*self._call(knowledge, rows, expected, out))

    def bound(self, knowledge: Knowledge, expected: Expected, out: np.ndarray) -> Callable[[], int]:
        """Does so in all rows at each call."""
        return bind(*self._call(knowledge, every_row(len(out)), expected, out))

    def _call(self, knowledge, rows, expected: Expected, out) -> tuple[Any, ...]:
        """For `over_rows`."""
        threads, found = threads_for(rows, self._threads), (rows, self._candidates, expected.table)
        return self._encode, len(rows), threads, self._constants, knowledge.handle, found, out, *self._more


class FlatFollower:
    """Of a flat observation."""

    def __init__(self, observation: CandidatesObservation, knowledge: Knowledge) -> None:
        rows = len(knowledge.row)
        self._observation, self._knowledge, self._every = observation, knowledge, every_row(rows)
        self._expected = observation.expectations.room(rows, observation.depth)
        self._out = np.empty((rows, *observation.space.shape), np.float32)
        self._kept: dict[Any, Any] = {}  # with a view, and
        self._calls: tuple[Callable[[], int], ...] = ()  # that renew it and the observation, once both have been made

    def __call__(self, rows: np.ndarray | None = None) -> tuple[View, np.ndarray]:
        """As Follower."""
        if rows is None and self._calls:
            expect, encode = self._calls
            if not expect():
                encode()
                return View(self._knowledge, self._kept.copy()), self._out.copy()
        view, changed = View(self._knowledge), self._every if rows is None or not self._calls else rows
        expectations, known = self._observation.expectations, self._expected
        self._expected = expectations.fill(view, known, changed)
        self._observation.fill(self._knowledge, changed, self._expected, self._out)
        if not self._calls or self._expected is not known:
            self._kept = expectations.kept(self._expected)
            encode = self._observation.bound(self._knowledge, self._expected, self._out)
            self._calls = expectations.bound(self._knowledge, self._expected), encode
        return view, self._out.copy()  # whoever gets it may write into it

    def __reduce__(self) -> tuple[Any, ...]:
        return FlatFollower, (self._observation, self._knowledge)  # the calls hold addresses


class MenuObservation(CandidatesObservation):
    """Flat Box float32: `belief_features`, then `entry_features` of each entry of the menu: its predicted outcome."""

    depth, kernel = REPORTS_AHEAD, _encode_menu

    def __init__(self, scenario: Scenario, order: Order, candidates: int, threads: int = 1) -> None:
        super().__init__(scenario, order, candidates, threads)
        self._more = (ORDERS.index(order),)

    @staticmethod
    def _choices(scenario: Scenario, candidates: int) -> tuple[int, dict[str, Feature]]:
        return MENU_ENTRIES, entry_features(scenario)


@dataclass
class EncodesAnew:
    """The follower of an observation that keeps nothing."""

    observation: Observation
    knowledge: Knowledge

    def __call__(self, rows: np.ndarray | None = None) -> tuple[View, Any]:
        """As Follower."""
        view = View(self.knowledge)
        return view, self.observation.encode(view)


class DictObservation:
    """The same features under names: belief (n,), candidates (K, 11), and lam (1,) [m/mJ]."""

    def __init__(self, scenario: Scenario, order: Order, candidates: int, threads: int = 1) -> None:
        self._flat = CandidatesObservation(scenario, order, candidates, threads)
        high = max(scenario.lam_range[1], 1.0)
        self.space: Any = spaces.Dict(
            {
                "belief": spaces.Box(-BOUND, BOUND, (self._flat.belief,), np.float32),
                "candidates": spaces.Box(-BOUND, BOUND, self._flat.shape, np.float32),
                "lam": spaces.Box(0.0, high, (1,), np.float32),
            }
        )

    def encode(self, view: View) -> dict[str, np.ndarray]:
        """A dict of (B, ...) float32, fresh."""
        flat = self._flat.encode(view)
        return {
            "belief": flat[:, : self._flat.belief].copy(),
            "candidates": flat[:, self._flat.belief :].reshape(len(flat), *self._flat.shape).copy(),
            "lam": np.minimum(view.lam[:, None].astype(np.float32), self.space["lam"].high[0]),
        }

    def follow(self, knowledge: Knowledge) -> EncodesAnew:
        """All of it, every time."""
        return EncodesAnew(self, knowledge)


class ViewObservation:
    """Everything a network could know, as float64: enough for every hand-written policy (`View.from_arrays`)."""

    def __init__(self, scenario: Scenario, order: Order, candidates: int, threads: int = 1) -> None:
        nodes, side, far = scenario.field.nodes, max(scenario.field.room_m), 1e300  # beliefs may grow without end

        def box(low, high, *shape):
            return spaces.Box(low, high, shape, np.float64)

        self.space: spaces.Dict = spaces.Dict(
            {
                "period": spaces.Discrete(scenario.periods + 1),
                "lam": box(0.0, max(scenario.lam_range[1], 1.0), 1),
                "random_bits": spaces.Box(0, 2**32 - 1, (1,), np.int64),
                "log_miss": box(-far, 0.0, 1),
                "mean": box(-far, far, 4),
                "cov": box(-far, far, 4, 4),
                "predicted_mean": box(-far, far, 4),
                "predicted_cov": box(-far, far, 4, 4),
                "positions": box(0.0, side, nodes, 2),
                "full_j": box(0.0, scenario.radio.most_battery_j, 1),
                "left_j": box(0.0, 1.000001 * nodes * scenario.radio.most_battery_j, 1),  # a sum: rounded
                "battery": box(0.0, scenario.radio.most_battery_j, nodes),
                "head": spaces.Box(-1, nodes - 1, (1,), np.int64),  # -1: none (learners want Discrete from 0)
                "member": spaces.Box(0, 1, (nodes,), np.int8),
                "detected": spaces.Box(0, 1, (nodes,), np.int8),
                "measured": box(-far, far, nodes, 2),
                "surprise": box(0.0, far, 1),
                "mode_probabilities": box(0.0, 1.0, COUNT),
            }
            | (self._of_receivers(box, nodes, far) if scenario.measurement.lasting_errors else {})
            | ({"bitmap": spaces.Box(0, 1, (nodes,), np.int8)} if scenario.measurement.reports_state else {})
            | ({"targets": spaces.Box(1, scenario.targets, (1,), np.int64)} if scenario.targets > 1 else {})
        )

    @staticmethod
    def _of_receivers(box, nodes: int, far: float) -> dict:
        shapes = {"latest_db": (nodes,), "gradient": (nodes, 2), "variance": (nodes,)}
        return {name: box(-far, far, *shape) for name, shape in shapes.items()}

    def encode(self, view: View) -> dict[str, np.ndarray]:
        """A dict of (B, ...) arrays, fresh."""
        return view.as_arrays()

    def follow(self, knowledge: Knowledge) -> EncodesAnew:
        """All of it, every time."""
        return EncodesAnew(self, knowledge)


OBSERVATIONS: dict[str, Any] = {
    "candidates": CandidatesObservation,
    "menu": MenuObservation,
    "dict": DictObservation,
    "view": ViewObservation,
}


def make_observation(
    name: ObservationName, scenario: Scenario, order: Order, candidates: int, threads: int = 1
) -> Observation:
    """An observation by name.

    Raises:
        ValueError: for an unknown name.
    """
    if name not in OBSERVATIONS:
        raise ValueError(f"observation {name!r} is unknown: {suggest(name, OBSERVATIONS)}")
    return OBSERVATIONS[name](scenario, order, candidates, threads)
