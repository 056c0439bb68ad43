"""What learners see of a belief and of a candidate, as numbers of about unit size."""

from typing import Any

import numpy as np

from wsn_env.compiled.elementary import log
from wsn_env.compiled.kernels import lean_piece
from wsn_env.envs.merit import chance_of, gain, place_of
from wsn_env.models.field import squared_distance
from wsn_env.models.state import Sensors, sensors_of

BELIEF_FEATURES = (
    "lam",  # log, halved
    "major_sd",  # log of the position ellipse's axes
    "minor_sd",
    "major_radii",  # the same in sensing radii
    "minor_radii",
    "axis_cos",  # twice the angle between the major axis and the velocity
    "axis_sin",
    "speed",  # m/s
    "velocity_sd",  # log
    "silence",  # log probability of the silence since the last report
    "heard",  # reports in the last period
    "head_ahead",  # where the head stands, in radii along and across the velocity
    "head_left",
    "head_distance",
    "head_detection",
    "head_nearest",  # 1: no living node is nearer
    "members",
    "joint_detection",  # of the standing cluster
    "sparseness",  # distance of the ninth nearest candidate
)
CANDIDATE_FEATURES = (
    "ahead",  # in radii along and across the velocity, from the prediction
    "left",
    "distance",
    "detection",
    "head_distance",
    "member",
    "head",
    "battery",  # share left
    "gain",  # log of the trace's expected drop by this node alone
    "merit",  # 1 for the first in the greedy order of information after the head, 1/2, 1/3, ...; 0 for the head
    "merit_drop",  # drop of the expected sd that it brings there, as a share of the prediction's
)
BOUND = 10.0
NINTH = 9


@lean_piece
def describe_belief(
    known: Any, b: int, nodes: np.ndarray, distances: np.ndarray, c: Any, f: np.ndarray
) -> tuple[float, float]:
    """Fill f with BELIEF_FEATURES of row b. Returns the direction of the predicted velocity.

    Args:
        known: what the network knows (Knowledge).
        nodes, distances: (K,) the nearest candidates.
    """
    network, row = known.network, known.row[b]
    m, p, standing = known.belief[b].predicted_mean, known.belief[b].predicted_cov, network.row[b]
    f[:] = 0.0
    f[0] = 0.5 * log(max(row.lam, 1e-3))
    ex, ey = _describe_ellipse(m, p, c.radius_m, f)
    f[9] = 0.2 * row.log_miss
    f[10] = 0.25 * known.reports.count[b]
    if standing.head >= 0:
        is_nearest, n = standing.head == nodes[0], standing.n_members
        sensors = sensors_of(known, b)
        _describe_head(standing.head, is_nearest, network.members[b], n, sensors, m, p, ex, ey, c, f)
    f[18] = distances[min(NINTH, len(distances)) - 1] / c.radius_m
    return ex, ey


@lean_piece
def _describe_ellipse(m, p, radius_m, f):
    """f[1:9]: the position's ellipse and the velocity. Returns the direction of the velocity."""
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
    return ex, ey


@lean_piece
def _describe_head(head, is_nearest, members, n, sensors, m, p, ex, ey, c, f):
    """f[11:18]: the head, and what the standing cluster would detect at the prediction."""
    dx, dy = (sensors.positions[head, 0] - m[0]) / c.radius_m, (sensors.positions[head, 1] - m[2]) / c.radius_m
    f[11] = dx * ex + dy * ey
    f[12] = dy * ex - dx * ey
    f[13] = np.sqrt(dx * dx + dy * dy)
    f[14] = chance_of(sensors, head, m, p, c)
    f[15] = 1.0 if is_nearest else 0.0
    f[16] = 0.25 * n
    missed = 1.0 - f[14]
    for k in range(n):
        missed *= 1.0 - chance_of(sensors, members[k], m, p, c)
    f[17] = 1.0 - missed


@lean_piece
def describe_candidate(
    node: int,
    detection: float,
    head: int,
    members: np.ndarray,
    n: int,
    sensors: Sensors,
    m: Any,
    p: Any,
    ex: float,
    ey: float,
    c: Any,
    g: np.ndarray,
) -> None:
    """g[0:2], g[3:7], g[8]: a candidate's place, its chance `detection`, role and gain."""
    dx, dy = (sensors.positions[node, 0] - m[0]) / c.radius_m, (sensors.positions[node, 1] - m[2]) / c.radius_m
    g[0] = dx * ex + dy * ey
    g[1] = dy * ex - dx * ey
    g[3] = detection
    if head >= 0:
        x, y = sensors.positions[head, 0], sensors.positions[head, 1]
        g[4] = np.sqrt(squared_distance(sensors.positions, node, x, y)) / c.radius_m
    for k in range(n):
        if members[k] == node:
            g[5] = 1.0
    if node == head:
        g[5] = 1.0
        g[6] = 1.0
    drop = gain(detection, sensors, node, m, p, p[0, 0], p[0, 2], p[2, 2], c)[0]
    g[8] = 0.25 * log(max(drop / (p[0, 0] + p[2, 2] + 1e-12), 1e-6))


@lean_piece
def describe_merit(
    nodes: np.ndarray, ordered: np.ndarray, drops: np.ndarray, spread: Any, width: int, f: np.ndarray
) -> None:
    """The last two of CANDIDATE_FEATURES, for all candidates.

    Args:
        nodes: (K,) in the order of the rows of f.
        ordered, drops: of `order_row`.
        spread: root of the predicted position covariance's trace [m].
        width: of a candidate's features.
        f: (K * width,).
    """
    for slot in range(len(ordered)):
        if ordered[slot] < 0:
            break
        k = place_of(ordered[slot], nodes)
        if k >= 0:
            f[k * width + width - 2] = 1.0 / (1.0 + slot)
            f[k * width + width - 1] = drops[slot] / spread


@lean_piece
def clip(f: np.ndarray) -> None:
    """To what the spaces promise."""
    for i in range(len(f)):
        f[i] = min(max(f[i], np.float32(-BOUND)), np.float32(BOUND))
