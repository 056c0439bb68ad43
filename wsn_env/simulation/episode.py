"""How an episode begins: field, track, batteries, lam and the first belief, all by key."""

import numpy as np

from wsn_env.compiled import draws
from wsn_env.compiled.arrays import record
from wsn_env.compiled.elementary import exp, log
from wsn_env.compiled.kernels import kernel, piece
from wsn_env.models.field import lay_out, scatter
from wsn_env.models.motion.modes import LONG_RUN
from wsn_env.models.quantity import span
from wsn_env.models.state import state_at
from wsn_env.scenario import Scenario
from wsn_env.simulation.geometry import index_nodes
from wsn_env.simulation.lifetime import clear_life
from wsn_env.simulation.messages import clear_ledger

START = record(
    [
        ("known", "i8"),  # 1: the first belief is about the truth
        ("searches", "i8"),  # 1: a search in period 0
        ("sd_m", "f8"),
        ("sd_ms", "f8"),
        ("battery_j", "f8", 2),  # lowest and highest, between which an episode's is drawn
        ("lam", "f8", 2),
        ("seeded", "i8"),
        ("field_key", "u8"),
        ("grid", "i8"),
        ("jitter", "f8"),
        ("side_m", "f8"),
        ("depth_m", "f8"),
        ("search_gap", "i8"),
        ("targets", "i8"),
    ]
)


def start_record(scenario: Scenario) -> np.ndarray:
    """What `begin` needs, an array of one: P0, battery, lam, layout and extent, the seed of a fixed field."""
    known = scenario.tracking.start == "known"
    made = np.zeros(1, START)
    made["known"], made["searches"] = known, scenario.tracking.start == "search"
    made["sd_m"] = scenario.tracking.start_sd_m if known else scenario.field.side_m / 12**0.5
    made["sd_ms"] = scenario.tracking.start_sd_ms if known else scenario.tracking.rest_sd_ms
    made["battery_j"], made["lam"] = span(scenario.radio.battery_j), scenario.lam_range
    made["side_m"], made["depth_m"] = scenario.field.room_m
    made["search_gap"], made["targets"] = scenario.tracking.search_gap, scenario.targets
    made["grid"], made["jitter"] = scenario.field.layout == "grid", scenario.field.jitter
    if scenario.field.field_seed is not None:
        made["seeded"] = 1
        made["field_key"] = draws.key_of_seed(scenario.field.field_seed)
    return made


def placed_nodes(scenario: Scenario) -> np.ndarray:
    """The given nodes (S, 2) [m]; (0, 2) where they are drawn."""
    positions = scenario.field.positions
    return np.empty((0, 2)) if positions is None else np.array(positions)


@kernel
def begin(
    start: int,
    stop: int,
    starts: np.ndarray,
    rows: np.ndarray,
    keys: np.ndarray,
    placed: np.ndarray,
    handle: np.ndarray,
) -> None:
    """Field, batteries, lam and the first belief of new episodes, whose tracks have been drawn.

    What the targets of a field share is drawn by the key of the first.
    """
    state, s = state_at(handle), starts[0]
    for b in range(start, stop):
        clear_ledger(state.ledger, b)
        if not rows[b]:
            continue
        key, row, network, belief = keys[b], state.row[b], state.network, state.belief.row[b]
        shared = keys[b - b % s.targets]
        state.key[b] = key
        row.period = 0
        row.log_miss = 0.0
        row.last_search = -s.search_gap
        row.lam = _draw_between(s.lam, shared, draws.LAM)
        row.full_j = _draw_between(s.battery_j, shared, draws.BATTERY)
        if len(placed) > 0:
            for i in range(len(placed)):
                network.positions[b, i, 0], network.positions[b, i, 1] = placed[i, 0], placed[i, 1]
        else:
            field_stream = draws.stream(s.field_key if s.seeded else shared, 0, draws.FIELD)
            if s.grid:
                lay_out(field_stream, s.side_m, s.jitter, network.positions[b])
            else:
                scatter(field_stream, s.side_m, network.positions[b])
        index_nodes(network.positions[b], network.grid, b)
        state.residual_j[b] = row.full_j
        state.living[b] = network.battery.shape[1]
        network.battery[b] = row.full_j
        network.row[b].alive = network.battery.shape[1]
        network.row[b].left_j = network.battery.shape[1] * row.full_j
        network.row[b].head = -1
        network.row[b].n_members = 0
        clear_life(state, b)
        state.sensed[b] = 0
        row.targets = s.targets
        state.reports.count[b] = 0
        state.reports.bitmap[b] = 0
        belief.surprise = 1.0
        belief.mode_probabilities[:] = LONG_RUN
        belief.n_eff = state.belief.particles.shape[2]
        _first_belief(draws.stream(key, 0, draws.START), state.track[b, 0], s, belief.mean, belief.cov)
        for axis in range(4):  # where a first search takes the target to be
            belief.predicted_mean[axis] = belief.mean[axis]


@piece
def _draw_between(span, key, purpose):
    """Log-uniformly, by key."""
    low, high = span[0], span[1]
    if high > low:
        return low * exp(log(high / low) * draws.uniform(draws.stream(key, 0, purpose), 0))
    return low


@piece
def _first_belief(stream, truth, s, mean, cov):
    """start="known": mean ~ N(truth, P0), cov = P0; the other starts: the whole field, at rest."""
    cov[:] = 0.0
    for axis in range(4):
        cov[axis, axis] = s.sd_m**2 if axis % 2 == 0 else s.sd_ms**2
    if not s.known:
        cov[2, 2] = (s.sd_m * s.depth_m / s.side_m) ** 2
    if s.known:
        ex, ey = draws.normal_pair(stream, 0)
        evx, evy = draws.normal_pair(stream, 1)
        mean[0] = truth[0] + s.sd_m * ex
        mean[1] = truth[1] + s.sd_ms * evx
        mean[2] = truth[2] + s.sd_m * ey
        mean[3] = truth[3] + s.sd_ms * evy
    else:
        mean[:] = 0.0
        mean[0] = 0.5 * s.side_m
        mean[2] = 0.5 * s.depth_m
