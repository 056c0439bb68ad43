"""How likely the reports of a period are, and the silence of those that were awake, particle by particle.

Every function adds log probabilities, at most 0 each, to the log weights of the particles x (4, P), in float32.
"""

import numpy as np

from wsn_env.compiled.elementary import F, exp, exp32, expm1_32, log, log32, log_normal_cdf32
from wsn_env.compiled.kernels import inline_piece, lean_piece
from wsn_env.models.physics.radio import TO_HEAD
from wsn_env.models.physics.sensing import POSITION, SONAR, STRENGTH, THRESHOLD

LOG_LEAST, LOG_MOST = F(-13.815510558), F(-1.0000005e-6)  # p in [1e-6, 1 - 1e-6]: no report rules a particle out
TINY = F(1e-30)


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

    A report is heard with probability `delivery`, the head's with `head_delivery`. A node without energy tells nothing.
    """
    positions, battery, standing = network.positions[b], network.battery[b], network.row[b]
    if standing.head < 0 or (c.receiver == TO_HEAD and battery[standing.head] <= 0.0):  # nobody could be heard
        return
    for k in range(-1, standing.n_members):
        node = standing.head if k < 0 else network.members[b, k]
        reported = False
        for other in nodes:
            reported |= other == node
        delivery = c.head_delivery if k < 0 else c.delivery
        if c.detection == THRESHOLD:  # a report's value tells all; that it came adds nothing
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
        delivery: probability that a report of the node arrives.
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
def weigh_states(x, log_weights, network, bitmap, nodes, b, c):
    """Add to every particle the log probability of the awake nodes' states as the bitmap (S,) has them: a silent node
    tells as much as one of `nodes` (m,), which have reported, but that a report of its own may have been lost.

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
            wrong = max(c.flip, 1.0 - c.delivery)
            for other in nodes:
                wrong = c.flip if other == node else wrong
            weigh_state(x, log_weights, positions[node], bitmap[node] != 0, wrong, c)


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
def weigh_state(x, log_weights, position, detects, wrong, c):
    """Add to every particle the log probability of the state of the binary sensor at `position`.

    P(1) = f + (1 - 2 f) l2 / (1 + exp((d - R) / s)), s the softness of the edge and l2 the ceiling of detection.

    Args:
        wrong: f, the probability that the bitmap is wrong: by a misreading, or by a change whose report was lost.
    """
    px, py = x[0], x[2]
    sx, sy = F(position[0]), F(position[1])
    wrong = min(max(wrong, 1e-6), 0.5)  # no state rules a particle out
    rest = F((1.0 - 2.0 * wrong) * c.ceiling)
    least = F(wrong if detects else wrong + (1.0 - 2.0 * wrong) * (1.0 - c.ceiling))
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
        delivery: probability that a report of the node arrives.
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
