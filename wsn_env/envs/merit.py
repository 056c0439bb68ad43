"""The order in which candidates are worth waking: nearest first, by information, or by information less its price."""

from typing import Any

import numpy as np
from numba.extending import overload

from wsn_env.compiled.kernels import kernel, lean_piece
from wsn_env.models.field import squared_distance
from wsn_env.models.measurement.base import (
    Order,
    chance,
    equal_everywhere,
    informs,
    linearise,
    node_of,
    packets_a_report,
)
from wsn_env.models.radio.base import reception, transmission
from wsn_env.models.state import Sensors, knowledge_at, sensors_of
from wsn_env.simulation.messages import outside

ORDERS: tuple[Order, ...] = ("nearest", "information", "value")
NEAREST, INFORMATION, VALUE = range(len(ORDERS))
KEEP, BEST, AHEAD = range(3)  # who leads
LEAD = 0.3  # sensing radii


@lean_piece
def chance_of(sensors: Sensors, node: int, mean: np.ndarray, cov: np.ndarray, c: Any) -> float:
    """Probability that the node has something to report, under the belief."""
    place = node_of(sensors, node)
    return chance(c.measurement, place, mean[0], mean[2], cov[0, 0], cov[0, 2], cov[2, 2], c)


@lean_piece
def gain(
    detection: float,
    sensors: Sensors,
    node: int,
    mean: np.ndarray,
    cov: np.ndarray,
    p00: float,
    p01: float,
    p11: float,
    c: Any,
) -> tuple[float, float, float, float]:
    """Expected drop of the position covariance's trace by one report of `node` [m^2], and the covariance after it.

    Linearised at the prediction. The report comes with probability p, and with it what a report takes from the
    covariance: the mean over both cases (Sinopoli et al., 2004, for Kalman filters with lost measurements).

    Args:
        sensors: the row's Sensors.
        detection: its `chance_of` p.
        p00, p01, p11: position covariance so far, after the nodes already chosen [m^2].

    Returns: gain, and the three entries of the covariance after.
    """
    place = node_of(sensors, node)
    lines = linearise(c.measurement, place, mean[0], mean[2], cov[0, 0], cov[0, 2], cov[2, 2])
    return drop_by(lines, informs(c.measurement, detection), p00, p01, p11)


def drop_by(lines: Any, probability: float, p00: float, p01: float, p11: float) -> tuple[float, float, float, float]:
    """`gain` of a report of one linear number, or of two with independent noise, that comes with this probability."""
    return (_drop_by_one if len(lines) == 1 else _drop_by_two)(lines, probability, p00, p01, p11)


@overload(drop_by)
def _drop_by(lines, probability, p00, p01, p11):
    chosen = _drop_by_one if len(lines) == 1 else _drop_by_two
    return lambda lines, probability, p00, p01, p11: chosen(lines, probability, p00, p01, p11)


@lean_piece
def _drop_by_one(lines, probability, p00, p01, p11):
    h0, h1 = lines[0].slope_x, lines[0].slope_y
    b0, b1 = p00 * h0 + p01 * h1, p01 * h0 + p11 * h1
    share = probability / (h0 * b0 + h1 * b1 + lines[0].variance)
    return share * (b0 * b0 + b1 * b1), p00 - share * b0 * b0, p01 - share * b0 * b1, p11 - share * b1 * b1


@lean_piece
def _drop_by_two(lines, probability, p00, p01, p11):
    """With G = P H' and S = H P H' + R it is p G S^-1 G'."""
    one, two = lines[0], lines[1]
    g00, g10 = p00 * one.slope_x + p01 * one.slope_y, p01 * one.slope_x + p11 * one.slope_y
    g01, g11 = p00 * two.slope_x + p01 * two.slope_y, p01 * two.slope_x + p11 * two.slope_y
    s00 = one.slope_x * g00 + one.slope_y * g10 + one.variance
    s01 = one.slope_x * g01 + one.slope_y * g11
    s11 = two.slope_x * g01 + two.slope_y * g11 + two.variance
    share = probability / (s00 * s11 - s01 * s01)
    c00 = share * (g00 * g00 * s11 - 2.0 * g00 * s01 * g01 + g01 * g01 * s00)
    c11 = share * (g10 * g10 * s11 - 2.0 * g10 * s01 * g11 + g11 * g11 * s00)
    c01 = share * (g00 * s11 * g10 - g00 * s01 * g11 - g01 * s01 * g10 + g01 * s00 * g11)
    return c00 + c11, p00 - c00, p01 - c01, p11 - c11


@lean_piece
def awake_j(sensors: Sensors, node: int, c: Any) -> float:
    """What a node pays for being awake for a period instead of asleep, packets apart [J]."""
    return c.radio.awake_j - c.radio.asleep_j


@lean_piece
def price_mj(detection: float, sensors: Sensors, node: int, head: int, mean: np.ndarray, c: Any) -> float:
    """Expected energy of a node's being awake for the period instead of asleep, and of its report [mJ].

    The report goes to the head, or as far as the prediction where the head is still open; to the sink; to the target.
    """
    x, y = mean[0], mean[2]
    if not c.radio.to_head:
        x, y = outside(mean, c.radio)
    elif head >= 0:
        x, y = sensors.positions[head, 0], sensors.positions[head, 1]
    squared = squared_distance(sensors.positions, node, x, y)
    packets = packets_a_report(c.measurement)
    report = packets * transmission(c.radio, c.radio.report_bits, squared)
    if c.radio.to_head:
        report += packets * reception(c.radio, c.radio.report_bits)
    return 1e3 * (detection * report + c.radio.awake_j - c.radio.asleep_j)


@lean_piece
def fill_chances(
    sensors: Sensors, nodes: np.ndarray, mean: np.ndarray, cov: np.ndarray, c: Any, chances: np.ndarray
) -> None:
    """chances (K,): of the candidates `nodes`; -1: none."""
    for k in range(len(nodes)):
        chances[k] = chance_of(sensors, nodes[k], mean, cov, c) if nodes[k] >= 0 else -1.0


@lean_piece
def place_of(node: int, nodes: np.ndarray) -> int:
    """Where a node stands among others; -1: nowhere."""
    for k in range(len(nodes)):
        if nodes[k] == node:
            return k
    return -1


@lean_piece
def known_chance(
    sensors: Sensors, node: int, nodes: np.ndarray, chances: np.ndarray, mean: np.ndarray, cov: np.ndarray, c: Any
) -> float:
    """`chance_of` any node; those of the candidates have been filled in."""
    k = place_of(node, nodes)
    return chances[k] if k >= 0 else chance_of(sensors, node, mean, cov, c)


@lean_piece
def order_row(
    sensors: Sensors,
    head: int,
    mean: np.ndarray,
    cov: np.ndarray,
    lam: float,
    nodes: np.ndarray,
    chances: np.ndarray,
    c: Any,
    left: np.ndarray,
    ordered: np.ndarray,
    drops: np.ndarray,
) -> None:
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
    # Where reports tell the same from everywhere, who is most likely to detect tells most.
    by_chance = equal_everywhere(c.measurement) and lam == 0.0
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
def rank_row(
    by: int,
    rule: int,
    sensors: Sensors,
    head: int,
    mean: np.ndarray,
    cov: np.ndarray,
    lam: float,
    nodes: np.ndarray,
    chances: np.ndarray,
    c: Any,
    left: np.ndarray,
    ordered: np.ndarray,
    drops: np.ndarray,
) -> int:
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
def order_by_merit(
    start: int,
    stop: int,
    cs: Any,
    handle: np.ndarray,
    heads: np.ndarray,
    lams: Any,
    nodes: np.ndarray,
    ordered: np.ndarray,
) -> None:
    """`order_row` for every row of what the network knows (Knowledge).

    Args:
        heads, lams: (B,).
        nodes: (B, K) candidates, -1: none.
        ordered: (B, M) filled with the first M of them.
    """
    known = knowledge_at(handle)
    chances, left, drops = np.empty(nodes.shape[1]), np.empty(nodes.shape[1]), np.empty(nodes.shape[1])
    for b in range(start, stop):
        mean, cov = known.belief[b].predicted_mean, known.belief[b].predicted_cov
        sensors = sensors_of(known, b)
        fill_chances(sensors, nodes[b], mean, cov, cs[0], chances)
        order_row(sensors, heads[b], mean, cov, lams[b], nodes[b], chances, cs[0], left, ordered[b], drops)
