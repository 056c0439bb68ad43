"""What the belief expects of nodes in the period to come: how likely a report is, and what one would tell.

Here features, the menu and its orders of merit meet the kinds. What comes after works on these numbers alone, and is
compiled once for all measurements.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from wsn_env.compiled.arrays import blank, record
from wsn_env.compiled.kernels import Pinned, bind, every_row, lean_kernel, lean_piece, over_rows, threads_for
from wsn_env.models.measurement.base import PositionBelief, chance, linearise, node_of, packets_a_report
from wsn_env.models.state import Knowledge, knowledge_at, sensors_of
from wsn_env.scenario import Scenario
from wsn_env.scenario.constants import constants
from wsn_env.simulation.geometry import find_candidates
from wsn_env.simulation.view import View

AHEAD = 3.0  # periods
NUMBERS = 2  # of a report, at most
LEAST_DETECTION = 0.05  # with which clutter is shared out: a list is sent whatever is in it

EXPECTED = record(
    [
        ("node", "i8"),  # -1: none
        ("x", "f8"),  # m
        ("y", "f8"),
        ("distance_m", "f8"),  # of a candidate, to the prediction
        ("left", "f8"),  # share of its battery
        ("detection", "f8"),  # probability that it has something to report
        ("detection_ahead", "f8"),  # the same AHEAD periods on, if the target keeps its velocity
        ("silence_informs", "i8"),  # 1: its silence tells as much as its report
        ("packets", "f8"),  # how many packets long a report is
        ("numbers", "i8"),  # of a report; each linearised about the prediction:
        ("slope_x", "f8", NUMBERS),  # per m
        ("slope_y", "f8", NUMBERS),
        ("variance", "f8", NUMBERS),  # of its noise
        ("price_m", "f8"),  # what an order of merit charges for it
        ("open", "i8"),  # 1: still to be ordered
        ("shared", "i8"),  # 1: awake for another target anyhow
        ("elsewhere", "i8"),  # 1: stands in the cluster of another target; for observations that tell of others
    ]
)

PLACES, REPORTS, REPORTS_AHEAD = range(3)  # how much is asked: where nodes stand; their reports too; those AHEAD too


class Expected(NamedTuple):
    """What is expected in every row."""

    nodes: np.ndarray  # (B, K) candidates, -1: none
    distances: np.ndarray  # (B, K) to the prediction [m], inf: none
    table: np.ndarray  # (B, K + 1 + M) EXPECTED: of the candidates, the standing head and its members
    depth: int


class Outlook(NamedTuple):
    """What a row's network expects of the period to come, for kernels."""

    nodes: np.ndarray  # (K + 1 + n,) EXPECTED: of the candidates; of the standing head, its node -1 if there is none;
    # of its members
    candidates: int  # K: the standing head's place among the nodes
    mean: np.ndarray  # (4,) predicted
    cov: np.ndarray  # (4, 4)
    lam: float  # m/mJ


class Expectations:
    """Of a scenario's views: what the K candidates and the standing cluster are expected to report."""

    def __init__(self, scenario: Scenario, candidates: int, threads: int = 1) -> None:
        self._constants, self._candidates, self._threads = constants(scenario), candidates, threads
        self._expect = Pinned(_expect)
        self._scenario, self._key = scenario, ("expected", candidates, id(scenario))
        self._nearest = "nearest", candidates, scenario.ring_m  # as `View.nearest` keeps them
        self._members = candidates  # for which there is room; more when more are met

    def of(self, view: View, depth: int) -> Expected:
        """Of a view's nearest candidates; kept with it.

        Args:
            depth: PLACES, REPORTS or REPORTS_AHEAD.
        """
        known = view.derived.get(self._key)
        if known is None or known.depth < depth:
            rows = len(view.row)
            known = self.fill(view, self.room(rows, depth), every_row(rows))
        return known

    def room(self, rows: int, depth: int) -> Expected:
        """Arrays for `fill`."""
        shape = rows, self._candidates
        return Expected(np.empty(shape, np.int64), np.empty(shape), self._table(*shape), depth)

    def fill(self, view: View, known: Expected, rows: np.ndarray) -> Expected:
        """What `of` gives, in arrays that are there; kept with the view.

        Args:
            known: arrays that are filled.
            rows: (B,) bool, which have changed since `known` was filled.

        Returns: `known`, with a wider table where more members stand than it has room for.
        """
        known = self._fill(view, rows, known, True)
        view.derived.update(self.kept(known))
        return known

    def kept(self, known: Expected) -> dict[Any, Any]:
        """What is kept with a view."""
        return {self._key: known, self._nearest: known[:2]}

    def bound(self, knowledge: Knowledge, known: Expected) -> Callable[[], int]:
        """Fills `known` in all rows at each call; returns in how many more members stand than it has room for."""
        return bind(*self._call(knowledge, every_row(len(known.nodes)), known, True))

    def of_nodes(self, view: View, nodes: np.ndarray, depth: int) -> Expected:
        """Of given candidates (B, K)."""
        shape = nodes.shape
        made = Expected(np.ascontiguousarray(nodes, np.int64), np.zeros(shape), self._table(*shape), depth)
        return self._fill(view, every_row(shape[0]), made, False)

    def _table(self, rows: int, candidates: int) -> np.ndarray:
        return blank(EXPECTED, rows, candidates + 1 + self._members)

    def _fill(self, view, rows, known: Expected, find: bool) -> Expected:
        if over_rows(*self._call(view.knowledge, rows, known, find)):
            self._members = int(view.network.n_members.max())
            wider = known._replace(table=self._table(*known.nodes.shape))
            return self._fill(view, every_row(len(rows)), wider, find)
        return known

    def _call(self, knowledge, rows, known: Expected, find: bool) -> tuple[Any, ...]:
        """For `over_rows`."""
        asked, threads = (known.depth, find), threads_for(rows, self._threads)
        return self._expect, len(rows), threads, self._constants, knowledge.handle, asked, rows, known[:3]


@lean_kernel
def _expect(start, stop, cs, handle, asked, rows, found):
    """Fill in an Expected, only in the rows marked.

    Args:
        handle: of what the network knows (Knowledge).
        asked: the depth; whether the candidates have to be found, too.
        rows: (B,) bool.
        found: nodes, distances and table of the Expected.

    Returns: in how many rows more members stand than the table has room for.
    """
    known, c, crowded = knowledge_at(handle), cs[0], 0
    depth, find = asked
    for b in range(start, stop):
        if rows[b]:
            nodes, distances, own = found[0][b], found[1][b], found[2][b]
            mean, standing, count = known.belief[b].predicted_mean, known.network.row[b], len(nodes)
            if find:
                find_candidates(known.network, b, mean[0], mean[2], c.ring_m, nodes, distances)
            for k in range(count):
                _expect_node(known, b, nodes[k], depth, c, own[k])
                own[k].distance_m = distances[k]
            if count + 1 + standing.n_members > len(own):
                crowded += 1
                continue
            for k in range(-1, standing.n_members):
                node = standing.head if k < 0 else np.int64(known.network.members[b, k])
                place = place_of(node, nodes)
                if place >= 0:
                    own[count + 1 + k] = own[place]
                else:
                    _expect_node(known, b, node, depth, c, own[count + 1 + k])
    return crowded


@lean_piece
def _expect_node(known, b, node, depth, c, e):
    e.node, e.shared = node, 0
    if node < 0:
        return
    place, m, p = node_of(sensors_of(known, b), node), known.belief[b].predicted_mean, known.belief[b].predicted_cov
    e.x, e.y = place.x, place.y
    e.left = known.network.battery[b, node] / known.row[b].full_j
    if depth >= REPORTS:
        target = PositionBelief(m[0], m[2], p[0, 0], p[0, 2], p[2, 2])
        e.detection = chance(c.measurement, place, target, c)
        e.silence_informs = known.reports.bitmap.shape[1] > 0
        e.packets = packets_a_report(c.measurement) + c.clutter / max(e.detection, LEAST_DETECTION)
        lines = linearise(c.measurement, place, target)
        e.numbers = min(len(lines), NUMBERS)
        for k in range(e.numbers):
            sx, sy = lines[k].slope_x, lines[k].slope_y
            e.slope_x[k], e.slope_y[k] = sx, sy
            e.variance[k] = lines[k].variance + c.tracking.node_sd_m**2 * (sx * sx + sy * sy)
    if depth >= REPORTS_AHEAD:
        t = AHEAD * c.period_s
        xx = p[0, 0] + t * (2.0 * p[0, 1] + t * p[1, 1])
        xy = p[0, 2] + t * (p[0, 3] + p[1, 2] + t * p[1, 3])
        yy = p[2, 2] + t * (2.0 * p[2, 3] + t * p[3, 3])
        later = PositionBelief(m[0] + t * m[1], m[2] + t * m[3], xx, xy, yy)
        e.detection_ahead = chance(c.measurement, place, later, c)


@lean_piece
def place_of(node: Any, nodes: np.ndarray) -> int:
    """Where a node stands among others; -1: nowhere, or no node."""
    if node >= 0:
        for k in range(len(nodes)):
            if nodes[k] == node:
                return k
    return -1


@lean_piece
def outlook_of(known: Any, b: int, candidates: int, table: np.ndarray) -> Outlook:
    """The Outlook of row b of what the network knows (Knowledge).

    Args:
        candidates: K.
        table: of Expected.
    """
    belief, end = known.belief[b], candidates + 1 + known.network.row[b].n_members
    return Outlook(table[b, :end], candidates, belief.predicted_mean, belief.predicted_cov, known.row[b].lam)
