"""How an episode begins: field, track, batteries, lam and the first belief, all by key."""

import numpy as np

from wsn_env.compiled import draws
from wsn_env.compiled.elementary import exp, log
from wsn_env.compiled.kernels import kernel, piece
from wsn_env.models.physics.beacon import beacon_record, draw_packets, receivers_of, recorded_packets
from wsn_env.models.physics.field import index_nodes, lay_out, scatter
from wsn_env.models.physics.motion import draw_track
from wsn_env.models.physics.radio import close_books
from wsn_env.scenario import Scenario

START = np.dtype(
    [
        ("known", "i8"),
        ("sd_m", "f8"),
        ("sd_ms", "f8"),
        ("battery", "f8"),
        ("low", "f8"),
        ("high", "f8"),
        ("seeded", "i8"),
        ("field_key", "u8"),
        ("grid", "i8"),
        ("jitter", "f8"),
    ]
)


def start_record(scenario: Scenario) -> np.ndarray:
    """What `begin` needs beside the constants, an array of one: P0, battery, lam, layout, the seed of a fixed field."""
    known = scenario.tracking.start == "known"
    record = np.zeros(1, START)
    record["known"] = known
    record["sd_m"] = scenario.tracking.start_sd_m if known else scenario.field.side_m / 12**0.5
    record["sd_ms"] = scenario.tracking.start_sd_ms if known else scenario.tracking.rest_sd_ms
    record["battery"] = scenario.radio.battery_j
    record["low"], record["high"] = scenario.lam_range
    record["grid"], record["jitter"] = scenario.field.layout == "grid", scenario.field.jitter
    if scenario.field.field_seed is not None:
        record["seeded"] = 1
        record["field_key"] = draws.key_of_seed(scenario.field.field_seed)
    return record


def placed_nodes(scenario: Scenario) -> np.ndarray:
    """The given nodes (S, 2) [m]; (0, 2) where they are drawn."""
    positions = scenario.field.positions
    return np.empty((0, 2)) if positions is None else np.array(positions)


def beacon_of(scenario: Scenario) -> tuple[np.ndarray, ...]:
    """What `begin` needs of a beacon: its record, its receivers (S, 3), recorded packets; empty where there is none."""
    return beacon_record(scenario), receivers_of(scenario), recorded_packets(scenario)


@kernel
def begin(
    start, stop, cs, rows, keys, motion, numbers, recordings, starts, placed, beacons, receivers, recorded, state
):
    """Field, track, batteries, lam and the first belief of new episodes."""
    c, s = cs[0], starts[0]
    for b in range(start, stop):
        close_books(state.ledger, b)
        if not rows[b]:
            continue
        key, row, network, belief = keys[b], state.row[b], state.network, state.belief.row[b]
        state.key[b] = key
        row.period = 0
        row.log_miss = 0.0
        row.last_search = -c.search_gap
        row.lam = s.low
        if s.high > s.low:
            row.lam = s.low * exp(log(s.high / s.low) * draws.uniform(draws.stream(key, 0, draws.LAM), 0))
        if len(placed) > 0:
            network.positions[b] = placed
        else:
            field_stream = draws.stream(s.field_key if s.seeded else key, 0, draws.FIELD)
            if s.grid:
                lay_out(field_stream, c.side_m, s.jitter, network.positions[b])
            else:
                scatter(field_stream, c.side_m, network.positions[b])
        index_nodes(network.positions[b], network.grid, b)
        network.battery[b] = s.battery
        network.row[b].alive = network.battery.shape[1]
        network.row[b].head = -1
        network.row[b].n_members = 0
        state.sensed[b] = 0
        state.reports.count[b] = 0
        state.reports.bitmap[b] = 0
        belief.n_eff = state.belief.particles.shape[2]
        track_stream = draws.stream(key, 0, draws.TRACK)
        draw_track(motion, numbers, recordings, track_stream, c.period_s, c.side_m, c.depth_m, state.track[b])
        if len(receivers) > 0:
            if len(recorded) > 0:
                state.packets[b] = recorded
            else:
                at = network.positions[b], receivers, c.period_s, beacons[0]
                draw_packets(key, state.track[b], *at, state.packets[b])
            _know_nothing(receivers, c, state.belief.receivers[b], state.belief.biases[b])
        _first_belief(draws.stream(key, 0, draws.START), state.track[b, 0], s, c, belief.mean, belief.cov)
        belief.predicted_mean[:] = belief.mean  # where a first search takes the target to be


@piece
def _know_nothing(receivers, c, known, biases):
    for j in range(len(receivers)):
        known[j].at_1m_db, known[j].slope, known[j].height_m2 = receivers[j, 0], receivers[j, 1], receivers[j, 2]
        known[j].bias_variance = c.bias_variance
        known[j].latest_db = 0.0
    biases[:] = np.float32(0.0)


@piece
def _first_belief(stream, truth, s, c, mean, cov):
    """start="known": mean ~ N(truth, P0), cov = P0; the other starts: the whole field, at rest."""
    cov[:] = 0.0
    for axis in range(4):
        cov[axis, axis] = s.sd_m**2 if axis % 2 == 0 else s.sd_ms**2
    if not s.known:
        cov[2, 2] = (s.sd_m * c.depth_m / c.side_m) ** 2
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
        mean[2] = 0.5 * c.depth_m
