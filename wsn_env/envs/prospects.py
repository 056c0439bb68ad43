"""What each entry of the menu promises: the belief, the energy and the cluster that a choice would leave."""

from typing import Any

import numpy as np

from wsn_env.compiled.elementary import expected_error, log
from wsn_env.compiled.kernels import lean_piece
from wsn_env.envs.merit import awake_j, chance_of, fill_chances, gain, known_chance, place_of
from wsn_env.models.field import squared_distance
from wsn_env.models.measurement.base import chance, node_of, packets_a_report
from wsn_env.models.radio.base import reception, transmission
from wsn_env.models.state import Sensors
from wsn_env.simulation.messages import outside

ENTRY_FEATURES = (
    "standing",  # 1: the cluster as it is
    "moves",  # 1: the head's role goes to the best node
    "members",  # further ones
    "invited",  # of them, who sleep
    "sd",  # log of the expected root of the position covariance's trace
    "sd_drop",  # log of its ratio to the prediction's
    "error_cost",  # expected error, in a learner's unit of cost
    "energy_cost",  # lam times expected energy, in the same
    "energy",  # its root, in roots of what the scenario calls typical
    "detections",  # expected
    "silence",  # probability that no report comes
    "hold",  # probability of a detection AHEAD periods on, if the target keeps its velocity
    "head_ahead",  # where the head stands, in radii along and across the velocity
    "head_left",
    "head_distance",
    "head_detection",
)
AHEAD = 3.0  # periods


@lean_piece
def foresee(sensors: Sensors, known: Any, m: Any, p: Any, c: Any) -> None:
    """Fill in what is `known` of the candidates, of a row's Sensors: (K,) nodes, -1 for none, and room (K,) for their
    chances of detection now and AHEAD periods on."""
    nodes, chances, later = known
    fill_chances(sensors, nodes, m, p, c, chances)
    for k in range(len(nodes)):
        later[k] = _chance_later(sensors, nodes[k], m, p, c) if nodes[k] >= 0 else -1.0


@lean_piece
def describe_standing(
    sensors: Sensors,
    standing: Any,
    members: np.ndarray,
    known: Any,
    m: Any,
    p: Any,
    way: Any,
    numbers: Any,
    c: Any,
    f: np.ndarray,
) -> None:
    """Fill f with ENTRY_FEATURES of the standing cluster.

    Args:
        standing, members: the row's NETWORK and its members; without a head all features but `sd` are 0.
        known: of the candidates, by `foresee`.
        m, p: predicted mean and covariance; way: direction of its velocity.
        numbers: lam [m/mJ], the scenario's typical cost at lam [m], its typical energy [mJ].
    """
    f[:] = 0.0
    f[0] = 1.0
    after, energy, sums = _begin(p), 0.0, (0.0, 1.0, 1.0)
    if standing.head >= 0:
        after, energy, sums = _add_head(sensors, standing.head, standing.head, known, m, p, after, sums, c)
        for k in range(standing.n_members):
            after, price, sums = _add(sensors, members[k], standing.head, False, known, m, p, after, sums, c)
            energy += price
        _write_head(sensors, standing.head, known, m, p, way, c, f)
    _write(standing.n_members, 0, p, after, energy, sums, numbers, f)


@lean_piece
def describe_entries(
    sensors: Sensors,
    standing: Any,
    members: np.ndarray,
    known: Any,
    nodes: np.ndarray,
    head: int,
    m: Any,
    p: Any,
    way: Any,
    numbers: Any,
    c: Any,
    width: int,
    entries: np.ndarray,
) -> None:
    """Fill entries (N * width,) with ENTRY_FEATURES of the head and the first n further nodes, n = 0..N - 1.

    Args:
        nodes: (K,) candidates in order of merit, -1: none; the head may be among them.
        head: who would lead, alive; -1: nobody could.
    """
    old, count = standing.head, standing.n_members
    after, energy, sums = _begin(p), 0.0, (0.0, 1.0, 1.0)
    if head >= 0:
        after, energy, sums = _add_head(sensors, head, old, known, m, p, after, sums, c)
    slot, invited = 0, 0
    for n in range(len(entries) // width):
        f = entries[n * width : (n + 1) * width]
        f[:] = 0.0
        if n > 0 and head >= 0:
            while slot < len(nodes) and (nodes[slot] == head or nodes[slot] < 0):
                slot += 1
            if slot < len(nodes):
                node = nodes[slot]
                slot += 1
                awake = node == old or place_of(node, members[:count]) >= 0
                called = not awake or (c.radio.to_head and head != old)  # a new head calls all of them
                after, price, sums = _add(sensors, node, head, called, known, m, p, after, sums, c)
                energy += price
                invited += called
        f[1] = 1.0 if head != old else 0.0
        if head >= 0:
            _write_head(sensors, head, known, m, p, way, c, f)
        _write(n, invited, p, after, energy, sums, numbers, f)


@lean_piece
def _begin(p):
    """Position covariance before any report."""
    return p[0, 0], p[0, 2], p[2, 2]


@lean_piece
def _chance_later(sensors, node, m, p, c):
    """Of detecting the target AHEAD periods on, if it keeps its velocity."""
    t = AHEAD * c.period_s
    pxx = p[0, 0] + t * (2.0 * p[0, 1] + t * p[1, 1])
    pxy = p[0, 2] + t * (p[0, 3] + p[1, 2] + t * p[1, 3])
    pyy = p[2, 2] + t * (2.0 * p[2, 3] + t * p[3, 3])
    place = node_of(sensors, node)
    return chance(c.measurement, place, m[0] + t * m[1], m[2] + t * m[3], pxx, pxy, pyy, c)


@lean_piece
def _chances(sensors, node, known, m, p, c):
    """Of any node, now and AHEAD periods on."""
    nodes, chances, later = known
    k = place_of(node, nodes)
    if k >= 0:
        return chances[k], later[k]
    return chance_of(sensors, node, m, p, c), _chance_later(sensors, node, m, p, c)


@lean_piece
def _count(sums, detection, arrival, later):
    """Expected detections, probability of silence, and of none AHEAD periods on, with one node more."""
    return sums[0] + detection, sums[1] * (1.0 - detection * arrival), sums[2] * (1.0 - later)


@lean_piece
def _add_head(sensors, head, old, known, m, p, after, sums, c):
    """The head's own report, and the handover to it [mJ]."""
    detection, later = _chances(sensors, head, known, m, p, c)
    _, p00, p01, p11 = gain(detection * c.radio.head_delivery, sensors, head, m, p, after[0], after[1], after[2], c)
    joules = awake_j(sensors, head, c)
    if not c.radio.to_head:
        joules += _report_j(sensors, head, head, detection, m, c)
    elif old >= 0 and head != old:
        squared = squared_distance(sensors.positions, old, sensors.positions[head, 0], sensors.positions[head, 1])
        hops = max(np.ceil(np.sqrt(squared) / c.radio.hop_m), 1.0)
        bits = c.radio.handover_bits
        joules += hops * (transmission(c.radio, bits, squared) + reception(c.radio, bits))
    return (p00, p01, p11), 1e3 * joules, _count(sums, detection, c.radio.head_delivery, later)


@lean_piece
def _add(sensors, node, head, called, known, m, p, after, sums, c):
    """A member's report, its invitation if it is called, its being awake [mJ]."""
    detection, later = _chances(sensors, node, known, m, p, c)
    _, p00, p01, p11 = gain(detection * c.radio.delivery, sensors, node, m, p, after[0], after[1], after[2], c)
    joules = awake_j(sensors, node, c) + _report_j(sensors, node, head, detection, m, c)
    if called:
        joules += reception(c.radio, c.radio.invitation_bits)
        if c.radio.to_head:
            squared = squared_distance(sensors.positions, node, sensors.positions[head, 0], sensors.positions[head, 1])
            joules += transmission(c.radio, c.radio.invitation_bits, squared)
    return (p00, p01, p11), 1e3 * joules, _count(sums, detection, c.radio.delivery, later)


@lean_piece
def _report_j(sensors, node, head, detection, m, c):
    """Expected energy of a report with its retries [J]."""
    if c.radio.to_head:
        x, y, hearing = sensors.positions[head, 0], sensors.positions[head, 1], reception(c.radio, c.radio.report_bits)
    else:
        x, y = outside(m, c.radio)
        hearing = 0.0
    r = c.radio
    tries = r.delivery / r.packet_success if r.packet_success > 0.0 else float(r.tries)
    sending = transmission(c.radio, c.radio.report_bits, squared_distance(sensors.positions, node, x, y))
    return packets_a_report(c.measurement) * detection * tries * (sending + hearing)


@lean_piece
def _write_head(sensors, head, known, m, p, way, c, f):
    dx, dy = (sensors.positions[head, 0] - m[0]) / c.radius_m, (sensors.positions[head, 1] - m[2]) / c.radius_m
    f[12] = dx * way[0] + dy * way[1]
    f[13] = dy * way[0] - dx * way[1]
    f[14] = np.sqrt(dx * dx + dy * dy)
    f[15] = known_chance(sensors, head, known[0], known[1], m, p, c)


@lean_piece
def _write(n, invited, p, after, energy, sums, numbers, f):
    lam, unit, typical_mj = numbers
    before = max(p[0, 0] + p[2, 2], 1e-12)
    left = max(after[0] + after[2], 1e-12)
    f[2] = 0.25 * n
    f[3] = 0.25 * invited
    f[4] = 0.5 * log(left)
    f[5] = 0.5 * log(left / before)
    f[6] = expected_error(after[0], after[1], after[2]) / unit
    f[7] = lam * energy / unit
    f[8] = np.sqrt(energy / typical_mj)
    f[9] = 0.25 * sums[0]
    f[10] = sums[1]
    f[11] = 1.0 - sums[2]
