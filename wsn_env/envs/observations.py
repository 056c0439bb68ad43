"""Observations: a View as arrays, finite and clipped. lam is part of every one."""

from __future__ import annotations

from typing import Any, Literal, Protocol

import numpy as np
from gymnasium import spaces

from wsn_env.compiled.kernels import Pinned, every_row, kernel, lean_piece, over_rows, threads_for
from wsn_env.envs import features
from wsn_env.envs.actions import GROUP, MENU_ENTRIES
from wsn_env.envs.expectations import REPORTS, REPORTS_AHEAD, Expectations, Expected, outlook_of
from wsn_env.envs.features import (
    BOUND,
    CANDIDATE_FEATURES,
    belief_features,
    clip,
    describe_candidate,
    describe_merit,
    describe_row,
)
from wsn_env.envs.merit import ORDERS, RANKED, order_row, rank_row
from wsn_env.envs.prospects import Units, describe_entries, describe_standing, entry_features
from wsn_env.models.measurement.base import Order
from wsn_env.models.motion.modes import COUNT
from wsn_env.models.quantity import suggest
from wsn_env.models.state import knowledge_at
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

    def renew(self, view: View, rows: np.ndarray, before: View, last: Any) -> Any:
        """What `encode` gives, where only some rows (B,) have changed since `last` was encoded from `before`."""
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
        g = own[k * features.WIDTH : (k + 1) * features.WIDTH]
        if outlook.nodes[k].node < 0:
            g[2] = BOUND
        else:
            describe_candidate(outlook, k, heading, c.radius_m, g)
    standing = outlook.nodes[candidates].node >= 0
    order_row(outlook, candidates if standing else -1, 0.0, c, ranking)
    describe_merit(outlook, ranking, own)
    clip(f)


@kernel
def _encode_menu(start, stop, cs, handle, found, out, terms):
    """Fill out (B, n): `belief_features`, then `entry_features` of each of the menu's entries. Only in the rows marked.

    Args:
        found: as for `_encode_candidates`, to the depth REPORTS_AHEAD.
        terms: the place in ORDERS, the scenario's typical cost in each row (B,) [m].
        The rest: as `_encode_candidates`.
    """
    known, ranking = knowledge_at(handle), np.empty(found[1], RANKED)
    for b in range(start, stop):
        if found[0][b]:
            _encode_menu_of(b, cs[0], known, terms, found, ranking, out)


@lean_piece
def _encode_menu_of(b, c, known, terms, found, ranking, out):
    (by, costs), (_, candidates, table) = terms, found
    f, outlook, units = out[b], outlook_of(known, b, candidates, table), Units(costs[b], c.typical_energy_mj)
    heading, first = describe_row(known, b, outlook, c, f)
    width = (len(f) - first) // MENU_ENTRIES
    describe_standing(outlook, heading, units, c, f[first : first + width])
    for rule in range(3):
        leader = rank_row(by, rule, outlook, c, ranking)
        begin = first + (1 + rule * GROUP) * width
        describe_entries(outlook, ranking, leader, heading, units, c, f[begin : begin + GROUP * width])
    clip(f)


class CandidatesObservation:
    """Flat Box float32: `belief_features`, then CANDIDATE_FEATURES of the K living nodes nearest to the prediction."""

    depth, kernel = REPORTS, _encode_candidates

    def __init__(self, scenario: Scenario, order: Order, candidates: int, threads: int = 1) -> None:
        self.belief: int = len(belief_features(scenario))
        self.shape: tuple[int, int] = self._shape(scenario, candidates)
        size = self.belief + self.shape[0] * self.shape[1]
        self.space: spaces.Box = spaces.Box(-BOUND, BOUND, (size,), np.float32)
        self._candidates, self._threads, self._scenario = candidates, threads, scenario
        self._expectations, self._constants = Expectations(scenario, candidates, threads), common_constants(scenario)
        self._encode = Pinned(self.kernel)

    @staticmethod
    def _shape(scenario: Scenario, candidates: int) -> tuple[int, int]:
        return candidates, len(CANDIDATE_FEATURES)

    def encode(self, view: View) -> np.ndarray:
        """(B, n) float32, fresh."""
        rows = len(view.row)
        expected = self._expectations.of(view, self.depth)
        return self._fill(view, every_row(rows), expected, np.empty((rows, *self.space.shape), np.float32))

    def renew(self, view: View, rows: np.ndarray, before: View, last: np.ndarray) -> np.ndarray:
        """What `encode` gives, for less where few rows have changed.

        Args:
            rows: (B,) bool, which have changed since `last` was encoded from the view `before`.
        """
        return self._fill(view, rows, self._expectations.renew(view, self.depth, rows, before), last.copy())

    def _fill(self, view: View, rows, expected: Expected, out) -> np.ndarray:
        threads, found = threads_for(rows, self._threads), (rows, self._candidates, expected.table)
        arguments = self._constants, view.knowledge.handle, found, out, *self._terms(view)
        over_rows(self._encode, len(rows), threads, *arguments)
        return out

    def _terms(self, view: View) -> tuple[Any, ...]:
        """What the kernel wants beside."""
        return ()


class MenuObservation(CandidatesObservation):
    """Flat Box float32: `belief_features`, then `entry_features` of each entry of the menu: its predicted outcome."""

    depth, kernel = REPORTS_AHEAD, _encode_menu

    def __init__(self, scenario: Scenario, order: Order, candidates: int, threads: int = 1) -> None:
        super().__init__(scenario, order, candidates, threads)
        self._by = ORDERS.index(order)

    @staticmethod
    def _shape(scenario: Scenario, candidates: int) -> tuple[int, int]:
        return MENU_ENTRIES, len(entry_features(scenario))

    def _terms(self, view: View) -> tuple[Any, ...]:
        return ((self._by, self._scenario.typical_cost(view.lam)),)


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

    def renew(self, view: View, rows: np.ndarray, before: View, last: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """All of it."""
        return self.encode(view)


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
        )

    @staticmethod
    def _of_receivers(box, nodes: int, far: float) -> dict:
        shapes = {"latest_db": (nodes,), "gradient": (nodes, 2), "variance": (nodes,)}
        return {name: box(-far, far, *shape) for name, shape in shapes.items()}

    def encode(self, view: View) -> dict[str, np.ndarray]:
        """A dict of (B, ...) arrays, fresh."""
        return view.as_arrays()

    def renew(self, view: View, rows: np.ndarray, before: View, last: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """All of it."""
        return self.encode(view)


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
