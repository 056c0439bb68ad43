"""A beacon's packets: an episode's are drawn at its start, as its track is, or they are those of a recording.

What a receiver would hear in a period does so not depend on who listened before, and what is simulated and what is
recorded go the same way from there.
"""

import math
from typing import Any

import numpy as np

from wsn_env.compiled import draws
from wsn_env.compiled.arrays import record
from wsn_env.compiled.elementary import HALF_PI, F, cos_turns32, exp, log
from wsn_env.compiled.kernels import kernel, over_rows, piece
from wsn_env.models.state import state_at

WAVES = 64  # that make a receiver's static field
SHORTEST = 1e-3  # correlation lengths: shorter waves are white noise to everything here
PER_NEPER = 10.0 / math.log(10.0)

SETTINGS = (
    "field_db field_m drift_db drift_s main_db main_sd_db fade_share fade_db fade_sd_db loss loss_after_loss"
    " loss_after_none interval_s floor_m bias_db"
).split()
BEACON_RECORD = record([(name, "f8") for name in (*SETTINGS, "period_s")])


class Packets:
    """Fills an episode's packets into a state, and what the tracker knows of the receivers."""

    def __init__(self, beacon: Any, scenario: Any) -> None:
        self._beacon = np.zeros(1, BEACON_RECORD)
        for name in SETTINGS:
            self._beacon[name] = getattr(beacon, name)
        self._beacon["period_s"] = scenario.period_s
        self._receivers = beacon.of_nodes(scenario.field.nodes)
        self._receivers[:, 1] *= 0.5 * PER_NEPER
        self._recorded = scenario.motion.recorded_packets(scenario)

    def fill(self, rows: np.ndarray, state: Any, threads: int) -> None:
        """Begin episodes in the rows marked (B,)."""
        own = self._beacon, self._receivers, self._recorded
        over_rows(_fill, len(rows), threads, *own, rows, state.handle)


@kernel
def _fill(start, stop, beacons, receivers, recorded, rows, handle):
    state, c = state_at(handle), beacons[0]
    for b in range(start, stop):
        if not rows[b]:
            continue
        if len(recorded) > 0:
            state.packets[b] = recorded
        else:
            positions = state.network.positions[b]
            draw_packets(state.key[b], state.track[b], positions, receivers, c, state.packets[b])
        for j in range(len(receivers)):
            own = state.belief.receivers[b, j]
            own.at_1m_db, own.slope, own.height_m2 = receivers[j, 0], receivers[j, 1], receivers[j, 2]
            own.bias_variance = c.bias_db * c.bias_db
            own.latest_db = 0.0
        state.belief.biases[b] = np.float32(0.0)


@piece
def draw_packets(
    key: Any, track: np.ndarray, positions: np.ndarray, receivers: np.ndarray, c: Any, packets: np.ndarray
) -> None:
    """Fill packets (periods + 1, S, 2) with the mean level and the number of those heard about the end of each period.

    A period's packets are those of half a period before its end to half a period after, so that they were sent about
    where the target is taken to be.

    Args:
        track: (periods + 1, 4) true states.
        c: BEACON_RECORD.
    """
    periods = len(track) - 1
    sent = int((periods + 0.5) * c.period_s / c.interval_s) + 1
    phase = draws.uniform(draws.stream(key, 0, draws.BEACON_NOISE), 0)
    x, y, when = np.empty(sent, np.float32), np.empty(sent, np.float32), np.empty(sent, np.int64)
    for e in range(sent):
        place = (e + phase) * c.interval_s / c.period_s
        k = min(int(place), periods - 1)
        share = min(place - k, 1.0)
        x[e] = track[k, 0] + share * (track[k + 1, 0] - track[k, 0])
        y[e] = track[k, 2] + share * (track[k + 1, 2] - track[k, 2])
        when[e] = int(place + 0.5)
    packets[:] = 0.0
    field = np.empty(sent, np.float32)
    kept = exp(-c.interval_s / c.drift_s)
    fresh = c.drift_db * np.sqrt(1.0 - kept * kept)
    for j in range(len(receivers)):
        _draw_field(draws.stream(key, j, draws.BEACON_FIELD), x, y, c, field)
        drifts = draws.stream(key, j, draws.BEACON_DRIFT)
        noises, losses = draws.stream(key, j + 1, draws.BEACON_NOISE), draws.stream(key, j, draws.BEACON_LOSS)
        drift = c.drift_db * draws.normal_pair(drifts, 0)[0]
        chance = c.loss
        for e in range(sent):
            if e > 0:
                drift = kept * drift + fresh * draws.normal_pair(drifts, e)[0]
            lost = draws.uniform(losses, e) < chance
            chance = c.loss_after_loss if lost else c.loss_after_none
            if lost or not 0 < when[e] <= periods:
                continue
            dx, dy = x[e] - positions[j, 0], y[e] - positions[j, 1]
            squared = max(dx * dx + dy * dy + receivers[j, 2], c.floor_m * c.floor_m)
            normal, _ = draws.normal_pair(noises, 2 * e)
            if draws.uniform(noises, 4 * e + 2) < c.fade_share:
                white = c.fade_db + c.fade_sd_db * normal
            else:
                white = c.main_db + c.main_sd_db * normal
            heard = np.floor(receivers[j, 0] - receivers[j, 1] * log(squared) + field[e] + drift + white + 0.5)
            packets[when[e], j, 0] += np.float32(heard)
            packets[when[e], j, 1] += np.float32(1.0)
        for k in range(periods + 1):
            packets[k, j, 0] /= max(packets[k, j, 1], np.float32(1.0))


@piece
def _draw_field(stream, x, y, c, field):
    """A Gaussian field of covariance sd^2 exp(-d / l) at the points: WAVES cosines, whose wave vectors follow the
    covariance's spectrum, a Cauchy distribution in the plane."""
    field[:] = F(0)
    amplitude = F(c.field_db * np.sqrt(2.0 / WAVES))
    for f in range(WAVES if c.field_db > 0.0 else 0):
        u, v = draws.normal_pair(stream, 2 * f)
        scale, _ = draws.normal_pair(stream, 2 * f + 1)
        turns = 1.0 / (4.0 * HALF_PI * c.field_m * max(abs(scale), SHORTEST))
        a, b, phase = F(u * turns), F(v * turns), F(draws.uniform(stream, 4 * WAVES + f))
        for e in range(len(x)):
            field[e] += amplitude * cos_turns32(a * x[e] + b * y[e] + phase)
