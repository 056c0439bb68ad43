"""A beacon's levels in the particle filter: a bias for every receiver.

Each receiver's level is off the mean of its distance by a bias, which lasts for seconds (the place, people, the way
that the beacon is held). Every particle carries the mean of each bias, given its own path, and all share its variance,
so that position is sampled and biases are filtered exactly (Rao and Blackwell). Without them a filter takes every
second's level for news, and is surer than it may be by a factor of three in the variance.
"""

from typing import Any

import numpy as np

from wsn_env.compiled.arrays import record
from wsn_env.compiled.elementary import F, exp32, log32
from wsn_env.compiled.kernels import lean_piece, piece
from wsn_env.models.recordings.replay import CELL_M

LANES = 16  # as in filters.kernels

RECEIVER = record(
    [
        ("at_1m_db", "f8"),  # its mean level: at_1m_db - slope ln(d^2 + height_m2)
        ("slope", "f8"),
        ("height_m2", "f8"),
        ("bias_variance", "f8"),  # of its level about the mean, beside the packets' own noise, alike for all particles
        ("latest_db", "f8"),  # last heard; SILENT_DB if it has listened since in vain; 0 before it ever has
        ("gradient", "f8", 2),  # of the level to come by position, over the predicted belief [dB/m]
        ("variance", "f8"),  # of what it should report, about that [dB^2]
    ]
)
SILENT_DB = -95.0


@lean_piece
def weigh_levels(m: Any, head: Any, maps: np.ndarray, scratch: Any) -> None:
    """Add the tempered log likelihoods of the reported levels, and correct the biases by them.

    Args:
        m: the beacon's constants.
        head: AtHead.
        maps: (S, nx, ny) dB to add to the mean level by cells of the hall; (0, 0, 0): nothing.
        scratch: (P,) float32.
    """
    belief, network, reports, b = head
    x, log_weights = belief.particles[b], belief.log_weights[b]
    receivers, biases, positions, n = belief.receivers[b], belief.biases[b], network.positions[b], x.shape[1]
    for j in range(len(receivers)):
        kept, fade = m.bias_kept, F(m.bias_kept)
        receivers[j].bias_variance = kept * kept * receivers[j].bias_variance + (1.0 - kept * kept) * m.bias_variance
        own = biases[j]
        for i in range(n):
            own[i] *= fade
    _note_silence(receivers, network, b)
    floor = F(m.floor_m * m.floor_m)
    for k in range(reports.count[b]):
        node = reports.node[b, k]
        receiver, own, level = receivers[node], biases[node], F(reports.value[b, k, 0])
        variance = receiver.bias_variance + m.white_variance / reports.value[b, k, 1]
        share = receiver.bias_variance / variance
        gain, half = F(share), F(0.5 * m.temper / variance)
        offset = level - F(receiver.at_1m_db)
        expect_fall(x[0], x[2], positions[node], receiver, floor, scratch)
        if len(maps) > 0:
            add_map(x[0], x[2], maps[node], scratch)
        for i in range(n):
            r = offset - scratch[i] - own[i]
            log_weights[i] -= half * (r * r)
            own[i] += gain * r
        receiver.bias_variance *= 1.0 - share
        receiver.latest_db = reports.value[b, k, 0]


@lean_piece
def expect_fall(px: np.ndarray, py: np.ndarray, position: Any, receiver: Any, floor: Any, fall: Any) -> None:
    """fall (P,): mean levels at a receiver less that at 1 m, of particles at (px, py)."""
    sx, sy, slope, height = F(position[0]), F(position[1]), F(receiver.slope), F(receiver.height_m2)
    for i in range(len(px)):
        dx, dy = px[i] - sx, py[i] - sy
        fall[i] = -slope * log32(max(dx * dx + dy * dy + height, floor))


@lean_piece
def add_map(px: np.ndarray, py: np.ndarray, own_map: np.ndarray, fall: Any) -> None:
    """Add what a map says of the particles' cells; outside of it, of the nearest one."""
    per_m = F(1.0 / CELL_M)
    last_x, last_y = own_map.shape[0] - 1, own_map.shape[1] - 1
    for i in range(len(px)):
        fall[i] += own_map[min(max(int(px[i] * per_m), 0), last_x), min(max(int(py[i] * per_m), 0), last_y)]


@lean_piece
def _note_silence(receivers, network, b):
    """Who listens and is not heard from is taken for weak; a report that came sets its level after this."""
    standing = network.row[b]
    for k in range(-1, standing.n_members):
        node = standing.head if k < 0 else network.members[b, k]
        if node >= 0:
            receivers[node].latest_db = min(receivers[node].latest_db, SILENT_DB)


@lean_piece
def draw_biases(biases: np.ndarray, ancestors: np.ndarray, scratch: Any) -> None:
    """Give every particle its ancestor's biases."""
    for j in range(len(biases)):
        own = biases[j]
        for i in range(len(ancestors)):
            scratch[i] = own[ancestors[i]]
        for i in range(len(ancestors)):
            own[i] = scratch[i]


@piece
def predict_levels(
    m: Any, way_s: float, belief: Any, positions: np.ndarray, b: int, maps: np.ndarray, scratch: Any
) -> None:
    """What each receiver should report in the period to come, as a line over the predicted positions.

    The weighted covariances of position and level over the particles, moved on without noise, give the regression

        level = mean + gradient . (position - mean) + e,    e of variance `variance`

    (statistical linearisation), to which the bias and the packets' own noise add theirs. It holds for beliefs of any
    shape, where a derivative at the mean would not.

    Args:
        way_s: how far a particle goes on for each m/s [s].
        positions: (S, 2) of the receivers [m].
        maps, scratch: as for `weigh_levels`.
    """
    x, log_weights, receivers, biases = (
        belief.particles[b],
        belief.log_weights[b],
        belief.receivers[b],
        belief.biases[b],
    )
    mean, n = belief.row[b].predicted_mean, x.shape[1]
    way = F(way_s)
    x0, y0 = F(mean[0]), F(mean[2])  # differences from about the mean lose nothing in float32
    kept, floor = F(m.bias_kept), F(m.floor_m * m.floor_m)
    points, lanes, s = np.empty((5, n), np.float32), np.empty((6, LANES), np.float32), np.empty(6)
    for i in range(n):
        points[0, i] = exp32(log_weights[i])
        points[3, i] = x[0, i] + way * x[1, i]
        points[4, i] = x[2, i] + way * x[3, i]
        points[1, i] = points[3, i] - x0
        points[2, i] = points[4, i] - y0
    _sum_places(points, lanes, s)
    total, mx, my = s[0], s[1] / s[0], s[2] / s[0]
    vxx, vxy, vyy = s[3] / total - mx * mx, s[4] / total - mx * my, s[5] / total - my * my
    determinant = vxx * vyy - vxy * vxy
    for j in range(len(receivers)):
        receiver, own = receivers[j], biases[j]
        expect_fall(points[3], points[4], positions[j], receiver, floor, scratch)
        if len(maps) > 0:
            add_map(points[3], points[4], maps[j], scratch)
        about = scratch[0]
        for i in range(n):
            scratch[i] += kept * own[i] - about
        _sum_levels(points, scratch, lanes, s)
        level = s[0] / total
        cx, cy = s[1] / total - level * mx, s[2] / total - level * my
        rest = max(s[3] / total - level * level, 0.0)
        gx, gy = 0.0, 0.0
        if determinant > 1e-9 * vxx * vyy and determinant > 1e-12:
            gx, gy = (vyy * cx - vxy * cy) / determinant, (vxx * cy - vxy * cx) / determinant
            rest = max(rest - gx * cx - gy * cy, 0.0)
        own_variance = m.bias_kept * m.bias_kept * (receiver.bias_variance - m.bias_variance) + m.bias_variance
        receiver.gradient[0], receiver.gradient[1] = gx, gy
        receiver.variance = rest + own_variance + m.white_variance / m.report_packets


@lean_piece
def _sum_places(points, lanes, s):
    """s: sums of w, w x, w y, w xx, w xy, w yy over points (3 or more, P) = w, x, y, ..., in fixed lanes."""
    lanes[:] = F(0)
    w, x, y, n = points[0], points[1], points[2], points.shape[1]
    whole = n // LANES * LANES
    for o in range(0, whole, LANES):
        for k in range(LANES):
            _gather_place(w[o + k], x[o + k], y[o + k], lanes, k)
    for i in range(whole, n):
        _gather_place(w[i], x[i], y[i], lanes, 0)
    _close(lanes, s, 6)


@lean_piece
def _gather_place(w, x, y, lanes, k):
    wx, wy = w * x, w * y
    lanes[0, k] += w
    lanes[1, k] += wx
    lanes[2, k] += wy
    lanes[3, k] += wx * x
    lanes[4, k] += wx * y
    lanes[5, k] += wy * y


@lean_piece
def _sum_levels(points, levels, lanes, s):
    """s: sums of w l, w l x, w l y, w l l."""
    lanes[:] = F(0)
    w, x, y, n = points[0], points[1], points[2], points.shape[1]
    whole = n // LANES * LANES
    for o in range(0, whole, LANES):
        for k in range(LANES):
            _gather_level(w[o + k] * levels[o + k], x[o + k], y[o + k], levels[o + k], lanes, k)
    for i in range(whole, n):
        _gather_level(w[i] * levels[i], x[i], y[i], levels[i], lanes, 0)
    _close(lanes, s, 4)


@lean_piece
def _gather_level(e, x, y, level, lanes, k):
    lanes[0, k] += e
    lanes[1, k] += e * x
    lanes[2, k] += e * y
    lanes[3, k] += e * level


@lean_piece
def _close(lanes, s, rows):
    for row in range(rows):
        s[row] = 0.0
        for k in range(LANES):
            s[row] += np.float64(lanes[row, k])
