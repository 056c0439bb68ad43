"""The cluster particle filter, one row at a time: predict, weigh, read the moments, resample.

Structure of arrays in float32: x (4, P) = x, vx, y, vy. Sums run over 16 fixed lanes, so that the compiler may use
vector registers of any width and the bits stay the same.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import int32

from wsn_env.compiled import draws
from wsn_env.compiled.draws import normal_pair32
from wsn_env.compiled.elementary import F, exp32, f32_bits, f32_from_bits
from wsn_env.compiled.kernels import kernel, lean_kernel, lean_piece, piece
from wsn_env.filters.likelihood import weigh_awake
from wsn_env.filters.modes import allot_modes, inherit_modes, note_modes, predict_by_mode
from wsn_env.filters.resampling import REACH, correlated, lower_root, resample, spread_copies, spread_copies_alike
from wsn_env.filters.walkers import scatter_walkers, walk
from wsn_env.models.association.base import weigh_reports
from wsn_env.models.measurement.base import AtHead
from wsn_env.models.measurement.beacon_levels import draw_biases
from wsn_env.models.state import belief_at, network_at, reports_at

LANES = 16
SUMS = 16  # w, w^2, four of w d, ten of w d d'


@lean_piece
def spread(stream: Any, mean: np.ndarray, cov: np.ndarray, x: np.ndarray, log_weights: np.ndarray) -> None:
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
def predict(stream: Any, x: np.ndarray, period_s: float, q: float) -> None:
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
def normalise(log_weights: np.ndarray, weights: np.ndarray) -> None:
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
def moments(x: np.ndarray, weights: np.ndarray, reference: Any, mean: np.ndarray, cov: np.ndarray) -> tuple[Any, ...]:
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
        _gather(weights[i], px[i] - r0, vx[i] - r1, py[i] - r2, vy[i] - r3, lanes, np.int64(0))
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
def relocate(stream: Any, mean: np.ndarray, cov: np.ndarray, x: np.ndarray) -> None:
    """Draw the particles' positions anew ~ N(mean, cov); velocities and weights stay."""
    sx, sy = F(np.sqrt(cov[0, 0])), F(np.sqrt(cov[2, 2]))
    for i in range(x.shape[1]):
        e0, e1 = normal_pair32(draws.bits(stream, i))
        x[0, i] = F(mean[0]) + sx * e0
        x[2, i] = F(mean[2]) + sy * e1


@lean_kernel
def spread_rows(
    start: int, stop: int, keys: np.ndarray, periods: np.ndarray, rows: np.ndarray, belief_handle: np.ndarray
) -> None:
    """Spread the clouds of the rows marked in `rows` about their beliefs' mean and covariance."""
    belief = belief_at(belief_handle)
    for b in range(start, stop):
        if rows[b]:
            stream = draws.stream(keys[b], periods[b], draws.CLOUD)
            spread(stream, belief.row[b].mean, belief.row[b].cov, belief.particles[b], belief.log_weights[b])
            allot_modes(belief.modes[b], belief.row[b].mode_probabilities)


@lean_kernel
def scatter_rows(
    start: int, stop: int, cs: Any, keys: np.ndarray, periods: np.ndarray, rows: np.ndarray, belief_handle: np.ndarray
) -> None:
    """Scatter walkers all over the room in the rows marked."""
    belief = belief_at(belief_handle)
    c = cs[0]
    for b in range(start, stop):
        if rows[b]:
            stream = draws.stream(keys[b], periods[b], draws.CLOUD)
            scatter_walkers(
                stream,
                belief.particles[b],
                belief.log_weights[b],
                c.tracking.velocity_sd,
                c.tracking.side_m,
                c.tracking.depth_m,
            )


@lean_kernel
def relocate_rows(
    start: int, stop: int, keys: np.ndarray, periods: np.ndarray, rows: np.ndarray, belief_handle: np.ndarray
) -> None:
    """Move the clouds of the rows marked in `rows` to their beliefs' position mean and covariance."""
    belief = belief_at(belief_handle)
    for b in range(start, stop):
        if rows[b]:
            stream = draws.stream(keys[b], periods[b], draws.RESTART)
            relocate(stream, belief.row[b].mean, belief.row[b].cov, belief.particles[b])


class Scratch(NamedTuple):
    """Memory that `filter_row` needs."""

    weights: np.ndarray  # (P,) float32
    slots: np.ndarray  # (3, P + REACH) int32
    states: np.ndarray  # (2, P) complex128


@piece
def make_scratch(particles: int) -> Any:
    """For so many particles."""
    slots = np.empty((3, particles + REACH), np.int32)
    slots[:, :REACH] = 0  # what `inherit` never writes to
    return Scratch(np.empty(particles, np.float32), slots, np.empty((2, particles), np.complex128))


@piece
def filter_row(key: Any, period: int, head: AtHead, c: Any, maps: np.ndarray, scratch: Any) -> Any:
    """One period of one row.

    Args:
        key: of the episode.
        period: counts from 1.
        head: the belief is that after the period before.
        maps: of the measurement's `residual_maps`.

    Returns: whether the particles were resampled.
    """
    belief, network, reports, b = head
    x, log_weights, row = belief.particles[b], belief.log_weights[b], belief.row[b]
    weights, slots, states = scratch.weights, scratch.slots, scratch.states
    n, count = x.shape[1], reports.count[b]
    if c.tracking.walks:
        walk(draws.stream(key, period, draws.PROCESS), x, c.tracking)
    elif c.tracking.switches:
        predict_by_mode(draws.stream(key, period, draws.PROCESS), x, belief.modes[b], c.tracking)
    else:
        predict(draws.stream(key, period, draws.PROCESS), x, c.period_s, c.tracking.q)
    weigh_reports(c.association, head, c, maps, weights)
    if c.tracking.silent_information:
        weigh_awake(x, log_weights, network, reports.node[b, :count], b, c)
    normalise(log_weights, weights)
    row.n_eff, total = moments(x, weights, row.predicted_mean, row.mean, row.cov)
    note_modes(belief.modes[b], weights, row.mode_probabilities)
    resampled = row.n_eff < c.tracking.resample_below * n
    if resampled:
        u = draws.uniform(draws.stream(key, period, draws.RESAMPLING), 0)
        resample(u, x, log_weights, weights, total, slots, states)
        draw_biases(belief.biases[b], slots[2, REACH:], weights)
        inherit_modes(belief.modes[b], slots[2, REACH:], slots[0])
        if c.tracking.spread_alike:
            spread_copies_alike(slots[2, REACH:], c.tracking.spread_scale, row.cov, x)
        elif c.tracking.spread_scale > 0.0:
            spread = draws.stream(key, period, draws.SPREAD)
            spread_copies(spread, slots[2, REACH:], c.tracking.spread_scale, row.cov, x)
    return resampled


@lean_piece
def redraw_row(key: Any, period: int, belief: Any, b: int) -> None:
    """The new head of row b draws its particles from the mean and covariance handed over, with equal weights."""
    x, mean, root = belief.particles[b], belief.row[b].mean, lower_root(belief.row[b].cov)
    stream = draws.stream(key, period, draws.HANDOVER)
    for i in range(x.shape[1]):
        d0, d1, d2, d3 = correlated(stream, i, root)
        x[0, i], x[1, i] = F(mean[0]) + d0, F(mean[1]) + d1
        x[2, i], x[3, i] = F(mean[2]) + d2, F(mean[3]) + d3
    belief.log_weights[b, :] = F(0)
    allot_modes(belief.modes[b], belief.row[b].mode_probabilities)  # of which a handover tells nothing


@kernel
def filter_rows(
    start: int, stop: int, cs: Any, maps: np.ndarray, times: Any, handles: Any, resampled: np.ndarray
) -> None:
    """One period of the filter alone.

    Args:
        times: keys (B,) and periods (B,).
        handles: of the beliefs, the networks and the reports.
        resampled: (B,) bool, filled.
    """
    keys, periods = times
    belief, network, reports = belief_at(handles[0]), network_at(handles[1]), reports_at(handles[2])
    scratch = make_scratch(belief.particles.shape[2])
    for b in range(start, stop):
        resampled[b] = filter_row(keys[b], periods[b], AtHead(belief, network, reports, b), cs[0], maps, scratch)
