"""The world: reset and step, batch-first and pure. `World.step` is the whole story of a period."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from wsn_env.compiled import draws, kernels
from wsn_env.compiled.arrays import blank
from wsn_env.compiled.kernels import available_threads, over_rows, threads_for
from wsn_env.filters import make_tracker
from wsn_env.filters.particle import ParticleTracker
from wsn_env.models.arguments import check_argument, checked_but
from wsn_env.models.quantity import short, whole_number
from wsn_env.models.state import OUTCOME, Cluster, Grid, Outcome, State, Tracker
from wsn_env.scenario import Scenario
from wsn_env.scenario.constants import constants
from wsn_env.scenario.tracks import Tracks
from wsn_env.simulation import episode, period, search
from wsn_env.simulation.faults import Faults

LONG_LIST = 64


class World:
    """A scenario brought to life. Holds no state of its own: every method is a function of its arguments."""

    @checked_but("threads")
    def __init__(self, scenario: Scenario | str, threads: int | None = None, fast: bool = False) -> None:
        """Prepare a scenario.

        Args:
            scenario: what to simulate, or a preset's name.
            threads: at most so many share a large batch; None: every core that the process may use. The bits of
                a result do not depend on it.
            fast: let the compiler regroup the particle filter's sums: quicker, equal to rounding, but with other bits
                on other processors. The world itself stays as it is.
        """
        self.scenario: Scenario = (scenario := Scenario.of(scenario))
        self.threads: int = available_threads() if threads is None else whole_number("threads", threads, 1)
        self.tracker: Tracker = make_tracker(scenario, self.threads, fast)
        self._run = kernels.Pinned(kernels.fast(period.run) if fast else period.run)
        self._constants = constants(scenario)
        self._tracks, self._packets = Tracks(scenario), scenario.measurement.packets_of(scenario)
        self._faults = Faults(scenario)
        self._start, self._placed = episode.start_record(scenario), episode.placed_nodes(scenario)

    def reset(self, keys: npt.ArrayLike) -> State:
        """New episodes.

        Args:
            keys: (B,) uint64, one a row: they fix field, track and every draw to come. With several targets a field
                has a row for each, one after the other, with one key.
        """
        keys = np.atleast_1d(_keys(keys))
        return self.restart(self.allocate(len(keys)), np.ones(len(keys), bool), keys, donate=True)[0]

    def allocate(self, rows: int) -> State:
        """Arrays for `restart` to begin episodes in."""
        rows, s = whole_number("rows", rows, 0), self.scenario
        if rows % s.targets:
            raise ValueError(f"rows = {rows}: must be a multiple of targets = {s.targets}")
        nodes, particles = s.field.nodes, self.tracker.particles
        reports = nodes * s.association.room_a_node(s.targets)
        lengths = dict(rows=rows, nodes=nodes, reports=reports, instants=s.periods + 1, particles=particles)
        if s.tracking.switches:
            lengths["switching"] = particles
        if not s.association.names_targets:
            lengths["unnamed"] = reports
        if self._faults.any:
            lengths["faulty"] = nodes
        side = Grid.side(nodes)
        state = State.zeros(**lengths, cells=side * side + 1, **s.measurement.axes(nodes))
        state.network.grid.row["side"] = side
        return state

    def restart(
        self, state: State, rows: npt.ArrayLike, keys: npt.ArrayLike, donate: bool = False
    ) -> tuple[State, Outcome]:
        """New episodes in some rows of a batch; the others stay, but for the ledger of their last period.

        Args:
            state: the batch.
            rows: (B,) bool, which to start anew.
            keys: (B,) uint64, read where `rows` is True.
            donate: reuse the given state's arrays.

        Returns: the state, and an outcome that holds the search of `start="search"` and zeros else.
        """
        _check_state(state)
        rows, keys = np.asarray(rows, dtype=bool), _keys(keys)
        if not rows.shape == keys.shape == (state.rows,):
            raise ValueError(f"rows {rows.shape} and keys {keys.shape}: must both be ({state.rows},)")
        if self.scenario.targets > 1:
            keys = self._keys_of_targets(rows, keys)
        state = state if donate else state.copy()
        outcome = _nothing_yet(state)
        threads = threads_for(rows, self.threads)
        self._tracks.draw(rows, keys, state.track, threads)
        over_rows(episode.begin, state.rows, threads, self._start, rows, keys, self._placed, state.handle)
        self._faults.strike(rows, state, threads)
        if self._packets is not None:
            self._packets.fill(rows, state, threads)
        self.tracker.start(state.key, state.period.copy(), rows, state.belief)
        if self.scenario.tracking.start == "search":
            self._search(rows, state, outcome)
        self._in_rows(rows, period.settle, outcome.row, state.handle)
        if self.scenario.measurement.lasting_errors:
            tracker: Any = self.tracker  # the particle filter: no other reads errors that last
            maps, belief = tracker.maps, state.belief
            self._in_rows(rows, period.predict_reports_of_rows, maps, belief.handle, state.network.positions)
        return state, outcome

    def _keys_of_targets(self, rows: np.ndarray, keys: np.ndarray) -> np.ndarray:
        """(B,) a key for each target, from one for each field."""
        targets = self.scenario.targets
        for what, values in (("rows", rows), ("keys", np.where(rows, keys, 0))):
            if (values.reshape(-1, targets) != values[::targets, None]).any():
                raise ValueError(f"{what}: must be the same in the {targets} rows of a field, its targets'")
        return draws.target_keys(keys, targets)

    def step(self, state: State, cluster: Cluster, donate: bool = False) -> tuple[State, Outcome]:
        """One sampling period for every row.

        Args:
            state: where the rows stand.
            cluster: the choice; dead or repeated members are dropped and counted, a dead head is replaced by the
                standing one or, if there is none, by the living node nearest to the prediction.
            donate: reuse the given state's arrays. Both give the same bits.

        Returns: the state after the period, and what it brought and cost.
        """
        _check_state(state)
        if not isinstance(cluster, Cluster):
            check_argument("cluster", cluster, Cluster)
        state = state if donate else state.copy()
        return state, self.advance(state, *choice_of(cluster, state))

    def advance(self, state: State, heads: np.ndarray, members: np.ndarray) -> Outcome:
        """`step` in place, for choices that need no check: what actions make.

        Args:
            state: where the rows stand, afterwards where they stand then.
            heads: (B,) int64, and
            members: (B, M) int32, both not read-only.
        """
        outcome = _nothing_yet(state)
        heads, members = np.ascontiguousarray(heads), np.ascontiguousarray(members)
        if members.shape[1] > LONG_LIST:  # kernels sort short lists
            members = np.sort(members, axis=1)
        # Handover and invitations; the target moves; members sense and report; the head predicts and corrects;
        # broadcast, costs, and the prediction for the next period, unless a row must search first.
        if isinstance(self.tracker, ParticleTracker):  # all in one compiled call
            arguments = self._constants, state.handle, self.tracker.maps, (heads, members), outcome.row
            searches = over_rows(self._run, len(heads), self.threads, *arguments, together=self.scenario.targets)
        else:
            self._over_rows(period.sense_and_report, heads, members, outcome.row, state.handle)
            resampled = np.zeros(state.rows, bool)
            self.tracker.correct(state.key, state.period.copy(), state.belief, state.network, state.reports, resampled)
            searches = self._over_rows(period.conclude, resampled, outcome.row, state.handle)
        if searches:
            lost = outcome.searched.copy()
            self._search(lost, state, outcome)
            self._in_rows(lost, period.settle, outcome.row, state.handle)
        if self.scenario.targets > 1:
            outcome.row["alive"] = state.living  # a target's own was before the others had spent
        return outcome

    def left(self, state: State) -> np.ndarray:
        """(B,) bool: the episode ends in this period, since the target is outside the field (`ends_outside`)."""
        _check_state(state)
        if not self.scenario.ends_outside:
            return np.zeros(state.rows, bool)
        instant = np.minimum(state.period, self.scenario.periods)
        target = state.track[np.arange(state.rows), instant, ::2]
        return (state.period > 0) & ((target < 0) | (target > self.scenario.field.room_m)).any(axis=1)

    def _search(self, rows, state: State, outcome: Outcome) -> None:
        found = np.zeros(state.rows, bool)
        self._in_rows(rows, search.search, found, outcome.row, state.handle)
        self.tracker.relocate(state.key, state.period.copy(), found, state.belief)

    def _over_rows(self, kernel, *arguments) -> int:
        together = self.scenario.targets
        return over_rows(kernel, len(arguments[0]), self.threads, self._constants, *arguments, together=together)

    def _in_rows(self, rows, kernel, *arguments) -> None:
        threads, together = threads_for(rows, self.threads), self.scenario.targets
        over_rows(kernel, len(rows), threads, self._constants, rows, *arguments, together=together)


def _check_state(state: State) -> None:
    if not isinstance(state, State):
        check_argument("state", state, State)


def _keys(keys: npt.ArrayLike) -> np.ndarray:
    """Keys as an array of uint64, of no dimension for one."""
    if isinstance(keys, np.ndarray) and keys.dtype == np.uint64:
        return keys
    wanted = np.asarray(keys, dtype=object)
    for key in wanted.flat:
        try:
            whole_number("keys", key, 0, 2**64 - 1)
        except ValueError:
            raise ValueError(f"keys = {short(repr(keys))}: must be whole numbers from 0 to 2^64 - 1") from None
    return wanted.astype(np.uint64)


def _nothing_yet(state: State) -> Outcome:
    return Outcome(blank(OUTCOME, state.rows), state.ledger.spent_j)


def choice_of(cluster: Cluster, state: State) -> tuple[np.ndarray, np.ndarray]:
    """Heads (B,) and members (B, M) as `advance` takes them.

    Raises:
        ValueError: what is no whole number, or not one row for each of the state's.
    """
    heads, members = cluster.check(state.rows)
    nodes = state.network.battery.shape[1]
    if heads.dtype.kind == "u":  # numbers that 63 bits would wrap are no nodes
        heads = np.minimum(heads.astype(np.uint64), np.uint64(nodes))
    if members.dtype != np.int32:  # nor those that 32 bits would
        members = np.where((members < -1) | (members > nodes), nodes, members)
    heads, members = heads.astype(np.int64, copy=False), members.astype(np.int32, copy=False)
    # Kernels are compiled for arrays that may be written to.
    return heads if heads.flags.writeable else heads.copy(), members if members.flags.writeable else members.copy()
