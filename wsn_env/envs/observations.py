"""Observations: a View as arrays, finite and clipped. lam is part of every one."""

from __future__ import annotations

from typing import Any, Literal, Protocol

import numpy as np
from gymnasium import spaces

from wsn_env.compiled.kernels import lean_kernel, over_rows, threads_for
from wsn_env.envs.actions import GROUP, MENU_ENTRIES
from wsn_env.envs.features import (
    BELIEF_FEATURES,
    BOUND,
    CANDIDATE_FEATURES,
    clip,
    describe_belief,
    describe_candidate,
    describe_merit,
)
from wsn_env.envs.merit import ORDERS, fill_chances, order_row, rank_row
from wsn_env.envs.prospects import ENTRY_FEATURES, describe_entries, describe_standing, foresee
from wsn_env.models.measurement.base import Order
from wsn_env.models.quantity import suggest
from wsn_env.models.state import knowledge_at, sensors_of
from wsn_env.scenario import Scenario
from wsn_env.scenario.constants import constants
from wsn_env.simulation.geometry import find_candidates
from wsn_env.simulation.view import View

ObservationName = Literal["candidates", "menu", "dict", "view"]

G = len(BELIEF_FEATURES)


class Observation(Protocol):
    """What every one has; its space is of one environment."""

    space: Any  # the class's own, of Gymnasium

    def encode(self, view: View) -> Any:
        """An array or a dict of arrays (B, ...), fresh."""
        ...

    def renew(self, view: View, rows: np.ndarray, before: View, last: Any) -> Any:
        """What `encode` gives, where only some rows (B,) have changed since `last` was encoded from `before`."""
        ...


@lean_kernel
def _encode_candidates(start, stop, cs, handle, battery_j, rows, whole, real, out):
    """Fill out (B, n): BELIEF_FEATURES, then CANDIDATE_FEATURES of each candidate. Only in the rows marked.

    Args:
        handle: of what the network knows (Knowledge).
        rows: (B,) bool.
        whole: (2, B, K) filled with the candidates, and with them in order of merit.
        real: (5, B, K) filled with the candidates' distances [m]; the rest is scratch.
    """
    c, known, width = cs[0], knowledge_at(handle), len(CANDIDATE_FEATURES)
    nodes, ordered = whole[0], whole[1]
    distances, chances, left, drops = real[0], real[1], real[2], real[3]
    for b in range(start, stop):
        if not rows[b]:
            continue
        network = known.network
        m, p, standing = known.belief[b].predicted_mean, known.belief[b].predicted_cov, network.row[b]
        find_candidates(network, b, m[0], m[2], c.ring_m, nodes[b], distances[b])
        f = out[b]
        ex, ey = describe_belief(known, b, nodes[b], distances[b], c, f[:G])
        f[G:] = 0.0
        sensors, members = sensors_of(known, b), network.members[b]
        fill_chances(sensors, nodes[b], m, p, c, chances[b])
        for k in range(nodes.shape[1]):
            node, g = nodes[b, k], f[G + k * width : G + (k + 1) * width]
            if node < 0:
                g[2] = BOUND
                continue
            g[2] = distances[b, k] / c.radius_m
            g[7] = network.battery[b, node] / battery_j
            describe_candidate(
                node, chances[b, k], standing.head, members, standing.n_members, sensors, m, p, ex, ey, c, g
            )
        order_row(sensors, standing.head, m, p, 0.0, nodes[b], chances[b], c, left[b], ordered[b], drops[b])
        describe_merit(nodes[b], ordered[b], drops[b], np.sqrt(p[0, 0] + p[2, 2] + 1e-12), width, f[G:])
        clip(f)


@lean_kernel
def _encode_menu(start, stop, cs, handle, terms, rows, whole, real, out):
    """Fill out (B, n): BELIEF_FEATURES, then ENTRY_FEATURES of each of the menu's entries. Only in the rows marked.

    Args:
        terms: the scenario's typical energy [mJ], the place in ORDERS, its typical cost in each row (B,) [m].
        The rest: as `_encode_candidates`.
    """
    c, known, width = cs[0], knowledge_at(handle), len(ENTRY_FEATURES)
    typical_mj, by, costs = terms
    nodes, ordered = whole[0], whole[1]
    distances, chances, left, drops, later = real[0], real[1], real[2], real[3], real[4]
    for b in range(start, stop):
        if not rows[b]:
            continue
        network = known.network
        m, p, standing = known.belief[b].predicted_mean, known.belief[b].predicted_cov, network.row[b]
        sensors = sensors_of(known, b)
        members, lam = network.members[b], known.row[b].lam
        find_candidates(network, b, m[0], m[2], c.ring_m, nodes[b], distances[b])
        f = out[b]
        way = describe_belief(known, b, nodes[b], distances[b], c, f[:G])
        candidates, numbers = (nodes[b], chances[b], later[b]), (lam, costs[b], typical_mj)
        foresee(sensors, candidates, m, p, c)
        describe_standing(sensors, standing, members, candidates, m, p, way, numbers, c, f[G : G + width])
        for rule in range(3):
            leader = rank_row(
                by, rule, sensors, standing.head, m, p, lam, nodes[b], chances[b], c, left[b], ordered[b], drops[b]
            )
            first = G + width + rule * GROUP * width
            entries = f[first : first + GROUP * width]
            describe_entries(
                sensors, standing, members, candidates, ordered[b], leader, m, p, way, numbers, c, width, entries
            )
        clip(f)


class CandidatesObservation:
    """Flat Box float32: BELIEF_FEATURES, then CANDIDATE_FEATURES of the K living nodes nearest to the prediction."""

    features: tuple[str, ...] = CANDIDATE_FEATURES

    def __init__(self, scenario: Scenario, order: Order, candidates: int, threads: int = 1) -> None:
        self.shape: tuple[int, int] = (candidates, len(self.features))
        self.space: spaces.Box = spaces.Box(-BOUND, BOUND, (G + candidates * self.shape[1],), np.float32)
        self._candidates, self._ring_m, self._threads = candidates, scenario.ring_m, threads
        self._scenario, self._constants = scenario, constants(scenario)

    def encode(self, view: View) -> np.ndarray:
        """(B, n) float32, fresh."""
        rows = len(view.row)
        return self._fill(
            view, np.ones(rows, bool), np.empty((rows, *self.space.shape), np.float32), self._scratch(view)
        )

    def renew(self, view: View, rows: np.ndarray, before: View, last: np.ndarray) -> np.ndarray:
        """What `encode` gives, for less where few rows have changed.

        Args:
            rows: (B,) bool, which have changed since `last` was encoded from the view `before`.
        """
        whole, real = self._scratch(view)
        whole[0], real[0] = before.nearest(self._candidates, self._ring_m)
        return self._fill(view, rows, last.copy(), (whole, real))

    def _scratch(self, view: View) -> tuple[np.ndarray, np.ndarray]:
        """(2, B, K) and (5, B, K) for the kernels, which leave the candidates and their distances to the view."""
        shape = len(view.row), self._candidates
        whole, real = np.empty((2, *shape), np.int64), np.empty((5, *shape))
        view.remember_nearest(whole[0], real[0], self._ring_m)
        return whole, real

    def _fill(self, view: View, rows, out, scratch) -> np.ndarray:
        return self._run(_encode_candidates, self._scenario.radio.battery_j, view, rows, out, scratch)

    def _run(self, kernel, terms, view: View, rows, out, scratch) -> np.ndarray:
        threads = threads_for(rows, self._threads)
        over_rows(kernel, len(rows), threads, self._constants, view.knowledge.handle, terms, rows, *scratch, out)
        return out


class MenuObservation(CandidatesObservation):
    """Flat Box float32: BELIEF_FEATURES, then ENTRY_FEATURES of each entry of the menu: what it promises."""

    features: tuple[str, ...] = ENTRY_FEATURES

    def __init__(self, scenario: Scenario, order: Order, candidates: int, threads: int = 1) -> None:
        super().__init__(scenario, order, candidates, threads)
        self.shape: tuple[int, int] = (MENU_ENTRIES, len(self.features))
        self.space: spaces.Box = spaces.Box(-BOUND, BOUND, (G + MENU_ENTRIES * self.shape[1],), np.float32)
        self._order = order

    def _fill(self, view: View, rows, out, scratch) -> np.ndarray:
        terms = self._scenario.typical_energy_mj, ORDERS.index(self._order), self._scenario.typical_cost(view.lam)
        return self._run(_encode_menu, terms, view, rows, out, scratch)


class DictObservation:
    """The same features under names: belief (19,), candidates (K, 11), and lam (1,) [m/mJ]."""

    def __init__(self, scenario: Scenario, order: Order, candidates: int, threads: int = 1) -> None:
        self._flat = CandidatesObservation(scenario, order, candidates, threads)
        high = max(scenario.lam_range[1], 1.0)
        self.space: Any = spaces.Dict(
            {
                "belief": spaces.Box(-BOUND, BOUND, (G,), np.float32),
                "candidates": spaces.Box(-BOUND, BOUND, self._flat.shape, np.float32),
                "lam": spaces.Box(0.0, high, (1,), np.float32),
            }
        )

    def encode(self, view: View) -> dict[str, np.ndarray]:
        """A dict of (B, ...) float32, fresh."""
        flat = self._flat.encode(view)
        return {
            "belief": flat[:, :G].copy(),
            "candidates": flat[:, G:].reshape(len(flat), *self._flat.shape).copy(),
            "lam": np.minimum(view.lam[:, None].astype(np.float32), self.space["lam"].high[0]),
        }

    def renew(self, view: View, rows: np.ndarray, before: View, last: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """All of it."""
        return self.encode(view)


class ViewObservation:
    """Everything a network could know, as float64: enough for every hand-written policy (`View.from_arrays`)."""

    def __init__(self, scenario: Scenario, order: Order, candidates: int, threads: int = 1) -> None:
        nodes, side, far = scenario.field.nodes, max(scenario.field.room_m), 1e9

        def box(low, high, *shape):
            return spaces.Box(low, high, shape, np.float64)

        self.space: spaces.Dict = spaces.Dict(
            {
                "period": spaces.Discrete(scenario.periods + 1),
                "lam": box(0.0, max(scenario.lam_range[1], 1.0), 1),
                "luck": spaces.Box(0, 2**32 - 1, (1,), np.int64),
                "log_miss": box(-far, 0.0, 1),
                "mean": box(-far, far, 4),
                "cov": box(-far, far, 4, 4),
                "predicted_mean": box(-far, far, 4),
                "predicted_cov": box(-far, far, 4, 4),
                "positions": box(0.0, side, nodes, 2),
                "battery": box(0.0, scenario.radio.battery_j, nodes),
                "head": spaces.Discrete(nodes + 1, start=-1),
                "member": spaces.Box(0, 1, (nodes,), np.int8),
                "detected": spaces.Box(0, 1, (nodes,), np.int8),
                "measured": box(-far, far, nodes, 2),
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
