"""The predicted outcome of each entry of the menu: the belief, the energy and the cluster that a choice would leave."""

from typing import Any, NamedTuple

import numpy as np

from wsn_env.compiled.elementary import expected_error, log
from wsn_env.compiled.kernels import lean_piece
from wsn_env.envs.expectations import Outlook
from wsn_env.envs.feature import Feature, amount, flag, share
from wsn_env.envs.features import Heading
from wsn_env.envs.merit import PositionCov, gain, position_cov, report_way, squared_between
from wsn_env.envs.others import ENTRY_FEATURES as OTHERS
from wsn_env.models.radio.base import reception, transmission
from wsn_env.scenario import Scenario

ENTRY_FEATURES = {
    "standing": flag("1: keeps the present cluster"),
    "moves": flag("1: another node becomes the head"),
    "members": amount("members, without the head", "4 nodes"),
    "invited": amount("those of them that sleep now and are invited", "4 nodes"),
    "sd": Feature("expected root of the trace of the position covariance after the reports", "ln m"),
    "sd_drop": Feature("the same over that of the prediction", "ln", high=0.0),
    "error_cost": amount("expected error", "typical cost"),
    "energy_cost": amount("lam times the expected energy", "typical cost"),
    "energy": amount("root of the expected energy over the scenario's `typical_energy_mj`"),
    "detections": amount("expected number of nodes that detect", "4 nodes"),
    "silence": share("probability that no report comes"),
    "hold": share("probability that at least one detects three time steps on, if the target keeps its velocity"),
    "head_ahead": Feature("where the head would stand from the prediction, along the velocity", "radius"),
    "head_left": Feature("the same across it, to the left", "radius"),
    "head_distance": amount("distance of that head to the prediction", "radius"),
    "head_detection": share("probability that it detects the target"),
}
ENERGY_FEATURES = {  # behind them, where energy is scarce
    "head_energy": share("energy left in the head, as a share of its battery"),
    "least_energy": share("the same of the node of the cluster that has least"),
}
WIDTH, ENERGIES, SHARED = len(ENTRY_FEATURES), len(ENERGY_FEATURES), len(OTHERS)


def entry_features(scenario: Scenario) -> dict[str, Feature]:
    """What observations tell of a discrete action: its predicted outcome."""
    more = (ENERGY_FEATURES if scenario.scarce_energy else {}) | (OTHERS if scenario.tells_others else {})
    return ENTRY_FEATURES | more


class Units(NamedTuple):
    """What costs are told in."""

    cost_m: float  # the scenario's typical cost at the row's lam
    energy_mj: float  # its typical energy


@lean_piece
def units_of(lam: float, c: Any) -> Units:
    """At this lam [m/mJ]: `Scenario.typical_cost`, compiled.

    Args:
        c: the scenario's common constants.
    """
    cost_m = c.typical_error_m * np.sqrt(1.0 + lam * c.typical_energy_mj / c.typical_error_m)
    return Units(cost_m, c.typical_energy_mj)


class Tally(NamedTuple):
    """Of the nodes of a cluster counted so far."""

    p: PositionCov  # expected after their reports
    energy_mj: float  # expected
    detections: float  # expected
    silence: float  # probability that no report comes
    missed_ahead: float  # probability that none detects AHEAD periods on
    least_left: float  # share of the battery of the node that has least
    shared: int  # nodes that stand in the cluster of another target


@lean_piece
def describe_standing(outlook: Outlook, heading: Heading, units: Units, c: Any, f: np.ndarray) -> None:
    """Fill f with ENTRY_FEATURES of the standing cluster; without a head all but `standing` and `sd` are 0.

    Args:
        outlook: to the depth REPORTS_AHEAD.
        heading: of the predicted velocity.
        c: the scenario's common constants.
    """
    f[:] = 0.0
    f[0] = 1.0
    head, tally = outlook.candidates, _nobody(outlook)
    if outlook.nodes[head].node >= 0:
        tally = _with_head(tally, outlook, head, c.radio)
        for k in range(head + 1, len(outlook.nodes)):
            tally = _with_member(tally, outlook, k, head, False, c.radio)
        _write_head(outlook, head, heading, c.radius_m, f)
    _write(len(outlook.nodes) - head - 1, 0, tally, outlook, units, f)
    _write_more(outlook.nodes[head].left if outlook.nodes[head].node >= 0 else 0.0, tally, c, f)


@lean_piece
def describe_entries(
    outlook: Outlook, ranking: np.ndarray, leader: int, heading: Heading, units: Units, c: Any, entries: np.ndarray
) -> None:
    """Fill entries (N * width,) with ENTRY_FEATURES of the leader and the first 0..N - 1 further candidates.

    Args:
        ranking: (K,) RANKED, the candidates in order of merit; the leader may be among them.
        leader: its place among the outlook's nodes; -1: nobody could lead.
        The rest: as `describe_standing`.
    """
    nodes, tally, old = outlook.nodes, _nobody(outlook), outlook.nodes[outlook.candidates].node
    head = np.int64(-1)
    if leader >= 0:
        head = nodes[leader].node
        tally = _with_head(tally, outlook, leader, c.radio)
    slot, invited = 0, 0
    width = WIDTH + (ENERGIES if c.scarce_energy else 0) + (SHARED if c.tells_others else 0)
    for n in range(len(entries) // width):
        f = entries[n * width : (n + 1) * width]
        f[:] = 0.0
        if n > 0 and head >= 0:
            while slot < len(ranking) and (ranking[slot].place < 0 or nodes[ranking[slot].place].node == head):
                slot += 1
            if slot < len(ranking):
                place = ranking[slot].place
                slot += 1
                # A new head calls all of them.
                called = (c.radio.to_head and head != old) or not stands(outlook, nodes[place].node)
                tally = _with_member(tally, outlook, place, leader, called, c.radio)
                invited += called
        f[1] = 1.0 if head != old else 0.0
        if head >= 0:
            _write_head(outlook, leader, heading, c.radius_m, f)
        _write(n, invited, tally, outlook, units, f)
        _write_more(nodes[leader].left if head >= 0 else 0.0, tally, c, f)


@lean_piece
def stands(outlook: Outlook, node: int) -> bool:
    """Whether a node is part of the standing cluster."""
    found = False
    for k in range(outlook.candidates, len(outlook.nodes)):
        found |= outlook.nodes[k].node == node
    return found


@lean_piece
def _nobody(outlook):
    return Tally(position_cov(outlook.cov), 0.0, 0.0, 1.0, 1.0, 1.0, 0)


@lean_piece
def _counted(tally, node, arrival, joules):
    """The tally with one node more."""
    return Tally(
        gain(node, arrival, tally.p)[1],
        tally.energy_mj + 1e3 * joules,
        tally.detections + node.detection,
        tally.silence * (1.0 - node.detection * arrival),
        tally.missed_ahead * (1.0 - node.detection_ahead),
        min(tally.least_left, node.left),
        tally.shared + node.elsewhere,
    )


@lean_piece
def _with_head(tally, outlook, leader, r):
    """The head's own report, and the handover to it."""
    head, old = outlook.nodes[leader], outlook.nodes[outlook.candidates]
    joules = r.awake_j - r.asleep_j
    if not r.to_head:
        joules += _report_j(head, outlook, leader, r)
    elif old.node >= 0 and head.node != old.node:
        squared = squared_between(old, head)
        hops = max(np.ceil(np.sqrt(squared) / r.hop_m), 1.0)
        joules += hops * (transmission(r, r.handover_bits, squared) + reception(r, r.handover_bits))
    return _counted(tally, head, r.head_delivery, joules)


@lean_piece
def _with_member(tally, outlook, place, leader, called, r):
    """A member's report, its invitation if it is called, its being awake."""
    node = outlook.nodes[place]
    joules = r.awake_j - r.asleep_j + _report_j(node, outlook, leader, r)
    if called:
        joules += reception(r, r.invitation_bits)
        if r.to_head:
            joules += transmission(r, r.invitation_bits, squared_between(node, outlook.nodes[leader]))
    return _counted(tally, node, r.delivery, joules)


@lean_piece
def _report_j(node, outlook, leader, r):
    """Expected energy of a report with its retries [J]."""
    hearing = reception(r, r.report_bits) if r.to_head else 0.0
    tries = r.delivery / r.packet_success if r.packet_success > 0.0 else float(r.tries)
    sending = transmission(r, r.report_bits, report_way(node, outlook, leader, r))
    return node.packets * node.detection * tries * (sending + hearing)


@lean_piece
def _write_head(outlook, leader, heading, radius_m, f):
    head, mean = outlook.nodes[leader], outlook.mean
    dx, dy = (head.x - mean[0]) / radius_m, (head.y - mean[2]) / radius_m
    f[12] = dx * heading.x + dy * heading.y
    f[13] = dy * heading.x - dx * heading.y
    f[14] = np.sqrt(dx * dx + dy * dy)
    f[15] = head.detection


@lean_piece
def _write(n, invited, tally, outlook, units, f):
    before = max(outlook.cov[0, 0] + outlook.cov[2, 2], 1e-12)
    left = max(tally.p.xx + tally.p.yy, 1e-12)
    f[2] = 0.25 * n
    f[3] = 0.25 * invited
    f[4] = 0.5 * log(left)
    f[5] = 0.5 * log(left / before)
    f[6] = expected_error(tally.p.xx, tally.p.xy, tally.p.yy) / units.cost_m
    f[7] = outlook.lam * tally.energy_mj / units.cost_m
    f[8] = np.sqrt(tally.energy_mj / units.energy_mj)
    f[9] = 0.25 * tally.detections
    f[10] = tally.silence
    f[11] = 1.0 - tally.missed_ahead


@lean_piece
def _write_more(left, tally, c, f):
    """What is told behind ENTRY_FEATURES; `left` is the head's share of its battery."""
    place = WIDTH
    if c.scarce_energy:
        f[place] = left
        f[place + 1] = tally.least_left
        place += ENERGIES
    if c.tells_others:
        f[place] = 0.25 * tally.shared
