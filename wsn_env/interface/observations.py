"""Observations: a View as arrays, finite and clipped. lam is part of every one."""

from __future__ import annotations

import numpy as np
from gymnasium import spaces

from wsn_env.compiling import lean_kernel, lean_piece, over_rows, threads_for
from wsn_env.interface.merit import gain, mean_detection
from wsn_env.numerics import log
from wsn_env.physics.constants import constants
from wsn_env.physics.field import find_candidates, squared_distance
from wsn_env.physics.sensing import detection_piece
from wsn_env.quantity import suggest
from wsn_env.scenario import Scenario
from wsn_env.types import network_of
from wsn_env.view import View

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
    "joint_detection",  # of the standing cluster at the prediction
    "sparseness",  # distance of the farthest candidate
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
)
BOUND = 10.0


@lean_kernel
def _encode(start, stop, cs, battery_j, which, nodes, distances, out, rows, beliefs, count, *network_arrays):
    """Fill out (B, n): BELIEF_FEATURES, then CANDIDATE_FEATURES of each candidate; and the candidates (B, K). Only in
    the rows marked in `which`."""
    c, network = cs[0], network_of(network_arrays)
    size, width = len(BELIEF_FEATURES), len(CANDIDATE_FEATURES)
    for b in range(start, stop):
        if not which[b]:
            continue
        m, p, head = beliefs[b].predicted_mean, beliefs[b].predicted_cov, network.row[b].head
        find_candidates(network, b, m[0], m[2], c.ring_m, nodes[b], distances[b])
        positions, members, n = network.positions[b], network.members[b], network.row[b].n_members
        f = out[b]
        f[:] = 0.0
        f[0] = 0.5 * log(max(rows[b].lam, 1e-3))
        ex, ey = _encode_ellipse(m, p, c, f)
        f[9] = 0.2 * rows[b].log_miss
        f[10] = 0.25 * count[b]
        if head >= 0:
            _encode_head(head, head == nodes[b, 0], members, n, positions, m, p, ex, ey, c, f)
        f[18] = distances[b, -1] / c.radius_m
        for k in range(nodes.shape[1]):
            node, g = nodes[b, k], f[size + k * width : size + (k + 1) * width]
            if node < 0:
                g[2] = BOUND
                continue
            g[2] = distances[b, k] / c.radius_m
            g[7] = network.battery[b, node] / battery_j
            _encode_candidate(node, head, members, n, positions, m, p, ex, ey, c, g)
        for i in range(len(f)):
            f[i] = min(max(f[i], np.float32(-BOUND)), np.float32(BOUND))


@lean_piece
def _encode_ellipse(m, p, c, f):
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
    f[3] = np.sqrt(major) / c.radius_m
    f[4] = np.sqrt(minor) / c.radius_m
    f[5] = cos2 * c2 + sin2 * s2
    f[6] = sin2 * c2 - cos2 * s2
    f[7] = speed
    f[8] = 0.5 * log(max(p[1, 1] + p[3, 3], 1e-6))
    return ex, ey


@lean_piece
def _encode_head(head, is_nearest, members, n, positions, m, p, ex, ey, c, f):
    """f[11:18]: the head, and what the standing cluster would detect at the prediction."""
    dx, dy = (positions[head, 0] - m[0]) / c.radius_m, (positions[head, 1] - m[2]) / c.radius_m
    f[11] = dx * ex + dy * ey
    f[12] = dy * ex - dx * ey
    f[13] = np.sqrt(dx * dx + dy * dy)
    f[14] = mean_detection(positions, head, m, p, c)
    f[15] = 1.0 if is_nearest else 0.0
    f[16] = 0.25 * n
    missed = 1.0 - detection_piece(np.sqrt(squared_distance(positions, head, m[0], m[2])), c)
    for k in range(n):
        missed *= 1.0 - detection_piece(np.sqrt(squared_distance(positions, members[k], m[0], m[2])), c)
    f[17] = 1.0 - missed


@lean_piece
def _encode_candidate(node, head, members, n, positions, m, p, ex, ey, c, g):
    """g[0:2], g[3:7], g[8]: a candidate's place, chances, role and gain."""
    dx, dy = (positions[node, 0] - m[0]) / c.radius_m, (positions[node, 1] - m[2]) / c.radius_m
    g[0] = dx * ex + dy * ey
    g[1] = dy * ex - dx * ey
    detection = mean_detection(positions, node, m, p, c)
    g[3] = detection
    if head >= 0:
        g[4] = np.sqrt(squared_distance(positions, node, positions[head, 0], positions[head, 1])) / c.radius_m
    for k in range(n):
        if members[k] == node:
            g[5] = 1.0
    if node == head:
        g[5] = 1.0
        g[6] = 1.0
    drop = gain(detection, positions, node, m, p, p[0, 0], p[0, 2], p[2, 2], c)[0]
    g[8] = 0.25 * log(max(drop / (p[0, 0] + p[2, 2] + 1e-12), 1e-6))


class CandidatesObservation:
    """Flat Box float32: BELIEF_FEATURES, then CANDIDATE_FEATURES of the K living nodes nearest to the prediction."""

    def __init__(self, scenario: Scenario, candidates: int, threads: int = 1):
        self.size = len(BELIEF_FEATURES)
        self.shape = (candidates, len(CANDIDATE_FEATURES))
        self.space = spaces.Box(-BOUND, BOUND, (self.size + candidates * self.shape[1],), np.float32)
        self._threads = threads
        self._constants = constants(scenario)
        self._battery_j = scenario.radio.battery_j
        self._ring_m = scenario.ring_m

    def encode(self, view: View) -> np.ndarray:
        """(B, n) float32, fresh."""
        rows, candidates = len(view.row), self.shape[0]
        view.remember_nearest(np.empty((rows, candidates), np.int64), np.empty((rows, candidates)), self._ring_m)
        return self._fill(np.empty((rows, *self.space.shape), np.float32), view, np.ones(rows, bool))

    def renew(self, view: View, rows, before: View, last) -> np.ndarray:
        """What `encode` gives, for less where few rows have changed.

        Args:
            rows: (B,) bool, which have changed since `last` was encoded from the view `before`.
        """
        view.remember_nearest(*(array.copy() for array in before.nearest(self.shape[0], self._ring_m)), self._ring_m)
        return self._fill(last.copy(), view, rows)

    def _fill(self, out, view: View, rows):
        filled, seen = (*view.nearest(self.shape[0], self._ring_m), out), (view.row, view.belief, view.reports.count)
        numbers = self._constants, self._battery_j
        threads = threads_for(rows, self._threads)
        over_rows(_encode, len(rows), threads, *numbers, rows, *filled, *seen, *view.network.arrays())
        return out


class DictObservation:
    """The same features under names: belief (19,), candidates (K, 9), and lam (1,) [m/mJ]."""

    def __init__(self, scenario: Scenario, candidates: int, threads: int = 1):
        self._flat = CandidatesObservation(scenario, candidates, threads)
        high = max(scenario.lam_range[1], 1.0)
        self.space = spaces.Dict(
            {
                "belief": spaces.Box(-BOUND, BOUND, (self._flat.size,), np.float32),
                "candidates": spaces.Box(-BOUND, BOUND, self._flat.shape, np.float32),
                "lam": spaces.Box(0.0, high, (1,), np.float32),
            }
        )

    def encode(self, view: View) -> dict[str, np.ndarray]:
        """A dict of (B, ...) float32, fresh."""
        flat = self._flat.encode(view)
        return {
            "belief": flat[:, : self._flat.size].copy(),
            "candidates": flat[:, self._flat.size :].reshape(len(flat), *self._flat.shape).copy(),
            "lam": np.minimum(view.lam[:, None].astype(np.float32), self.space["lam"].high[0]),
        }

    def renew(self, view: View, rows, before: View, last) -> dict[str, np.ndarray]:
        """All of it."""
        return self.encode(view)


class ViewObservation:
    """Everything a network could know, as float64: enough for every hand-written policy (`View.from_arrays`)."""

    def __init__(self, scenario: Scenario, candidates: int, threads: int = 1):
        nodes, side, far = scenario.field.nodes, scenario.field.side_m, 1e9

        def box(low, high, *shape):
            return spaces.Box(low, high, shape, np.float64)

        self.space = spaces.Dict(
            {
                "period": spaces.Discrete(scenario.periods + 1),
                "lam": box(0.0, max(scenario.lam_range[1], 1.0), 1),
                "luck": spaces.Box(0, 2**32 - 1, (1,), np.int64),
                "log_miss": box(-far, 0.0, 1),
                "mean": box(-far, far, 4),
                "cov": box(-far, far, 4, 4),
                "predicted_mean": box(-far, far, 4),
                "predicted_cov": box(-far, far, 4, 4),
                "positions": box(0.0, side, nodes, 2),
                "battery": box(0.0, scenario.radio.battery_j, nodes),
                "head": spaces.Discrete(nodes + 1, start=-1),
                "member": spaces.Box(0, 1, (nodes,), np.int8),
                "detected": spaces.Box(0, 1, (nodes,), np.int8),
                "measured": box(-far, far, nodes, 2),
            }
            | ({"bitmap": spaces.Box(0, 1, (nodes,), np.int8)} if scenario.binary else {})
        )

    def encode(self, view: View) -> dict[str, np.ndarray]:
        """A dict of (B, ...) arrays, fresh."""
        return view.as_arrays()

    def renew(self, view: View, rows, before: View, last) -> dict[str, np.ndarray]:
        """All of it."""
        return self.encode(view)


OBSERVATIONS = {"candidates": CandidatesObservation, "dict": DictObservation, "view": ViewObservation}


def make_observation(name: str, scenario: Scenario, candidates: int, threads: int = 1):
    """An observation by name.

    Raises:
        ValueError: for an unknown name.
    """
    if name not in OBSERVATIONS:
        raise ValueError(f"observation {name!r} is unknown: {suggest(name, OBSERVATIONS)}")
    return OBSERVATIONS[name](scenario, candidates, threads)
