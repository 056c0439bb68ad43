"""The cluster particle filter, one row at a time: predict, weigh, read the moments, resample.

Structure of arrays in float32: x (4, P) = x, vx, y, vy. Sums run over 16 fixed lanes, so that the compiler may use
vector registers of any width and the bits stay the same.
"""

import numpy as np
from numba import int32

from wsn_env import draws
from wsn_env.compiling import inline_piece, kernel, lean_kernel, lean_piece, piece
from wsn_env.draws import normal_pair32
from wsn_env.numerics import F, exp, exp32, expm1_32, f32_bits, f32_from_bits, log, log32, log_normal_cdf32
from wsn_env.sections import Binary, Position, Rssi, RssiPower, Sonar
from wsn_env.trackers.resampling import REACH, correlated, lower_root, resample, spread_copies
from wsn_env.types import Belief, Reports, network_of

LANES = 16
SUMS = 16  # w, w^2, four of w d, ten of w d d'
POSITION, STRENGTH, POWER = Position.code, Rssi.code, RssiPower.code
SONAR, BINARY = Sonar.code, Binary.code
LOG_LEAST, LOG_MOST = F(-13.815510558), F(-1.0000005e-6)  # p in [1e-6, 1 - 1e-6]: no report rules a particle out
TINY = F(1e-30)


@lean_piece
def spread(stream, mean, cov, x, log_weights):
    """Draw a cloud ~ N(mean, cov) with equal weights; x and y axes are taken as independent.

    Args:
        mean, cov: (4,), (4, 4) with covariance between position and velocity of an axis only.
    """
    for axis in (0, 2):
        sd = np.sqrt(cov[axis, axis])
        slope = cov[axis, axis + 1] / sd if sd > 0.0 else 0.0
        rest = np.sqrt(max(cov[axis + 1, axis + 1] - slope * slope, 0.0))
        for i in range(x.shape[1]):
            e0, e1 = normal_pair32(draws.bits(stream, axis * x.shape[1] + i))
            x[axis, i] = F(mean[axis]) + F(sd) * e0
            x[axis + 1, i] = F(mean[axis + 1]) + F(slope) * e0 + F(rest) * e1
    log_weights[:] = F(0)


@lean_piece
def predict(stream, x, period_s, q):
    """Constant velocity with white acceleration of sd q [m/s^2] (eqs. 6, 8)."""
    px, vx, py, vy = x[0], x[1], x[2], x[3]
    t = F(period_s)
    h, g = F(0.5 * period_s * period_s * q), F(period_s * q)
    for i in range(x.shape[1]):
        ax, ay = normal_pair32(draws.bits(stream, i))
        px[i] += t * vx[i] + h * ax
        vx[i] += g * ax
        py[i] += t * vy[i] + h * ay
        vy[i] += g * ay


@lean_piece
def weigh(x, log_weights, first, step, position, value, c):
    """Add a report's log likelihood to every step-th particle from the first on."""
    px, py = x[0], x[2]
    n = x.shape[1]
    half_precision = F(0.5 / max(c.noise * c.noise, 1e-20))
    if c.model == POSITION:
        zx, zy = F(value[0]), F(value[1])
        for i in range(first, n, step):
            dx = px[i] - zx
            dy = py[i] - zy
            log_weights[i] -= half_precision * (dx * dx + dy * dy)
        return
    sx, sy, z = F(position[0]), F(position[1]), F(value[0])
    level, slope, floor = F(c.level), F(c.slope), F(max(c.floor_m * c.floor_m, 1e-12))
    if c.model == STRENGTH:
        for i in range(first, n, step):
            dx = px[i] - sx
            dy = py[i] - sy
            r = (z - level) + slope * log32(max(dx * dx + dy * dy, floor))
            log_weights[i] -= half_precision * (r * r)
    elif c.model == SONAR:
        absorption = F(c.absorption)
        for i in range(first, n, step):
            dx = px[i] - sx
            dy = py[i] - sy
            near = max(dx * dx + dy * dy, floor)
            r = (z - level) + (slope * log32(near) + absorption * np.sqrt(near))
            log_weights[i] -= half_precision * (r * r)
    else:
        log_floor = log32(floor)
        top = F(c.level * exp(-c.slope * np.float64(log_floor)) / c.noise)  # at the floor, the greatest there is
        z = F(value[0] / c.noise)  # powers in units of the noise: their own may be too small for float32
        for i in range(first, n, step):
            dx = px[i] - sx
            dy = py[i] - sy
            r = z - top * exp32(-slope * (log32(max(dx * dx + dy * dy, floor)) - log_floor))
            log_weights[i] -= F(0.5) * (r * r)


@lean_piece
def weigh_awake(x, log_weights, network, nodes, b, c):
    """Add what it tells that of the awake nodes of row b just `nodes` (m,) reported, beside what they measured.

    The head's own report is always heard, a member's with probability `delivery`. A node without energy tells nothing.
    """
    positions, battery, standing = network.positions[b], network.battery[b], network.row[b]
    if standing.head < 0:
        return
    for k in range(-1, standing.n_members):
        node = standing.head if k < 0 else network.members[b, k]
        reported = False
        for other in nodes:
            reported |= other == node
        delivery = 1.0 if k < 0 else c.delivery
        if c.detection == 1:  # a report's value tells all; that it came adds nothing
            if not reported and battery[node] > 0.0:
                weigh_quiet(x, log_weights, positions[node], delivery, c)
        elif reported:
            weigh_detection(x, log_weights, positions[node], c)
        elif battery[node] > 0.0:
            weigh_silence(x, log_weights, positions[node], delivery, c)


@lean_piece
def weigh_detection(x, log_weights, position, c):
    """Add to every particle the log probability that the node at `position`, which reported, detects a target there."""
    px, py = x[0], x[2]
    sx, sy = F(position[0]), F(position[1])
    curve = detection_curve(c)
    for i in range(x.shape[1]):
        dx = px[i] - sx
        dy = py[i] - sy
        log_weights[i] += log_detection32(dx * dx + dy * dy, curve)


@lean_piece
def weigh_silence(x, log_weights, position, delivery, c):
    """Add log(1 - delivery p(d)): the node at `position` was awake and nothing was heard of it.

    Args:
        delivery: probability that a report of the node arrives; 1 for the head.
    """
    px, py = x[0], x[2]
    sx, sy = F(position[0]), F(position[1])
    curve = detection_curve(c)
    sent, lost = F(delivery), F(1.0 - delivery)
    for i in range(x.shape[1]):
        dx = px[i] - sx
        dy = py[i] - sy
        unseen = -expm1_32(log_detection32(dx * dx + dy * dy, curve))
        log_weights[i] += log32(min(lost + sent * unseen, F(1)))  # <= 0, as log weights have to be


@lean_piece
def weigh_states(x, log_weights, network, bitmap, b, c):
    """Add to every particle the log probability of the awake nodes' states as the bitmap (S,) has them: a silent node
    tells as much as one that reports.

    Nodes whose edge is far from every particle tell all of them the same and are left out.
    """
    positions, battery, standing = network.positions[b], network.battery[b], network.row[b]
    if standing.head < 0:
        return
    box = _bounds(x[0]), _bounds(x[2])
    far = 16.0 * c.edge_m
    for k in range(-1, standing.n_members):
        node = standing.head if k < 0 else network.members[b, k]
        nearest, farthest = _reach(positions[node], box)
        if battery[node] > 0.0 and nearest < c.radius_m + far and farthest > c.radius_m - far:
            weigh_state(x, log_weights, positions[node], bitmap[node] != 0, c)


@lean_piece
def _bounds(values):
    low, high = values[0], values[0]
    for value in values:
        low, high = min(low, value), max(high, value)
    return np.float64(low), np.float64(high)


@lean_piece
def _reach(position, box):
    """Distances of the nearest and the farthest point of a box [m]."""
    nearest, farthest = 0.0, 0.0
    for axis in range(2):
        below, above = box[axis][0] - position[axis], position[axis] - box[axis][1]
        nearest += max(below, above, 0.0) ** 2
        farthest += max(abs(below), abs(above)) ** 2
    return np.sqrt(nearest), np.sqrt(farthest)


@lean_piece
def weigh_state(x, log_weights, position, detects, c):
    """Add to every particle the log probability of the state of the binary sensor at `position`.

    P(1) = f + (1 - 2 f) / (1 + exp((d - R) / s)), s the softness of the edge and f the probability that the bitmap is
    wrong: by a misreading, or by a change whose report was lost.
    """
    px, py = x[0], x[2]
    sx, sy = F(position[0]), F(position[1])
    flip = min(max(c.flip, 1.0 - c.delivery, 1e-6), 0.5)  # no state rules a particle out
    least, rest = F(flip), F(1.0 - 2.0 * flip)
    slope = F((-1.0 if detects else 1.0) / c.edge_m)
    radius = F(c.radius_m)
    for i in range(x.shape[1]):
        dx = px[i] - sx
        dy = py[i] - sy
        y = slope * (radius - np.sqrt(dx * dx + dy * dy))
        log_weights[i] += log32(least + rest / (F(1) + exp32(min(y, F(80)))))


@lean_piece
def weigh_quiet(x, log_weights, position, delivery, c):
    """Add the log probability that nothing was heard of the awake node at `position`, with a threshold.

        ln Phi((threshold - h(d)) / sigma)               delivery = 1: the level was below the threshold
        ln(1 - delivery + delivery Phi(...))             else: or the report was lost

    Args:
        delivery: probability that a report of the node arrives; 1 for the head.
    """
    px, py = x[0], x[2]
    sx, sy = F(position[0]), F(position[1])
    per_sd = 1.0 / max(c.noise, 1e-10)
    below = F((c.threshold_db - c.level) * per_sd)
    slope, absorption, floor = F(c.slope * per_sd), F(c.absorption * per_sd), F(max(c.floor_m * c.floor_m, 1e-12))
    sent, lost = F(delivery), F(1.0 - delivery)
    for i in range(x.shape[1]):
        dx = px[i] - sx
        dy = py[i] - sy
        near = max(dx * dx + dy * dy, floor)
        quiet = log_normal_cdf32(below + (slope * log32(near) + absorption * np.sqrt(near)))
        if lost > F(0):
            quiet = log32(min(lost + sent * exp32(quiet), F(1)))
        log_weights[i] += quiet


@lean_piece
def detection_curve(c):
    """Eqs. 2-3 in float32 and logarithms: inner and outer end [m], ln l1, b1, b2, ln l2."""
    return (
        F(c.inner_m),
        F(c.reach_m),
        F(log(max(c.decay, 1e-30))),
        F(c.decay_power),
        F(c.edge_power),
        F(log(max(c.ceiling, 1e-30))),
    )


@inline_piece
def log_detection32(squared, curve):
    """Log of the detection probability at a squared distance [m^2] (eqs. 2-3), clipped to finite odds."""
    inner, reach, log_decay, decay_power, edge_power, log_ceiling = curve
    d = np.sqrt(squared)
    a1, a2 = d - inner, reach - d
    y = log_decay + decay_power * log32(max(a1, TINY)) - edge_power * log32(max(a2, TINY))
    fall = exp32(min(y, F(3))) * F(a1 > F(0)) + F(20) * F(a2 <= F(0))  # beyond e**3 p is below the least anyway
    return min(max(log_ceiling - fall, LOG_LEAST), LOG_MOST)


@lean_piece
def normalise(log_weights, weights):
    """Shift the log weights so that the best is 0; `weights` become their exponentials."""
    n = len(log_weights)
    least = int32(2147483647)
    for i in range(n):  # log weights are <= 0: their bits, read as integers, order as they do
        least = min(least, f32_bits(-log_weights[i]))
    best = -f32_from_bits(int32(least))
    for i in range(n):
        log_weights[i] -= best
        weights[i] = exp32(log_weights[i])


@piece
def moments(x, weights, reference, mean, cov):
    """Weighted mean and covariance about a reference point (eqs. 9-13).

    Args:
        reference: (4,) near the mean, so that float32 differences lose nothing.
        mean, cov: (4,), (4, 4) filled.

    Returns: effective sample size (eq. 14), sum of weights.
    """
    n = x.shape[1]
    px, vx, py, vy = x[0], x[1], x[2], x[3]
    r0, r1, r2, r3 = F(reference[0]), F(reference[1]), F(reference[2]), F(reference[3])
    lanes = np.zeros((SUMS, LANES), np.float32)
    whole = n // LANES * LANES
    for o in range(0, whole, LANES):
        for k in range(LANES):
            _gather(weights[o + k], px[o + k] - r0, vx[o + k] - r1, py[o + k] - r2, vy[o + k] - r3, lanes, k)
    for i in range(whole, n):
        _gather(weights[i], px[i] - r0, vx[i] - r1, py[i] - r2, vy[i] - r3, lanes, 0)
    s = np.zeros(SUMS)
    for row in range(SUMS):
        for k in range(LANES):
            s[row] += np.float64(lanes[row, k])
    total = s[0]
    entry = 6
    for a in range(4):
        for b in range(a, 4):
            cov[a, b] = s[entry] / total - (s[2 + a] / total) * (s[2 + b] / total)
            cov[b, a] = cov[a, b]
            entry += 1
    for a in range(4):
        mean[a] = np.float64(F(reference[a])) + s[2 + a] / total
        cov[a, a] = max(cov[a, a], 0.0)
    for a in range(4):
        for b in range(a + 1, 4):  # rounding must not correlate a collapsed cloud beyond 1
            limit = np.sqrt(cov[a, a] * cov[b, b])
            cov[a, b] = min(max(cov[a, b], -limit), limit)
            cov[b, a] = cov[a, b]
    return total * total / s[1], total


@lean_piece
def _gather(w, d0, d1, d2, d3, lanes, k):
    e0, e1, e2, e3 = w * d0, w * d1, w * d2, w * d3
    lanes[0, k] += w
    lanes[1, k] += w * w
    lanes[2, k] += e0
    lanes[3, k] += e1
    lanes[4, k] += e2
    lanes[5, k] += e3
    lanes[6, k] += e0 * d0
    lanes[7, k] += e0 * d1
    lanes[8, k] += e0 * d2
    lanes[9, k] += e0 * d3
    lanes[10, k] += e1 * d1
    lanes[11, k] += e1 * d2
    lanes[12, k] += e1 * d3
    lanes[13, k] += e2 * d2
    lanes[14, k] += e2 * d3
    lanes[15, k] += e3 * d3


@lean_piece
def relocate(stream, mean, cov, x):
    """Draw the particles' positions anew ~ N(mean, cov); velocities and weights stay."""
    sx, sy = F(np.sqrt(cov[0, 0])), F(np.sqrt(cov[2, 2]))
    for i in range(x.shape[1]):
        e0, e1 = normal_pair32(draws.bits(stream, i))
        x[0, i] = F(mean[0]) + sx * e0
        x[2, i] = F(mean[2]) + sy * e1


@lean_kernel
def spread_rows(start, stop, keys, periods, rows, belief):
    """Spread the clouds of the rows marked in `rows` about their beliefs' mean and covariance."""
    for b in range(start, stop):
        if rows[b]:
            stream = draws.stream(keys[b], periods[b], draws.CLOUD)
            spread(stream, belief.row[b].mean, belief.row[b].cov, belief.particles[b], belief.log_weights[b])


@lean_kernel
def relocate_rows(start, stop, keys, periods, rows, belief):
    """Move the clouds of the rows marked in `rows` to their beliefs' position mean and covariance."""
    for b in range(start, stop):
        if rows[b]:
            stream = draws.stream(keys[b], periods[b], draws.RESTART)
            relocate(stream, belief.row[b].mean, belief.row[b].cov, belief.particles[b])


@piece
def filter_row(key, period, belief, network, reports, b, c, room):
    """One period of row b: `period` counts from 1; the belief is that after the period before.

    Args:
        room: what `scratch` gives.

    Returns: whether the particles were resampled.
    """
    x, log_weights, row = belief.particles[b], belief.log_weights[b], belief.row[b]
    weights, slots, states = room
    n, count = x.shape[1], reports.count[b]
    predict(draws.stream(key, period, draws.PROCESS), x, c.period_s, c.q)
    if c.model == BINARY:
        weigh_states(x, log_weights, network, reports.bitmap[b], b, c)
        count = 0
    for j in range(count):
        position, value = network.positions[b, reports.node[b, j]], reports.value[b, j]
        if c.pooled:
            weigh(x, log_weights, j, count, position, value, c)
        else:  # a constant stride of 1 lets the compiler use vectors
            weigh(x, log_weights, 0, 1, position, value, c)
    if c.silent_information:
        weigh_awake(x, log_weights, network, reports.node[b, :count], b, c)
    normalise(log_weights, weights)
    row.n_eff, total = moments(x, weights, row.predicted_mean, row.mean, row.cov)
    resampled = row.n_eff < c.resample_below * n
    if resampled:
        u = draws.uniform(draws.stream(key, period, draws.RESAMPLING), 0)
        resample(u, x, log_weights, weights, total, slots, states)
        if c.spread_scale > 0.0:
            spread_copies(draws.stream(key, period, draws.SPREAD), slots[2, REACH:], c.spread_scale, row.cov, x)
    return resampled


@lean_piece
def redraw_row(key, period, belief, b):
    """The new head of row b draws its particles from the mean and covariance handed over, with equal weights."""
    x, mean, root = belief.particles[b], belief.row[b].mean, lower_root(belief.row[b].cov)
    stream = draws.stream(key, period, draws.HANDOVER)
    for i in range(x.shape[1]):
        d0, d1, d2, d3 = correlated(stream, i, root)
        x[0, i], x[1, i] = F(mean[0]) + d0, F(mean[1]) + d1
        x[2, i], x[3, i] = F(mean[2]) + d2, F(mean[3]) + d3
    belief.log_weights[b, :] = F(0)


@piece
def scratch(particles):
    """Room that `filter_row` needs: weights, slots and states."""
    slots = np.empty((3, particles + REACH), np.int32)
    slots[:, :REACH] = 0  # what `inherit` never writes to
    return np.empty(particles, np.float32), slots, np.empty((2, particles), np.complex128)


@kernel
def filter_rows(start, stop, constants, keys, periods, resampled, *arrays):
    """One period of the filter alone; `arrays` are the belief's, the reports' and the network's."""
    belief, reports, network = Belief(*arrays[:3]), Reports(*arrays[3:7]), network_of(arrays[7:])
    room = scratch(belief.particles.shape[2])
    for b in range(start, stop):
        resampled[b] = filter_row(keys[b], periods[b], belief, network, reports, b, constants[0], room)
