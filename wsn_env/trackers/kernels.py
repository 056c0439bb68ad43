"""The cluster particle filter, one row at a time: predict, weigh, read the moments, resample.

Structure of arrays in float32: x (4, P) = x, vx, y, vy. Sums run over 16 fixed lanes, so that the compiler may use
vector registers of any width and the bits stay the same.
"""

import numpy as np
from numba import int32, uint32

from wsn_env import draws
from wsn_env.compiling import kernel, piece
from wsn_env.numerics import F, exp, exp32, f32_bits, f32_from_bits, log32

LANES = 16
SUMS = 16  # w, w^2, four of w d, ten of w d d'
POSITION, STRENGTH, POWER = range(3)


@piece
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
            e0, e1 = draws.normal_pair32(draws.bits(stream, axis * x.shape[1] + i))
            x[axis, i] = F(mean[axis]) + F(sd) * e0
            x[axis + 1, i] = F(mean[axis + 1]) + F(slope) * e0 + F(rest) * e1
    log_weights[:] = F(0)


@piece
def predict(stream, x, period_s, q):
    """Constant velocity with white acceleration of sd q [m/s^2] (eqs. 6, 8)."""
    px, vx, py, vy = x[0], x[1], x[2], x[3]
    t = F(period_s)
    h, g = F(0.5 * period_s * period_s * q), F(period_s * q)
    for i in range(x.shape[1]):
        ax, ay = draws.normal_pair32(draws.bits(stream, i))
        px[i] += t * vx[i] + h * ax
        vx[i] += g * ax
        py[i] += t * vy[i] + h * ay
        vy[i] += g * ay


@piece
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
    else:
        log_floor = log32(floor)
        top = F(c.level * exp(-c.slope * np.float64(log_floor)) / c.noise)  # at the floor, the greatest there is
        z = F(value[0] / c.noise)  # powers in units of the noise: their own may be too small for float32
        for i in range(first, n, step):
            dx = px[i] - sx
            dy = py[i] - sy
            r = z - top * exp32(-slope * (log32(max(dx * dx + dy * dy, floor)) - log_floor))
            log_weights[i] -= F(0.5) * (r * r)


@piece
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
    shift = s[2:6] / total
    entry = 6
    for a in range(4):
        mean[a] = np.float64(F(reference[a])) + shift[a]
        for b in range(a, 4):
            cov[a, b] = s[entry] / total - shift[a] * shift[b]
            cov[b, a] = cov[a, b]
            entry += 1
    for a in range(4):
        cov[a, a] = max(cov[a, a], 0.0)
    for a in range(4):
        for b in range(a + 1, 4):  # rounding must not correlate a collapsed cloud beyond 1
            limit = np.sqrt(cov[a, a] * cov[b, b])
            cov[a, b] = min(max(cov[a, b], -limit), limit)
            cov[b, a] = cov[a, b]
    return total * total / s[1], total


@piece
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


@piece
def resample(u, x, log_weights, weights, total, ancestors):
    """Systematic resampling in place.

    Instead of searching, count how many particles end before each slot: the running count is the slot's ancestor.

    Args:
        u: U[0, 1), the common offset of the slots.
        weights: (P,) summing to `total`; used as scratch.
        ancestors: (P + 1,) int32 scratch.
    """
    n = x.shape[1]
    ancestors[:] = 0
    ancestors[0] = 1
    scale = np.float64(n) / total
    cumulated = 0.0
    last = int32(n)
    for i in range(n - 1):
        cumulated += np.float64(weights[i])
        ancestors[uint32(min(int32(cumulated * scale - u + 1.0), last))] += int32(1)
    ancestor = int32(-1)
    for k in range(n):
        ancestor += ancestors[k]
        ancestors[k] = ancestor
    for axis in range(4):
        coordinate = x[axis]
        for k in range(n):
            weights[k] = coordinate[uint32(ancestors[k])]  # unsigned: no wrap-around to provide for, a quarter faster
        for k in range(n):
            coordinate[k] = weights[k]
    log_weights[:] = F(0)


@piece
def relocate(stream, mean, cov, x):
    """Draw the particles' positions anew ~ N(mean, cov); velocities and weights stay."""
    sx, sy = F(np.sqrt(cov[0, 0])), F(np.sqrt(cov[2, 2]))
    for i in range(x.shape[1]):
        e0, e1 = draws.normal_pair32(draws.bits(stream, i))
        x[0, i] = F(mean[0]) + sx * e0
        x[2, i] = F(mean[2]) + sy * e1


@kernel
def spread_rows(start, stop, keys, periods, rows, belief):
    """Spread the clouds of the rows marked in `rows` about their beliefs' mean and covariance."""
    for b in range(start, stop):
        if rows[b]:
            stream = draws.stream(keys[b], periods[b], draws.CLOUD)
            spread(stream, belief.row[b].mean, belief.row[b].cov, belief.particles[b], belief.log_weights[b])


@kernel
def relocate_rows(start, stop, keys, periods, rows, belief):
    """Move the clouds of the rows marked in `rows` to their beliefs' position mean and covariance."""
    for b in range(start, stop):
        if rows[b]:
            stream = draws.stream(keys[b], periods[b], draws.RESTART)
            relocate(stream, belief.row[b].mean, belief.row[b].cov, belief.particles[b])


@piece
def filter_row(key, period, belief, network, reports, b, c, weights, ancestors):
    """One period of row b: `period` counts from 1; the belief is that after the period before.

    Args:
        weights, ancestors: scratch for P particles.

    Returns: whether the particles were resampled.
    """
    x, log_weights, row = belief.particles[b], belief.log_weights[b], belief.row[b]
    n, count = x.shape[1], reports.count[b]
    predict(draws.stream(key, period, draws.PROCESS), x, c.period_s, c.q)
    for j in range(count):
        position, value = network.positions[b, reports.node[b, j]], reports.value[b, j]
        if c.pooled:
            weigh(x, log_weights, j, count, position, value, c)
        else:  # a constant stride of 1 lets the compiler use vectors
            weigh(x, log_weights, 0, 1, position, value, c)
    normalise(log_weights, weights)
    row.n_eff, total = moments(x, weights, row.predicted_mean, row.mean, row.cov)
    resampled = row.n_eff < c.resample_below * n
    if resampled:
        u = draws.uniform(draws.stream(key, period, draws.RESAMPLING), 0)
        resample(u, x, log_weights, weights, total, ancestors)
    return resampled


@piece
def scratch(particles):
    """Room that `filter_row` needs: weights and ancestors."""
    return np.empty(particles, np.float32), np.empty(particles + 1, np.int32)


@kernel
def filter_rows(start, stop, constants, keys, periods, belief, network, reports, resampled):
    """One period of the filter alone."""
    weights, ancestors = scratch(belief.particles.shape[2])
    for b in range(start, stop):
        resampled[b] = filter_row(keys[b], periods[b], belief, network, reports, b, constants[0], weights, ancestors)
