"""What learners see of a belief and of a candidate, as numbers of about unit size."""

from typing import Any, NamedTuple

import numpy as np

from wsn_env.compiled.elementary import log
from wsn_env.compiled.kernels import lean_piece
from wsn_env.envs.expectations import Outlook
from wsn_env.envs.feature import BOUND, Feature, amount, flag, share
from wsn_env.envs.merit import gain, position_cov, squared_between
from wsn_env.envs.others import OTHER_FEATURES, describe_others
from wsn_env.envs.scarcity import ENERGY_FEATURES, describe_energy
from wsn_env.models.association.base import expected_reports
from wsn_env.models.motion.modes import COUNT, MODES
from wsn_env.scenario import Scenario

BELIEF_FEATURES = {
    "lam": Feature("trade-off of the episode", "ln m/mJ, / 2"),
    "major_sd": Feature("sd of the predicted position along the longer axis of its ellipse", "ln m"),
    "minor_sd": Feature("the same along the shorter axis", "ln m"),
    "major_radii": amount("sd along the longer axis", "radius"),
    "minor_radii": amount("sd along the shorter axis", "radius"),
    "axis_cos": Feature("cosine of twice the angle between the longer axis and the velocity", "", -1.0, 1.0),
    "axis_sin": Feature("sine of the same", "", -1.0, 1.0),
    "speed": amount("predicted speed", "m/s"),
    "velocity_sd": Feature("root of the trace of the predicted velocity's covariance", "ln m/s"),
    "silence": Feature("probability of hearing nothing since the last report", "ln / 5", high=0.0),
    "heard": amount("reports that came in the last time step", "4 reports"),
    "head_ahead": Feature("where the head stands from the prediction, along the velocity", "radius"),
    "head_left": Feature("the same across it, to the left", "radius"),
    "head_distance": amount("distance of the head to the prediction", "radius"),
    "head_detection": share("probability that the head detects the target"),
    "head_nearest": flag("1: no living node is nearer to the prediction than the head"),
    "members": amount("members of the present cluster, without the head", "4 nodes"),
    "joint_detection": share("probability that at least one node of the present cluster detects the target"),
    "sparseness": amount("distance of the ninth nearest candidate to the prediction", "radius"),
}
MOTION_FEATURES = {  # behind them
    "surprise": Feature("how far reports have moved the estimate of late, squared, over what was expected", "ln / 2"),
    **{mode.name: share(f"probability of the filter's mode of motion: {mode.name}") for mode in MODES},
}
CANDIDATE_FEATURES = {
    "ahead": Feature("where the node stands from the prediction, along the velocity", "radius"),
    "left": Feature("the same across it, to the left", "radius"),
    "distance": amount("distance to the prediction; 10: no such node", "radius"),
    "detection": share("probability that the node detects the target"),
    "head_distance": amount("distance to the present head", "radius"),
    "member": flag("1: in the present cluster"),
    "head": flag("1: its head"),
    "battery": share("energy left, as a share of a full battery"),
    "gain": Feature("expected drop of the position variance by this node alone, as a share of it", "ln / 4", high=0.0),
    "merit": share("1 / place in the greedy order of information behind the head; 0: the head"),
    "merit_drop": share("drop of the expected sd that the node brings in that order, as a share of the predicted sd"),
}
WIDTH = len(CANDIDATE_FEATURES)
G, E, OTHERS = len(BELIEF_FEATURES), len(ENERGY_FEATURES), len(OTHER_FEATURES)
LEAST_SURPRISE = 0.01
NINTH = 9


def belief_features(scenario: Scenario) -> dict[str, Feature]:
    """What observations tell of an environment's belief and of how its target moves; of energy where that is scarce."""
    more = (ENERGY_FEATURES if scenario.scarce_energy else {}) | (OTHER_FEATURES if scenario.tells_others else {})
    return BELIEF_FEATURES | MOTION_FEATURES | more


class Heading(NamedTuple):
    """Direction of the predicted velocity."""

    x: float
    y: float


@lean_piece
def describe_belief(outlook: Outlook, row: Any, reports: float, radius_m: float, f: np.ndarray) -> Heading:
    """Fill f with BELIEF_FEATURES of a row.

    Args:
        outlook: to the depth REPORTS.
        row: STATE.
        reports: how many of the target came in the last period.
    """
    nodes, head = outlook.nodes, outlook.nodes[outlook.candidates]
    f[:] = 0.0
    f[0] = 0.5 * log(max(row.lam, 1e-3))
    heading = _describe_ellipse(outlook, radius_m, f)
    f[9] = 0.2 * row.log_miss
    f[10] = 0.25 * reports
    if head.node >= 0:
        _write_place(head, outlook, heading, radius_m, f[11:13])
        dx, dy = (head.x - outlook.mean[0]) / radius_m, (head.y - outlook.mean[2]) / radius_m
        f[13] = np.sqrt(dx * dx + dy * dy)
        f[14] = head.detection
        f[15] = 1.0 if head.node == nodes[0].node else 0.0
        f[16] = 0.25 * (len(nodes) - outlook.candidates - 1)
        missed = 1.0 - f[14]
        for k in range(outlook.candidates + 1, len(nodes)):
            missed *= 1.0 - nodes[k].detection
        f[17] = 1.0 - missed
    f[18] = nodes[min(NINTH, outlook.candidates) - 1].distance_m / radius_m
    return heading


@lean_piece
def describe_row(known: Any, b: int, outlook: Outlook, c: Any, f: np.ndarray) -> tuple[Heading, int]:
    """Fill the beginning of f with `belief_features` of row b.

    Args:
        known: what the network knows (Knowledge).
        outlook: of the row, to the depth REPORTS.
        c: the scenario's common constants.

    Returns: the direction of the predicted velocity, and how many features they are.
    """
    belief, heard, end = known.belief[b], expected_reports(known.reports, b), G + 1 + COUNT
    heading = describe_belief(outlook, known.row[b], heard, c.radius_m, f[:G])
    f[G] = 0.5 * log(max(belief.surprise, LEAST_SURPRISE))
    for k in range(COUNT):
        f[G + 1 + k] = belief.mode_probabilities[k]
    if c.scarce_energy:
        describe_energy(known, b, c, f[end : end + E])
        end += E
    if c.tells_others:
        describe_others(known, b, heading, c.radius_m, f[end : end + OTHERS])
        end += OTHERS
    return heading, end


@lean_piece
def _write_place(node, outlook, heading, radius_m, f):
    """f (2,): where a node stands from the prediction, in radii along and across the velocity."""
    dx, dy = (node.x - outlook.mean[0]) / radius_m, (node.y - outlook.mean[2]) / radius_m
    f[0] = dx * heading.x + dy * heading.y
    f[1] = dy * heading.x - dx * heading.y


@lean_piece
def _describe_ellipse(outlook, radius_m, f):
    """f[1:9]: the position's ellipse and the velocity."""
    m, p = outlook.mean, outlook.cov
    half, off = 0.5 * (p[0, 0] + p[2, 2]), 0.5 * (p[0, 0] - p[2, 2])
    root = np.sqrt(off * off + p[0, 2] * p[0, 2])
    major, minor = max(half + root, 1e-6), max(half - root, 1e-6)
    speed = np.sqrt(m[1] * m[1] + m[3] * m[3])
    ex, ey = (m[1] / speed, m[3] / speed) if speed > 1e-9 else (1.0, 0.0)
    cos2, sin2 = (off / root, p[0, 2] / root) if root > 1e-12 else (1.0, 0.0)
    c2, s2 = ex * ex - ey * ey, 2.0 * ex * ey
    f[1] = 0.5 * log(major)
    f[2] = 0.5 * log(minor)
    f[3] = np.sqrt(major) / radius_m
    f[4] = np.sqrt(minor) / radius_m
    f[5] = cos2 * c2 + sin2 * s2
    f[6] = sin2 * c2 - cos2 * s2
    f[7] = speed
    f[8] = 0.5 * log(max(p[1, 1] + p[3, 3], 1e-6))
    return Heading(ex, ey)


@lean_piece
def describe_candidate(outlook: Outlook, place: int, heading: Heading, radius_m: float, g: np.ndarray) -> None:
    """g[0:9]: a candidate's place, its chance of detection, role, battery and gain.

    Args:
        outlook: to the depth REPORTS.
        place: of the candidate among its nodes.
    """
    nodes, node = outlook.nodes, outlook.nodes[place]
    head, p = nodes[outlook.candidates], position_cov(outlook.cov)
    _write_place(node, outlook, heading, radius_m, g[:2])
    g[2] = node.distance_m / radius_m
    g[3] = node.detection
    if head.node >= 0:
        g[4] = np.sqrt(squared_between(node, head)) / radius_m
    for k in range(outlook.candidates, len(nodes)):
        if nodes[k].node == node.node:
            g[5] = 1.0
    if node.node == head.node:
        g[6] = 1.0
    g[7] = node.left
    g[8] = 0.25 * log(max(gain(node, 1.0, p)[0] / (p.xx + p.yy + 1e-12), 1e-6))


@lean_piece
def describe_merit(outlook: Outlook, ranking: np.ndarray, f: np.ndarray) -> None:
    """The last two of CANDIDATE_FEATURES, for all candidates.

    Args:
        ranking: (K,) RANKED by `order_row`.
        f: (K * WIDTH,).
    """
    sd = np.sqrt(outlook.cov[0, 0] + outlook.cov[2, 2] + 1e-12)
    for slot in range(len(ranking)):
        k = ranking[slot].place
        if k >= 0:
            f[k * WIDTH + WIDTH - 2] = 1.0 / (1.0 + slot)
            f[k * WIDTH + WIDTH - 1] = ranking[slot].drop_m / sd


@lean_piece
def clip(f: np.ndarray) -> None:
    """To what the spaces promise."""
    for i in range(len(f)):
        f[i] = min(max(f[i], np.float32(-BOUND)), np.float32(BOUND))
