"""The world: reset, step and view, batch-first and pure. `World.step` is the whole story of a period."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from wsn_env import draws
from wsn_env.compiling import available_threads, kernel, over_rows, piece
from wsn_env.numerics import exp, log
from wsn_env.physics import radio, sensing
from wsn_env.physics.constants import constants
from wsn_env.physics.field import scatter, squared_distance, nearest_living
from wsn_env.physics.motion import draw_track, motion_parameters
from wsn_env.scenario import Scenario
from wsn_env.trackers import make_tracker
from wsn_env.types import PURPOSES, Belief, Cluster, Network, Outcome, Reports, State


class World:
    """A scenario brought to life. Holds no state of its own: every method is a function of its arguments."""

    def __init__(self, scenario: Scenario, threads: int | None = None):
        """Prepare a scenario.

        Args:
            scenario: what to simulate.
            threads: at most so many share a large batch; None: every core that the process may use. The bits of
                a result do not depend on it.
        """
        self.scenario = scenario
        self.threads = threads or available_threads()
        self.tracker = make_tracker(scenario, self.threads)
        self._constants = constants(scenario)
        self._motion = motion_parameters(scenario)

    def reset(self, keys) -> State:
        """New episodes.

        Args:
            keys: (B,) uint64, one a row: they fix field, track and every draw to come.
        """
        keys = np.atleast_1d(np.asarray(keys, dtype=np.uint64))
        state = empty_state(self.scenario, len(keys), self.tracker.particles)
        return self.restart(state, np.ones(len(keys), bool), keys, donate=True)[0]

    def restart(self, state: State, rows, keys, donate: bool = False) -> tuple[State, Outcome]:
        """New episodes in some rows of a batch; the others stay.

        Args:
            state: the batch.
            rows: (B,) bool, which to start anew.
            keys: (B,) uint64, read where `rows` is True.
            donate: reuse the given state's arrays.

        Returns: the state, and an outcome that holds the search of `start="search"` and zeros else.
        """
        rows, keys = np.asarray(rows, dtype=bool), np.asarray(keys, dtype=np.uint64)
        if not rows.shape == keys.shape == (state.rows,):
            raise ValueError(f"rows {rows.shape} and keys {keys.shape}: must both be ({state.rows},)")
        state = state if donate else state.copy()
        outcome = empty_outcome(state)
        self._over_rows(_begin, rows, keys, *self._motion, self._start, self._placed, state)
        self.tracker.start(state.key, state.period, rows, state.belief)
        if self.scenario.tracking.start == "search":
            self._search(state, rows.copy(), outcome)
        self._over_rows(_settle, rows, np.zeros(state.rows, bool), state, outcome)
        return state, outcome

    def step(self, state: State, cluster: Cluster, donate: bool = False) -> tuple[State, Outcome]:
        """One sampling period for every row.

        Args:
            state: where the rows stand.
            cluster: the choice; dead or repeated members are dropped and counted, a dead head is replaced by the
                standing one or, if there is none, by the living node nearest to the prediction.
            donate: reuse the given state's arrays. Both give the same bits.

        Returns: the state after the period, and what it brought and cost.
        """
        state = state if donate else state.copy()
        outcome = empty_outcome(state)
        rows = np.ones(state.rows, bool)
        resampled = np.zeros(state.rows, bool)
        heads, chosen = _choice(cluster, state.rows)

        self._over_rows(_sense_and_report, heads, chosen, state, outcome)
        self.tracker.correct(state.key, state.period, state.belief, state.network, state.reports, resampled)
        lost = np.empty(state.rows, bool)
        self._over_rows(_notice_loss, lost, state)
        if lost.any():
            self._search(state, lost, outcome)
        self._over_rows(_settle, rows, resampled, state, outcome)
        return state, outcome

    def _search(self, state: State, rows, outcome: Outcome) -> None:
        found = np.zeros(state.rows, bool)
        self._over_rows(_search, rows, found, state, outcome)
        self.tracker.relocate(state.key, state.period, found, state.belief)

    def _over_rows(self, kernel, *arguments) -> None:
        state = arguments[-1] if isinstance(arguments[-1], State) else arguments[-2]
        over_rows(kernel, state.rows, self.threads, self._constants, *arguments)

    @cached_property
    def _start(self) -> np.ndarray:
        """What `_begin` needs beside constants: P0, battery, lam, the seed of a fixed field."""
        s = self.scenario
        known = s.tracking.start == "known"
        record = np.zeros(
            1,
            [
                ("known", "i8"),
                ("sd_m", "f8"),
                ("sd_ms", "f8"),
                ("battery", "f8"),
                ("low", "f8"),
                ("high", "f8"),
                ("seeded", "i8"),
                ("field_key", "u8"),
            ],
        )
        record["known"] = known
        record["sd_m"] = s.tracking.start_sd_m if known else s.field.side_m / 12**0.5
        record["sd_ms"] = s.tracking.start_sd_ms if known else 1.0
        record["battery"] = s.radio.battery_j
        record["low"], record["high"] = s.lam_range
        if s.field.field_seed is not None:
            record["seeded"] = 1
            record["field_key"] = draws.key_of_seed(s.field.field_seed)
        return record

    @cached_property
    def _placed(self) -> np.ndarray:
        """The given nodes (S, 2); (0, 2) where they are drawn. An array of its own: a record's type holds its shape."""
        positions = self.scenario.field.positions
        return np.empty((0, 2)) if positions is None else np.array(positions)


def _choice(cluster: Cluster, rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Heads (B,) and members (B, M) as kernels take them; the members are a copy."""
    heads, members = np.ascontiguousarray(cluster.head, np.int64), np.array(cluster.members, np.int32, order="C")
    if heads.shape != (rows,) or members.ndim != 2 or len(members) != rows:
        raise ValueError(f"cluster has head {heads.shape}, members {members.shape}: must be ({rows},), ({rows}, M)")
    return heads, members


def empty_state(scenario: Scenario, rows: int, particles: int) -> State:
    """Zeros of the right shapes."""
    nodes = scenario.field.nodes
    return State(
        key=np.zeros(rows, np.uint64),
        period=np.zeros(rows, np.int64),
        lam=np.zeros(rows),
        track=np.zeros((rows, scenario.periods + 1, 4)),
        log_miss=np.zeros(rows),
        last_search=np.zeros(rows, np.int64),
        luck=np.zeros(rows, np.uint32),
        network=Network(
            positions=np.zeros((rows, nodes, 2)),
            battery=np.zeros((rows, nodes)),
            alive=np.zeros(rows, np.int64),
            head=np.zeros(rows, np.int64),
            members=np.zeros((rows, nodes), np.int32),
            n_members=np.zeros(rows, np.int64),
        ),
        reports=Reports(
            count=np.zeros(rows, np.int64), node=np.zeros((rows, nodes), np.int32), value=np.zeros((rows, nodes, 2))
        ),
        belief=Belief(
            mean=np.zeros((rows, 4)),
            cov=np.zeros((rows, 4, 4)),
            predicted_mean=np.zeros((rows, 4)),
            predicted_cov=np.zeros((rows, 4, 4)),
            n_eff=np.zeros(rows),
            particles=np.zeros((rows, 4, particles), np.float32),
            log_weights=np.zeros((rows, particles), np.float32),
        ),
    )


def empty_outcome(state: State) -> Outcome:
    """Zeros of the right shapes."""
    rows = state.rows
    return Outcome(
        error_m=np.zeros(rows),
        energy_j=np.zeros((rows, len(PURPOSES))),
        spent_j=np.zeros(state.network.battery.shape),
        members=np.zeros(rows, np.int64),
        detections=np.zeros(rows, np.int64),
        delivered=np.zeros(rows, np.int64),
        dropped=np.zeros(rows, np.int64),
        handover=np.zeros(rows, np.int64),
        searched=np.zeros(rows, np.int64),
        resampled=np.zeros(rows, np.int64),
        alive=np.zeros(rows, np.int64),
        posterior_rms_m=np.zeros(rows),
        target_m=np.zeros((rows, 2)),
        estimate_m=np.zeros((rows, 2)),
    )


# --- the parts of a period, a row at a time -----------------------------------------------------------------


@kernel
def _begin(start, stop, cs, rows, keys, motion, numbers, recordings, starts, placed, state):
    """Field, track, batteries, lam and the first belief of new episodes."""
    c, s = cs[0], starts[0]
    for b in range(start, stop):
        if not rows[b]:
            continue
        key = keys[b]
        state.key[b] = key
        state.period[b] = 0
        state.log_miss[b] = 0.0
        state.last_search[b] = -c.search_gap
        state.lam[b] = s.low
        if s.high > s.low:
            ratio = log(s.high / s.low)
            state.lam[b] = s.low * exp(ratio * draws.uniform(draws.stream(key, 0, draws.LAM), 0))
        network = state.network
        if len(placed) > 0:
            network.positions[b] = placed
        else:
            scatter(draws.stream(s.field_key if s.seeded else key, 0, draws.FIELD), c.side_m, network.positions[b])
        network.battery[b] = s.battery
        network.alive[b] = len(network.battery[b])
        network.head[b] = -1
        network.n_members[b] = 0
        state.reports.count[b] = 0
        state.belief.n_eff[b] = state.belief.particles.shape[2]
        track_stream = draws.stream(key, 0, draws.TRACK)
        draw_track(motion, numbers, recordings, track_stream, c.period_s, c.side_m, state.track[b])
        _first_belief(draws.stream(key, 0, draws.START), state.track[b, 0], s, c, state.belief.mean[b], state.belief.cov[b])


@piece
def _first_belief(stream, truth, s, c, mean, cov):
    """start="known": mean ~ N(truth, P0), cov = P0; start="search": the whole field, at rest."""
    cov[:] = 0.0
    for axis in range(4):
        cov[axis, axis] = s.sd_m**2 if axis % 2 == 0 else s.sd_ms**2
    if s.known:
        ex, ey = draws.normal_pair(stream, 0)
        evx, evy = draws.normal_pair(stream, 1)
        mean[0] = truth[0] + s.sd_m * ex
        mean[1] = truth[1] + s.sd_ms * evx
        mean[2] = truth[2] + s.sd_m * ey
        mean[3] = truth[3] + s.sd_ms * evy
    else:
        mean[:] = 0.0
        mean[0] = 0.5 * c.side_m
        mean[2] = 0.5 * c.side_m


@kernel
def _sense_and_report(start, stop, cs, heads, chosen, state, outcome):
    """From the choice to the reports: cluster, target, detections, packets, and what was missed."""
    c = cs[0]
    network, reports = state.network, state.reports
    for b in range(start, stop):
        state.period[b] += 1
        _take_choice(heads[b], chosen[b], network, state.belief, outcome, b, c)  # handover, invitations [J]
        target = state.track[b, min(state.period[b], state.track.shape[1] - 1)]  # the target moves
        reports.count[b] = 0
        head = network.head[b]
        if head >= 0:
            # Nodes sense and report in the order of their numbers, the head among them.
            n = network.n_members[b]
            k = 0
            head_done = False
            while k < n or not head_done:
                if not head_done and (k == n or head < network.members[b, k]):
                    node = head
                    head_done = True
                else:
                    node = network.members[b, k]
                    k += 1
                _sense(node, head, radio.SENSING, radio.REPORT, target, state, outcome, b, c)
        _remember_miss(state, b, c)


@piece
def _take_choice(head, chosen, network, belief, outcome, b, c):
    """Drop what cannot serve, then form the cluster."""
    battery = network.battery[b]
    wanted = 0
    for node in chosen:
        wanted += node != -1
    valid_head = 0 <= head < len(battery) and battery[head] > 0.0
    if not valid_head:
        outcome.dropped[b] += head != -1
        head = network.head[b]
        if head < 0 or battery[head] <= 0.0:
            head = nearest_living(
                network.positions[b], battery, belief.predicted_mean[b, 0], belief.predicted_mean[b, 2]
            )
    count = radio.standing_members(chosen, battery)
    outcome.dropped[b] += wanted - count
    if head < 0:  # nobody is alive
        network.head[b] = -1
        network.n_members[b] = 0
        return
    kept = 0
    for k in range(count):
        if chosen[k] != head:
            chosen[kept] = chosen[k]
            kept += 1
    handed = radio.form(head, chosen, kept, network, b, outcome.spent_j[b], outcome.energy_j[b], c)
    outcome.handover[b] = handed
    outcome.members[b] = 1 + network.n_members[b]


@piece
def _sense(node, head, sensing_purpose, report_purpose, target, state, outcome, b, c):
    """One awake node's period: pay for sensing, detect, measure, report. Returns whether it detected."""
    network, reports = state.network, state.reports
    positions, battery = network.positions[b], network.battery[b]
    spent, energy = outcome.spent_j[b], outcome.energy_j[b]
    if battery[node] <= 0.0 or not radio.spend(node, c.sensing_j, sensing_purpose, battery, spent, energy):
        return False
    distance = np.sqrt(squared_distance(positions, node, target[0], target[2]))
    if not sensing.detects(state.key[b], state.period[b], node, distance, c):
        return False
    outcome.detections[b] += 1
    if battery[head] > 0.0 and radio.report(
        state.key[b], state.period[b], node, head, report_purpose, positions, battery, spent, energy, c
    ):
        slot = reports.count[b]
        reports.node[b, slot] = node
        sensing.measure(state.key[b], state.period[b], node, positions, target, c, reports.value[b, slot])
        reports.count[b] += 1
    return True


@piece
def _remember_miss(state, b, c):
    """How improbable the silence since the last report is, seen from the belief."""
    network, belief = state.network, state.belief
    if state.reports.count[b] > 0:
        state.log_miss[b] = 0.0
    else:
        state.log_miss[b] += sensing.log_miss_probability(
            belief.predicted_mean[b],
            belief.predicted_cov[b],
            network.positions[b],
            network.members[b],
            network.n_members[b],
            network.head[b],
            c,
        )


@kernel
def _notice_loss(start, stop, cs, lost, state):
    """The search rule: too long a silence, or a belief wider than a node's radius; not twice within the gap."""
    c = cs[0]
    for b in range(start, stop):
        cov = state.belief.cov[b]
        wide = max(cov[0, 0], cov[2, 2]) > c.radius_m * c.radius_m
        rested = state.period[b] - state.last_search[b] >= c.search_gap
        someone = state.network.alive[b] > 0
        lost[b] = c.search and rested and someone and (wide or state.log_miss[b] < c.log_search_miss)


@kernel
def _search(start, stop, cs, rows, found, state, outcome):
    """Every living node wakes for the period; the belief's position restarts at the centroid of those that detect."""
    c = cs[0]
    for b in range(start, stop):
        if rows[b]:
            outcome.searched[b] = 1
            state.last_search[b] = state.period[b]
            found[b] = _search_row(state, outcome, b, c)


@piece
def _search_row(state, outcome, b, c):
    network, reports = state.network, state.reports
    positions, battery = network.positions[b], network.battery[b]
    spent, energy = outcome.spent_j[b], outcome.energy_j[b]
    target = state.track[b, min(state.period[b], state.track.shape[1] - 1)]

    # Wake-up, and the strongest signal among those that detect: the nearest, or what was measured.
    value = np.empty(2)
    strongest, best = -1, -np.inf
    for node in range(len(battery)):
        if battery[node] > 0.0 and radio.spend(
            node, c.wakeup_bits * c.rx_j_per_bit, radio.SEARCH, battery, spent, energy
        ):
            squared = squared_distance(positions, node, target[0], target[2])
            if sensing.detects(state.key[b], state.period[b], node, np.sqrt(squared), c):
                signal = -squared
                if c.model != 0:
                    sensing.measure(state.key[b], state.period[b], node, positions, target, c, value)
                    signal = value[0]
                if battery[node] > 0.0 and signal > best:
                    strongest, best = node, signal
    if strongest < 0:
        return False

    # The new head takes over (the velocity is handed to it) and hears the others.
    outcome.handover[b] |= radio.form(strongest, np.empty(0, np.int32), 0, network, b, spent, energy, c)
    reports.count[b] = 0
    for node in range(len(battery)):
        _sense(node, strongest, radio.SEARCH, radio.SEARCH, target, state, outcome, b, c)
    heard = reports.count[b]
    if heard == 0:
        return False
    x, y = 0.0, 0.0
    for k in range(heard):
        x += positions[reports.node[b, k], 0]
        y += positions[reports.node[b, k], 1]
    mean, cov = state.belief.mean[b], state.belief.cov[b]
    mean[0], mean[2] = x / heard, y / heard
    for axis in (0, 2):
        cov[axis, :] = 0.0
        cov[:, axis] = 0.0
        cov[axis, axis] = c.radius_m * c.radius_m / heard
    state.log_miss[b] = 0.0
    return True


@kernel
def _settle(start, stop, cs, rows, resampled, state, outcome):
    """The last of a period: broadcast, the dead, costs, and the prediction for the next (eq. 16)."""
    c = cs[0]
    network, belief = state.network, state.belief
    for b in range(start, stop):
        if not rows[b]:
            continue
        battery, head = network.battery[b], network.head[b]
        if resampled[b] and head >= 0:
            outcome.resampled[b] = 1
            count = network.n_members[b]
            radio.broadcast(
                head, network.members[b], count, network.positions[b], battery, outcome.spent_j[b], outcome.energy_j[b], c
            )
        _bury(network, outcome, b)
        mean, cov = belief.mean[b], belief.cov[b]
        target = state.track[b, min(state.period[b], state.track.shape[1] - 1)]
        outcome.target_m[b, 0], outcome.target_m[b, 1] = target[0], target[2]
        outcome.estimate_m[b, 0], outcome.estimate_m[b, 1] = mean[0], mean[2]
        outcome.error_m[b] = np.sqrt((mean[0] - target[0]) ** 2 + (mean[2] - target[2]) ** 2)
        outcome.posterior_rms_m[b] = np.sqrt(cov[0, 0] + cov[2, 2])
        outcome.delivered[b] = state.reports.count[b]
        outcome.alive[b] = network.alive[b]
        luck = draws.bits(draws.stream(state.key[b], state.period[b], draws.POLICY), 0)
        state.luck[b] = np.uint32(luck >> np.uint64(32))
        predict_moments(mean, cov, c.period_s, c.q, belief.predicted_mean[b], belief.predicted_cov[b])


@piece
def _bury(network, outcome, b):
    """Count who died of this period's costs, and take the dead out of the cluster."""
    battery = network.battery[b]
    if not outcome.energy_j[b].any():
        return
    for node in range(len(battery)):
        network.alive[b] -= outcome.spent_j[b, node] > 0.0 and battery[node] <= 0.0
    if network.head[b] >= 0 and battery[network.head[b]] <= 0.0:
        network.head[b] = -1
        network.n_members[b] = 0
    network.n_members[b] = radio.standing_members(network.members[b, : network.n_members[b]], battery)


@piece
def predict_moments(mean, cov, t, q, predicted_mean, predicted_cov):
    """F x and F P F' + q^2 G G' (eq. 16).

    Differs from the paper: as printed, eq. 16 leaves out the spread of the particles, so that E would be constant.
    """
    for i in range(4):
        predicted_mean[i] = mean[i] + (t * mean[i + 1] if i % 2 == 0 else 0.0)
        for j in range(4):
            p = cov[i, j]
            if i % 2 == 0:
                p += t * cov[i + 1, j]
            if j % 2 == 0:
                p += t * cov[i, j + 1]
                if i % 2 == 0:
                    p += t * t * cov[i + 1, j + 1]
            predicted_cov[i, j] = p
    gain = (0.5 * t * t, t)
    for axis in (0, 2):
        for i in range(2):
            for j in range(2):
                predicted_cov[axis + i, axis + j] += q * q * gain[i] * gain[j]
