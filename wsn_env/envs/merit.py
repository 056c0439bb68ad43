"""The order in which candidates are worth waking: nearest first, by information, or by information less its price."""

from typing import Any, NamedTuple

import numpy as np

from wsn_env.compiled.arrays import record
from wsn_env.compiled.kernels import kernel, lean_piece
from wsn_env.envs.expectations import Outlook, outlook_of
from wsn_env.models.measurement.base import Order
from wsn_env.models.radio.base import reception, transmission
from wsn_env.models.state import knowledge_at
from wsn_env.simulation.messages import outside

ORDERS: tuple[Order, ...] = ("nearest", "information", "value")
NEAREST, INFORMATION, VALUE = range(len(ORDERS))
KEEP, BEST, AHEAD = range(3)  # who leads
LEAD = 0.3  # sensing radii

RANKED = record(
    [
        ("place", "i8"),  # among the candidates; -1: none is left
        ("drop_m", "f8"),  # of the position sd, by its report after those before it
    ]
)


class PositionCov(NamedTuple):
    """Covariance of a position [m^2]."""

    xx: float
    xy: float
    yy: float


@lean_piece
def position_cov(cov: np.ndarray) -> PositionCov:
    """Of a state's covariance (4, 4)."""
    return PositionCov(cov[0, 0], cov[0, 2], cov[2, 2])


@lean_piece
def gain(node: Any, arrival: float, p: PositionCov) -> tuple[float, PositionCov]:
    """Expected drop of the position covariance's trace by one report [m^2], and the covariance after it.

    Linearised at the prediction. The report comes with a probability, and with it what a report takes from the
    covariance: the mean over both cases (Sinopoli et al., 2004, for Kalman filters with lost measurements).

    Args:
        node: EXPECTED, of who is awake.
        arrival: probability that a report of it arrives.
        p: so far, after the nodes already chosen.
    """
    probability = informing(node, arrival)
    return _gain_of_one(node, probability, p) if node.numbers == 1 else _gain_of_two(node, probability, p)


@lean_piece
def informing(node: Any, arrival: float) -> float:
    """Probability that a node's being awake tells what its report would."""
    return 1.0 if node.silence_informs else node.detection * arrival


@lean_piece
def _gain_of_one(node, probability, p):
    h0, h1 = node.slope_x[0], node.slope_y[0]
    b0, b1 = p.xx * h0 + p.xy * h1, p.xy * h0 + p.yy * h1
    share = probability / (h0 * b0 + h1 * b1 + node.variance[0])
    after = PositionCov(p.xx - share * b0 * b0, p.xy - share * b0 * b1, p.yy - share * b1 * b1)
    return share * (b0 * b0 + b1 * b1), after


@lean_piece
def _gain_of_two(node, probability, p):
    """Two numbers with independent noise: with G = P H' and S = H P H' + R it is p G S^-1 G'."""
    h00, h01, h10, h11 = node.slope_x[0], node.slope_y[0], node.slope_x[1], node.slope_y[1]
    g00, g10 = p.xx * h00 + p.xy * h01, p.xy * h00 + p.yy * h01
    g01, g11 = p.xx * h10 + p.xy * h11, p.xy * h10 + p.yy * h11
    s00 = h00 * g00 + h01 * g10 + node.variance[0]
    s01 = h00 * g01 + h01 * g11
    s11 = h10 * g01 + h11 * g11 + node.variance[1]
    share = probability / (s00 * s11 - s01 * s01)
    c00 = share * (g00 * g00 * s11 - 2.0 * g00 * s01 * g01 + g01 * g01 * s00)
    c11 = share * (g10 * g10 * s11 - 2.0 * g10 * s01 * g11 + g11 * g11 * s00)
    c01 = share * (g00 * s11 * g10 - g00 * s01 * g11 - g01 * s01 * g10 + g01 * s00 * g11)
    return c00 + c11, PositionCov(p.xx - c00, p.xy - c01, p.yy - c11)


@lean_piece
def sd_drop(p: PositionCov, drop: float) -> float:
    """Drop of the root of a covariance's trace [m] where the trace drops by so much [m^2]."""
    return np.sqrt(p.xx + p.yy) - np.sqrt(max(p.xx + p.yy - drop, 0.0))


@lean_piece
def squared_between(one: Any, other: Any) -> float:
    """Squared distance of two nodes (EXPECTED) [m^2]."""
    dx, dy = one.x - other.x, one.y - other.y
    return dx * dx + dy * dy


@lean_piece
def squared_to(node: Any, x: float, y: float) -> float:
    """Squared distance of a node (EXPECTED) from a point [m^2]."""
    dx, dy = node.x - x, node.y - y
    return dx * dx + dy * dy


@lean_piece
def report_way(node: Any, outlook: Outlook, leader: int, r: Any) -> float:
    """Squared distance that a report goes [m^2]: to the head, or as far as the prediction where the head is still open;
    to the sink; to the target.

    Args:
        leader: the head's place among the outlook's nodes; -1: open.
        r: the radio's constants.
    """
    if r.to_head and leader >= 0:
        return squared_between(node, outlook.nodes[leader])
    mean = outlook.mean
    x, y = (mean[0], mean[2]) if r.to_head else outside(mean, r)
    return squared_to(node, x, y)


@lean_piece
def price_mj(node: Any, outlook: Outlook, leader: int, r: Any) -> float:
    """Expected energy of a node's being awake for the period instead of asleep, and of its report [mJ]."""
    squared = report_way(node, outlook, leader, r)
    report = node.packets * transmission(r, r.report_bits, squared)
    if r.to_head:
        report += node.packets * reception(r, r.report_bits)
    if node.shared:
        return 1e3 * node.detection * report
    return 1e3 * (node.detection * report + r.awake_j - r.asleep_j)


@lean_piece
def order_row(outlook: Outlook, leader: int, lam: float, c: Any, ranking: np.ndarray) -> None:
    """Greedy order of one row's candidates: each next one is the best after those before it, by the drop of the root of
    the position covariance's trace that it brings [m], less lam times its price.

    Args:
        leader: place among the outlook's nodes of who senses anyhow and is conditioned on first; -1: nobody.
        lam: m/mJ; 0: by information alone.
        c: the scenario's common constants.
        ranking: (M,) RANKED, filled with the first M; place -1 at the end where candidates are missing or are the head.
    """
    nodes, p, head = outlook.nodes, position_cov(outlook.cov), np.int64(-1)
    if leader >= 0:
        head = nodes[leader].node
        _, p = gain(nodes[leader], 1.0, p)
    for k in range(outlook.candidates):
        nodes[k].open = nodes[k].node >= 0 and nodes[k].node != head
        nodes[k].price_m = lam * price_mj(nodes[k], outlook, leader, c.radio) if lam > 0.0 else 0.0
    # Where reports tell the same from everywhere, who is most likely to detect tells most.
    by_chance = c.equal_everywhere and lam == 0.0
    for slot in range(len(ranking)):
        best, most, most_drop, after = -1, -np.inf, 0.0, p
        for k in range(outlook.candidates):
            if not nodes[k].open:
                continue
            if by_chance:
                if nodes[k].detection > most:
                    best, most = k, nodes[k].detection
                continue
            trace, rest = gain(nodes[k], 1.0, p)
            drop = sd_drop(p, trace)
            value = drop - nodes[k].price_m
            if value > most:
                best, most, most_drop, after = k, value, drop, rest
        if best >= 0:
            if by_chance:
                trace, after = gain(nodes[best], 1.0, p)
                most_drop = sd_drop(p, trace)
            nodes[best].open = 0
            p = after
        ranking[slot].place, ranking[slot].drop_m = best, most_drop


@lean_piece
def rank_row(by: int, rule: int, outlook: Outlook, c: Any, ranking: np.ndarray) -> int:
    """Who would lead under a rule, and the candidates in the order that they would join.

    Args:
        by: place in ORDERS; NEAREST asks no more of the outlook than PLACES, the others REPORTS.
        rule: KEEP: the present head, or the best if there is none; BEST: the first in the order; AHEAD: the candidate
            nearest to a point LEAD sensing radii ahead of the prediction, which the target takes longer to leave.
        c: the scenario's common constants.
        ranking: (K,) RANKED, filled.

    Returns: the leader's place among the outlook's nodes; -1: nobody could lead.
    """
    nodes, leader = outlook.nodes, -1
    if rule == KEEP and nodes[outlook.candidates].node >= 0:
        leader = outlook.candidates
    elif rule == AHEAD:
        leader = _nearest_ahead(outlook, c.radius_m)
    if by == NEAREST:
        for k in range(outlook.candidates):
            ranking[k].place = k if nodes[k].node >= 0 else -1
    else:
        order_row(outlook, leader, outlook.lam if by == VALUE else 0.0, c, ranking)
    return leader if leader >= 0 else ranking[0].place


@lean_piece
def _nearest_ahead(outlook, radius_m):
    mean = outlook.mean
    speed = np.sqrt(mean[1] * mean[1] + mean[3] * mean[3])
    way = LEAD * radius_m / max(speed, 1e-9)
    x, y = mean[0] + way * mean[1], mean[2] + way * mean[3]
    best, shortest = -1, np.inf
    for k in range(outlook.candidates):
        if outlook.nodes[k].node >= 0:
            squared = squared_to(outlook.nodes[k], x, y)
            if squared < shortest:
                best, shortest = k, squared
    return best


@kernel
def order_by_information(
    start: int, stop: int, cs: Any, handle: np.ndarray, keeps: np.ndarray, found: Any, ordered: np.ndarray
) -> None:
    """`order_row` by information alone, for every row of what the network knows (Knowledge).

    Args:
        cs: the scenario's common constants.
        keeps: (B,) bool: the standing head leads; else nobody does yet.
        found: nodes and table of an Expected to the depth REPORTS.
        ordered: (B, M) filled with the first M nodes, -1 at the end.
    """
    known, ranking = knowledge_at(handle), np.empty(ordered.shape[1], RANKED)
    for b in range(start, stop):
        _order_by_information(b, cs[0], known, keeps, found, ranking, ordered)


@lean_piece
def _order_by_information(b, c, known, keeps, found, ranking, ordered):
    nodes, table = found
    candidates = nodes.shape[1]
    outlook = outlook_of(known, b, candidates, table)
    order_row(outlook, candidates if keeps[b] else -1, 0.0, c, ranking)
    for slot in range(len(ranking)):
        place = ranking[slot].place
        ordered[b, slot] = nodes[b, place] if place >= 0 else -1
