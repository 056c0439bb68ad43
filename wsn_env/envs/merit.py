"""The order in which candidates are worth waking: nearest first, by information, or by information less its price."""

import numpy as np

from wsn_env.compiled.elementary import exp, normal_cdf
from wsn_env.compiled.kernels import kernel, lean_piece
from wsn_env.models.physics.field import squared_distance
from wsn_env.models.physics.radio import TO_HEAD, outside, transmission
from wsn_env.models.physics.sensing import BEACON, BINARY, POSITION, mean_detection, strength_slope
from wsn_env.simulation.state import Sensors

TWO_PI = 6.283185307179586
ORDERS = ("nearest", "information", "value")
NEAREST, INFORMATION, VALUE = range(len(ORDERS))
KEEP, BEST, AHEAD = range(3)  # who leads
LEAD = 0.3  # sensing radii


@lean_piece
def chance(sensors, node, mean, cov, c):
    """Probability that the node detects the target, under the belief; of a receiver, that it hears its beacon."""
    if c.model == BEACON:
        return c.heard
    dx, dy = mean[0] - sensors.positions[node, 0], mean[2] - sensors.positions[node, 1]
    return mean_detection(dx, dy, cov[0, 0], cov[0, 2], cov[2, 2], c)


@lean_piece
def gain(detection, sensors, node, mean, cov, p00, p01, p11, c):
    """Expected drop of the position covariance's trace by one report of `node` [m^2], and the covariance after it.

    Linearised at the prediction. The report comes with probability p, and with it what a report takes from the
    covariance: the mean over both cases (Sinopoli et al., 2004, for Kalman filters with lost measurements).

    Args:
        sensors: the row's Sensors.
        detection: its `chance` p; of no account for a binary sensor, whose silence tells as much as its report.
        p00, p01, p11: position covariance so far, after the nodes already chosen [m^2].

    Returns: gain, and the three entries of the covariance after.
    """
    r = c.noise * c.noise
    if c.model == POSITION:
        s00, s11 = p00 + r, p11 + r
        share = detection / (s00 * s11 - p01 * p01)
        c00 = share * (p00 * p00 * s11 - 2.0 * p00 * p01 * p01 + p01 * p01 * s00)
        c11 = share * (p01 * p01 * s11 - 2.0 * p01 * p01 * p11 + p11 * p11 * s00)
        c01 = share * (p00 * s11 * p01 - p00 * p01 * p11 - p01 * p01 * p01 + p01 * s00 * p11)
        return c00 + c11, p00 - c00, p01 - c01, p11 - c11
    dx = mean[0] - sensors.positions[node, 0]
    dy = mean[2] - sensors.positions[node, 1]
    if c.model == BINARY:
        detection = 1.0
        h0, h1, r = _edge(dx, dy, cov, c)
    elif c.model == BEACON:  # the tracker has said what to expect
        receiver = sensors.receivers[node]
        h0, h1, r = receiver.gradient[0], receiver.gradient[1], max(receiver.variance, 1e-12)
    else:
        # The slope of the strength, smoothed over the belief's own width.
        squared = max(dx * dx + dy * dy + 0.5 * (cov[0, 0] + cov[2, 2]), c.floor_m * c.floor_m)
        slope = strength_slope(squared, c)
        h0, h1 = slope * dx, slope * dy
    b0, b1 = p00 * h0 + p01 * h1, p01 * h0 + p11 * h1
    share = detection / (h0 * b0 + h1 * b1 + r)
    return share * (b0 * b0 + b1 * b1), p00 - share * b0 * b0, p01 - share * b0 * b1, p11 - share * b1 * b1


@lean_piece
def _edge(dx, dy, cov, c):
    """One bit as a linear measurement: its direction, and the noise that leaves the same expected variance.

    A normal x of variance v that is only known to lie on one side of a threshold t sds from its mean keeps, on average,
    v (1 - phi(t)^2 / (Phi(t) Phi(-t))).

    Args:
        dx, dy: from the node to the mean [m].
    """
    distance = max(np.sqrt(dx * dx + dy * dy), 1e-9)
    h0, h1 = dx / distance, dy / distance
    along = max(h0 * h0 * cov[0, 0] + 2.0 * h0 * h1 * cov[0, 2] + h1 * h1 * cov[2, 2], 1e-12)
    blurred = along + c.edge_m * c.edge_m
    t = min(abs(c.radius_m - distance) / np.sqrt(blurred), 8.0)
    below = normal_cdf(-t)
    told = exp(-t * t) / (TWO_PI * below * (1.0 - below)) * along / blurred
    return h0, h1, along * (1.0 - told) / max(told, 1e-12)


@lean_piece
def price_mj(detection, sensors, node, head, mean, c):
    """Expected energy of a node's being awake for the period instead of asleep, and of its report [mJ].

    The report goes to the head, or as far as the prediction where the head is still open; to the sink; to the target.
    """
    x, y = mean[0], mean[2]
    if c.receiver != TO_HEAD:
        x, y = outside(mean, c)
    elif head >= 0:
        x, y = sensors.positions[head, 0], sensors.positions[head, 1]
    squared = squared_distance(sensors.positions, node, x, y)
    report = c.report_packets * transmission(c.report_bits, squared, c)
    if c.receiver == TO_HEAD:
        report += c.report_packets * c.report_bits * c.rx_j_per_bit
    return 1e3 * (detection * report + c.awake_j - c.asleep_j)


@lean_piece
def fill_chances(sensors, nodes, mean, cov, c, chances):
    """chances (K,): of the candidates `nodes`; -1: none."""
    for k in range(len(nodes)):
        chances[k] = chance(sensors, nodes[k], mean, cov, c) if nodes[k] >= 0 else -1.0


@lean_piece
def place_of(node, nodes):
    """Where a node stands among others; -1: nowhere."""
    for k in range(len(nodes)):
        if nodes[k] == node:
            return k
    return -1


@lean_piece
def known_chance(sensors, node, nodes, chances, mean, cov, c):
    """`chance` of any node; those of the candidates have been filled in."""
    k = place_of(node, nodes)
    return chances[k] if k >= 0 else chance(sensors, node, mean, cov, c)


@lean_piece
def order_row(sensors, head, mean, cov, lam, nodes, chances, c, left, ordered, drops):
    """Greedy order of one row's candidates: each next one is the best after those before it, by the drop of the root of
    the position covariance's trace that it brings [m], less lam times its price.

    Args:
        head: senses anyhow and is conditioned on first; -1: none.
        mean, cov: predicted.
        lam: m/mJ; 0: by information alone.
        nodes, chances: (K,) candidates, -1: none, and their `fill_chances`.
        left: (K,) room for the chances of those still to be ordered.
        ordered: (M,) filled with the first M of them; -1 at the end where candidates are missing or are the head.
        drops: (K,) room for the drop that each brings [m].
    """
    p00, p01, p11 = cov[0, 0], cov[0, 2], cov[2, 2]
    if head >= 0:
        detection = known_chance(sensors, head, nodes, chances, mean, cov, c)
        _, p00, p01, p11 = gain(detection, sensors, head, mean, cov, p00, p01, p11, c)
    ordered[:] = -1
    drops[:] = 0.0
    for k in range(len(nodes)):
        left[k] = chances[k] if nodes[k] != head else -1.0
    # Positions tell the same from everywhere: who is most likely to detect tells most.
    by_chance = c.model == POSITION and lam == 0.0
    for slot in range(len(ordered)):
        best, most, most_drop, after = -1, -np.inf, 0.0, (p00, p01, p11)
        for k in range(len(nodes)):
            if left[k] < 0.0 or (by_chance and left[k] <= most):
                continue
            if by_chance:
                best, most = k, left[k]
                continue
            g, q00, q01, q11 = gain(left[k], sensors, nodes[k], mean, cov, p00, p01, p11, c)
            drop = np.sqrt(p00 + p11) - np.sqrt(max(p00 + p11 - g, 0.0))
            value = drop
            if lam > 0.0:
                value -= lam * price_mj(left[k], sensors, nodes[k], head, mean, c)
            if value > most:
                best, most, most_drop, after = k, value, drop, (q00, q01, q11)
        if best < 0:
            break
        if by_chance:
            g, q00, q01, q11 = gain(most, sensors, nodes[best], mean, cov, p00, p01, p11, c)
            most_drop, after = np.sqrt(p00 + p11) - np.sqrt(max(p00 + p11 - g, 0.0)), (q00, q01, q11)
        left[best] = -1.0
        ordered[slot] = nodes[best]
        drops[slot] = most_drop
        p00, p01, p11 = after


@lean_piece
def rank_row(by, rule, sensors, head, mean, cov, lam, nodes, chances, c, left, ordered, drops):
    """Who would lead under a rule, and the candidates in the order that they would join.

    Args:
        by: place in ORDERS.
        rule: KEEP: the present head, or the best if there is none; BEST: the first in the order; AHEAD: the candidate
            nearest to a point LEAD sensing radii ahead of the prediction, which the target takes longer to leave.
        chances: not read where the nearest come first.
        The rest: as `order_row`.

    Returns: the leader; -1: no candidate.
    """
    leader = -1
    if rule == KEEP:
        leader = head
    elif rule == AHEAD:
        leader = _nearest_ahead(sensors, mean, nodes, c)
    if by == NEAREST:
        for k in range(len(nodes)):
            ordered[k] = nodes[k]
    else:
        price = lam if by == VALUE else 0.0
        order_row(sensors, leader, mean, cov, price, nodes, chances, c, left, ordered, drops)
    return leader if leader >= 0 else ordered[0]


@lean_piece
def _nearest_ahead(sensors, mean, nodes, c):
    speed = np.sqrt(mean[1] * mean[1] + mean[3] * mean[3])
    way = LEAD * c.radius_m / max(speed, 1e-9)
    x, y = mean[0] + way * mean[1], mean[2] + way * mean[3]
    best, shortest = -1, np.inf
    for node in nodes:
        if node >= 0:
            squared = squared_distance(sensors.positions, node, x, y)
            if squared < shortest:
                best, shortest = node, squared
    return best


@kernel
def order_by_merit(start, stop, cs, positions, receivers, heads, beliefs, lams, nodes, ordered):
    """`order_row` for every row.

    Args:
        heads, lams: (B,).
        nodes: (B, K) candidates, -1: none.
        ordered: (B, M) filled with the first M of them.
    """
    chances, left, drops = np.empty(nodes.shape[1]), np.empty(nodes.shape[1]), np.empty(nodes.shape[1])
    for b in range(start, stop):
        mean, cov = beliefs[b].predicted_mean, beliefs[b].predicted_cov
        sensors = Sensors(positions[b], receivers[b])
        fill_chances(sensors, nodes[b], mean, cov, cs[0], chances)
        order_row(sensors, heads[b], mean, cov, lams[b], nodes[b], chances, cs[0], left, ordered[b], drops)
