"""A yardstick for the error of an episode: the Cramer-Rao recursion on the reports that were really delivered.

    J' = (F J^-1 F' + q^2 G G')^-1 + sum over the reports of H' R^-1 H

(Tichavsky, Muravchik & Nehorai, 1998, eq. 21) with H at the true state, P0 the first belief's covariance, and q the
target's own acceleration noise (the filter's where the motion has none). It runs on P = J^-1, since G G' is singular.

With positions it is the covariance of the Kalman filter that knows q. It is a *reference*, not a bound: it takes each
episode's own track and reports for their mean, and an estimate may know more than the reports' values, namely who
reported and who kept silent, and where the target can be (a track is drawn again until it stays in the field, a given
start is not normal). `simulation/bound.py` has the bound.

The *reference with all nodes awake* is the same for a network in which every node is awake throughout and every report
arrives. It depends on field, track and key alone, so that it is one number an episode, whatever the schedule.

Both are made of the truth: for loggers and tables, never for policies.
"""

import numpy as np

from wsn_env.compiled.arrays import record
from wsn_env.compiled.kernels import Pinned, lean_kernel, lean_piece, over_rows, threads_for, threads_for_short
from wsn_env.models.detection.base import detects, stream_of
from wsn_env.models.measurement.base import node_at, value_information
from wsn_env.models.motion.prediction import predict_covariance
from wsn_env.models.state import Outcome, State, state_at
from wsn_env.scenario import Scenario
from wsn_env.scenario.constants import constants
from wsn_env.simulation.episode import start_record
from wsn_env.simulation.geometry import cells_within

MEMORY = record(
    [
        ("cov", "f8", (4, 4)),  # P after the last period
        ("squares", "f8"),  # sum over the episode's periods of the squared reference [m^2]
    ]
)


def why_no_reference(scenario: Scenario) -> str | None:
    """What of a scenario leaves it without a reference, and what is allowed; None: it has one."""
    measurement = scenario.measurement
    if measurement.reports_state:
        why = "a bit that jumps at an edge has no Fisher information"
    elif measurement.lasting_errors:
        why = "the errors of its levels last over periods"
    elif not scenario.association.names_targets:
        kind = type(scenario.association).__name__
        return f"Scenario.association = {kind}: reports do not say of which target they are; allowed is Known"
    elif scenario.ends_outside:
        return "Scenario.ends_outside = True: episodes end before the horizon that the mean is over; allowed is False"
    elif scenario.faults:
        return f"Scenario.faults = {scenario.faults}: reports are not of the target alone; allowed is ()"
    else:
        return None
    return f"Scenario.measurement = {type(measurement).__name__}: {why}; allowed are reports with errors of their own"


def has_reference(scenario: Scenario) -> bool:
    """Whether there is one."""
    return why_no_reference(scenario) is None


class Reference:
    """The references of B rows, a period after the other.

    `begin` at the start of an episode, then `advance` once a period; `episode_m` and `all_awake_m` at its end.
    """

    def __init__(self, scenario: Scenario, rows: int = 1, threads: int = 1, periods: int | None = None) -> None:
        """Prepare.

        Args:
            scenario: one that `has_reference`.
            rows: B.
            threads: at most so many share the work. No bit depends on it.
            periods: of an episode; None: the scenario's.
        """
        if why := why_no_reference(scenario):
            raise ValueError(why)
        self._periods, self._threads = scenario.periods if periods is None else periods, threads
        self._constants, self._start = constants(scenario), start_record(scenario)
        self._constants["tracking"]["q"] = scenario.track_q
        if scenario.detection.values_decide:
            self._constants["reach_m"] = np.inf  # noise lifts a level over the threshold from anywhere
        self._memory, self._advance = np.zeros(rows, MEMORY), Pinned(_advance)

    def begin(self, state: State, rows: np.ndarray | None = None) -> np.ndarray:
        """New episodes; a search in period 0 counts.

        Args:
            state: in period 0 of them.
            rows: (B,) bool, which; None: all.

        Returns: (B,) the reference now [m]; of other rows as it was.
        """
        rows = np.ones(len(self._memory), bool) if rows is None else np.asarray(rows, bool)
        reference_m = np.empty(len(rows))
        _begin(self._constants, self._start, rows, state.handle, self._memory, reference_m)
        return reference_m

    def advance(self, state: State, outcome: Outcome) -> np.ndarray:
        """One period.

        Args:
            state: after it.
            outcome: what it brought.

        Returns: (B,) root of the trace of P's position part [m].
        """
        rows = len(self._memory)
        reference_m = np.empty(rows)
        threads = threads_for_short(rows, self._threads)
        over_rows(self._advance, rows, threads, self._constants, outcome.row, state.handle, self._memory, reference_m)
        return reference_m

    def episode_m(self) -> np.ndarray:
        """(B,) root of the mean square over the horizon of what `advance` has returned [m]."""
        return np.sqrt(self._memory["squares"] / self._periods)

    def all_awake_m(self, state: State, rows: np.ndarray | None = None) -> np.ndarray:
        """That with all nodes awake throughout: the root of the mean square over the horizon [m].

        Args:
            state: in any period of the episode.
            rows: (B,) bool, which; None: all.

        Returns: (B,), 0 in other rows.
        """
        rows = np.ones(state.rows, bool) if rows is None else np.asarray(rows, bool)
        memory, threads = np.zeros(len(rows), MEMORY), threads_for(rows, self._threads)
        asked = self._start, rows, self._periods
        over_rows(_play_all_awake, len(rows), threads, self._constants, asked, state.handle, memory)
        return np.sqrt(memory["squares"] / self._periods)


@lean_kernel
def _begin(cs, starts, rows, handle, memory, reference_m):
    state, c = state_at(handle), cs[0]
    for b in range(len(rows)):
        own = memory[b]
        if rows[b]:
            _start_anew(own, starts[0])
            nodes, truth = state.reports.node[b, : state.reports.count[b]], state.track[b, 0]
            xx, xy, yy = _information_of(nodes, state.network.positions[b], truth[0], truth[2], c)
            _correct(own.cov, xx, xy, yy)
        reference_m[b] = np.sqrt(_position_variance(own.cov))


@lean_kernel
def _advance(start, stop, cs, outcomes, handle, memory, reference_m):
    state, c = state_at(handle), cs[0]
    for b in range(start, stop):
        out = outcomes[b]
        nodes = state.reports.node[b, : out.delivered]
        xx, xy, yy = _information_of(nodes, state.network.positions[b], out.target_m[0], out.target_m[1], c)
        reference_m[b] = np.sqrt(_take_period(memory[b], xx, xy, yy, c))


@lean_kernel
def _play_all_awake(start, stop, cs, asked, handle, memory):
    """A whole episode with all nodes awake, in the rows marked; `memory` holds what the last period leaves."""
    (starts, rows, periods), state, c = asked, state_at(handle), cs[0]
    for b in range(start, stop):
        if not rows[b]:
            continue
        own = memory[b]
        _start_anew(own, starts[0])
        if starts[0].searches:
            xx, xy, yy = _information_of_all(state, b, 0, c)
            _correct(own.cov, xx, xy, yy)
        for k in range(1, periods + 1):
            xx, xy, yy = _information_of_all(state, b, k, c)
            _take_period(own, xx, xy, yy, c)


@lean_piece
def _start_anew(own, s):
    """P0, as the episode's first belief has it."""
    own.cov[:] = 0.0
    own.cov[0, 0] = own.cov[2, 2] = s.sd_m * s.sd_m
    own.cov[1, 1] = own.cov[3, 3] = s.sd_ms * s.sd_ms
    own.squares = 0.0


@lean_piece
def _take_period(own, xx, xy, yy, c):
    """Predict, correct; returns the trace of the position part."""
    predict_covariance(own.cov, c.period_s, c.tracking.q, own.cov)
    _correct(own.cov, xx, xy, yy)
    square = _position_variance(own.cov)
    own.squares += square
    return square


@lean_piece
def _position_variance(cov):
    """The trace of the position part; what rounding leaves below 0 counts as 0."""
    return max(cov[0, 0], 0.0) + max(cov[2, 2], 0.0)


@lean_piece
def _information_of(nodes, positions, x, y, c):
    """Of the period's reports."""
    xx, xy, yy = 0.0, 0.0, 0.0
    for node in nodes:
        one = value_information(c.measurement, node_at(positions, node), x, y)
        xx, xy, yy = xx + one[0], xy + one[1], yy + one[2]
    return xx, xy, yy


@lean_piece
def _information_of_all(state, b, period, c):
    """Of every node that would detect the target, if it were awake."""
    positions, grid, truth = state.network.positions[b], state.network.grid, state.track[b, period]
    x, y, place, starts = truth[0], truth[2], grid.row[b], grid.starts[b]
    stream = stream_of(c.detection, state.key[b], period)
    first, last, left, right = cells_within(place, x, y, c.reach_m)
    xx, xy, yy = 0.0, 0.0, 0.0
    for line in range(first, last + 1):
        for slot in range(starts[line * place.side + left], starts[line * place.side + right + 1]):
            node = grid.nodes[b, slot]
            placed = node_at(positions, node)
            if detects(c.detection, c.measurement, stream, placed, x, y):
                one = value_information(c.measurement, placed, x, y)
                xx, xy, yy = xx + one[0], xy + one[1], yy + one[2]
    return xx, xy, yy


@lean_piece
def _correct(cov, xx, xy, yy):
    """(P^-1 + J)^-1 for information J about the position, in place: two rank-one corrections, by J = L D L'."""
    first, second, most, least = (0, 2, xx, yy) if xx >= yy else (2, 0, yy, xx)
    if most > 0.0:
        tilt = xy / most
        _correct_along(cov, first, second, tilt, most)
        rest = least - tilt * xy
        if rest > 0.0:
            _correct_along(cov, second, first, 0.0, rest)


@lean_piece
def _correct_along(cov, i, j, tilt, information):
    """Of a measurement of x_i + tilt x_j."""
    spread = cov[i, i] + tilt * (2.0 * cov[i, j] + tilt * cov[j, j])
    gain = information / (1.0 + information * spread)
    moved = (
        cov[0, i] + tilt * cov[0, j],
        cov[1, i] + tilt * cov[1, j],
        cov[2, i] + tilt * cov[2, j],
        cov[3, i] + tilt * cov[3, j],
    )
    for k in range(4):
        for n in range(4):
            cov[k, n] -= gain * (moved[k] * moved[n])
