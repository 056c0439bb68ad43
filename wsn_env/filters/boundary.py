"""Trackers for binary sensors (Zhou, Cheng & Xing, 2009): the nodes at the edge of detection tell where the target is.

A node whose state changed in a period (a boundary node) stands R from where the target was when it entered or left, so
that the boundary nodes lie on a circle about the middle of the target's way. How they are used goes by name:

    boundary_raw   the least-squares centre of that circle (eqs. 3-8), moved on by half a period of the velocity that
                   the belief started from; no memory
    boundary       the paper: recursive least squares (eqs. 9-13) over such fixes, moved on by its own velocity
    boundary_mid   the same filter, told that an unmoved fix is the position half a period ago: H = [I, -(T/2) I];
                   ill-conditioned fixes are refused
    boundary_ekf   no fix: each boundary node is a range of R to the middle of the way
    centroid       the mean of all awake nodes that detect; no memory
    centroid_rls   recursive least squares over it

Fewer than four boundary nodes make no circle: then the centroid stands in (but for boundary_mid). Without any, a filter
only predicts. With a gate, boundary nodes and fixes too far from what is expected are refused; the centroid stands in
for the fix that is missing then, and so leads a filter back that has gone astray.

Differs from the paper: eqs. 12 and 13 as printed leave out F P F', and then the velocity is never learnt; eq. 11 has
x(k+1) for x(k); the last row of eq. 6 lacks its minus signs.
"""

from typing import Any

import numpy as np

from wsn_env.compiled.kernels import kernel, lean_piece, over_rows
from wsn_env.filters.base import MomentTracker
from wsn_env.filters.least_squares import SINGULAR, circle_centre, scalar_update
from wsn_env.models.field import squared_distance
from wsn_env.models.state import Belief, Network, Reports, network_at, reports_at
from wsn_env.scenario import Scenario
from wsn_env.scenario.constants import constants
from wsn_env.scenario.tracking import BOUNDARY_TRACKERS

RAW, FED_BACK, MIDPOINT, RANGES, CENTROID, CENTROID_RLS = range(len(BOUNDARY_TRACKERS))
FEWEST = 4  # boundary nodes that make a fix
WELL_CONDITIONED = 5.0  # what boundary_mid takes
FIX_VARIANCE = 1.0  # m^2: recursive least squares weighs every fix alike
UNKNOWN = 1e4  # m^2 and m^2/s^2: P0 of recursive least squares
RANGES_P0 = (100.0, 200.0, 100.0, 200.0)  # m^2, m^2/s^2
PASSES = 2  # linearisations of the ranges
GATE_SDS = 3.0


class BoundaryTracker(MomentTracker):
    """The trackers of this module, by the scenario's `tracker`. Their memory is the belief's mean and covariance.

    After a search recursive least squares knows nothing, P0 = 1e4 I; where an episode's start is not known it takes the
    fix of period 1 for the position, at rest. boundary_ekf goes on from the centroid, P0 = diag(100, 200, 100, 200).

    They suppose that nodes are awake in every period: one that has slept reports a state that it finds changed, though
    the target may have crossed its edge long ago. Where nodes sleep, the particle filter is the better tracker.
    """

    def __init__(self, scenario: Scenario, threads: int = 1, fast: bool = False) -> None:
        self._threads = threads
        self._constants = constants(scenario)
        self._variant = BOUNDARY_TRACKERS.index(scenario.tracking.tracker)
        self._at_rest = scenario.tracking.start != "known"

    def relocate(self, keys: np.ndarray, periods: np.ndarray, rows: np.ndarray, belief: Belief) -> None:
        """Where a search has set the position of the marked rows: P0, in place."""
        if self._variant not in (RAW, CENTROID):
            p0 = RANGES_P0 if self._variant == RANGES else (UNKNOWN,) * 4
            belief.cov[rows] = np.diag(p0)

    def correct(
        self,
        keys: np.ndarray,
        periods: np.ndarray,
        belief: Belief,
        network: Network,
        reports: Reports,
        resampled: np.ndarray,
    ) -> None:
        """Correct the prediction with the boundary nodes of the period, in place."""
        how = self._constants, self._variant, self._at_rest
        arrays = belief.row, reports.handle, network.handle
        over_rows(correct_rows, len(keys), self._threads, *how, periods, *arrays)


@kernel
def correct_rows(
    start: int,
    stop: int,
    cs: Any,
    variant: int,
    at_rest: bool,
    periods: np.ndarray,
    beliefs: np.ndarray,
    reports_handle: np.ndarray,
    network_handle: np.ndarray,
) -> None:
    """One period of every row."""
    reports, network = reports_at(reports_handle), network_at(network_handle)
    nodes = np.empty(network.battery.shape[1], np.int32)
    for b in range(start, stop):
        belief = beliefs[b]
        take_prediction(belief)
        gate = expect_circle(belief, network, reports.bitmap[b], b, cs[0])
        n, told = list_boundary(gate, network.positions[b], reports, nodes, b, cs[0])
        if variant == RANGES:
            update_by_ranges(belief, network.positions[b], nodes[:n], cs[0])
        else:
            restarts = at_rest and periods[b] == 1
            bitmap = reports.bitmap[b]
            update_by_position(belief, network, bitmap, nodes[:n], told, gate, restarts, variant, b, cs[0])


@lean_piece
def take_prediction(belief: Any) -> None:
    """The belief is what was predicted for this period."""
    for i in range(4):
        belief.mean[i] = belief.predicted_mean[i]
        for j in range(i, 4):  # exactly symmetric
            belief.cov[i, j] = belief.predicted_cov[i, j]
            belief.cov[j, i] = belief.predicted_cov[i, j]


@lean_piece
def middle(mean: np.ndarray, c: Any) -> tuple[Any, ...]:
    """(x, y) half a period ago [m]."""
    return mean[0] - 0.5 * c.period_s * mean[1], mean[2] - 0.5 * c.period_s * mean[3]


@lean_piece
def expect_circle(belief: Any, network: Any, bitmap: np.ndarray, b: int, c: Any) -> tuple[Any, ...]:
    """The gate: x, y where the circle's centre is expected and how far off it may be [m], for gate_m and three sds.

    By the prediction or by the centroid, whichever is sharper: before a filter has learnt a velocity, the centroid.
    """
    if c.tracking.gate_m == np.inf:
        return 0.0, 0.0, np.inf
    x, y = middle(belief.predicted_mean, c)
    variance = max(belief.predicted_cov[0, 0], belief.predicted_cov[2, 2])
    cx, cy, spread = centroid(network, bitmap, b, c)
    if 0.0 < spread[0] < variance:
        x, y, variance = cx, cy, spread[0]
    return x, y, c.tracking.gate_m + GATE_SDS * np.sqrt(variance)


@lean_piece
def list_boundary(gate: Any, positions: np.ndarray, reports: Any, nodes: np.ndarray, b: int, c: Any) -> tuple[Any, ...]:
    """The boundary nodes that stand close enough to the circle expected, in `nodes`; their number, and how many there
    were in all."""
    n, told = 0, 0
    for k in range(reports.count[b]):
        node, changed = reports.node[b, k], reports.value[b, k, 1]
        if changed != 0.0:
            told += 1
            if abs(np.sqrt(squared_distance(positions, node, gate[0], gate[1])) - c.radius_m) <= gate[2]:
                nodes[n] = node
                n += 1
    return n, told


@lean_piece
def update_by_position(
    belief: Any,
    network: Any,
    bitmap: np.ndarray,
    nodes: np.ndarray,
    told: Any,
    gate: Any,
    restarts: Any,
    variant: int,
    b: int,
    c: Any,
) -> None:
    """Correct with a fix or a centroid, if there is one."""
    mean, cov = belief.mean, belief.cov
    x, y, spread, age = locate(belief, network, bitmap, nodes, told, gate, variant, b, c)
    if spread[0] == 0.0:
        return
    if variant == RAW or variant == CENTROID:
        _stand_at(x, y, spread, mean, cov)
    elif restarts and variant != MIDPOINT:
        for i in range(4):
            cov[i] = 0.0
            cov[i, i] = UNKNOWN
        mean[0], mean[1], mean[2], mean[3] = x, 0.0, y, 0.0
    else:
        scalar_update(mean, cov, (1.0, -age, 0.0, 0.0), x - mean[0] + age * mean[1], FIX_VARIANCE)
        scalar_update(mean, cov, (0.0, 0.0, 1.0, -age), y - mean[2] + age * mean[3], FIX_VARIANCE)


@lean_piece
def locate(
    belief: Any, network: Any, bitmap: np.ndarray, nodes: np.ndarray, told: Any, gate: Any, variant: int, b: int, c: Any
) -> tuple[Any, ...]:
    """Where the target is by this period's reports alone.

    The covariance of a fix is that of nodes that are off the circle by the radial part of an instant uniform in the
    period: on average over those met, of variance (|v| T)^2 / 18, and 1 m^2.

    Returns: x, y [m], the covariance xx, xy, yy, zeros where it is not told, and how long ago that was [s].
    """
    mean, half = belief.mean, 0.5 * c.period_s
    if variant < CENTROID:
        refused = told > len(nodes)
        if len(nodes) >= FEWEST:
            x, y, condition, inverse = circle_centre(network.positions[b], nodes)
            if condition <= (WELL_CONDITIONED if variant == MIDPOINT else SINGULAR):
                if np.sqrt((x - gate[0]) ** 2 + (y - gate[1]) ** 2) <= gate[2]:
                    way = (mean[1] ** 2 + mean[3] ** 2) * c.period_s**2
                    scale = c.radius_m**2 * (1.0 + way / 18.0)
                    spread = scale * inverse[0], scale * inverse[1], scale * inverse[2]
                    if variant == MIDPOINT:
                        return x, y, spread, half
                    # The same sign for nodes that were entered and left.
                    return x + half * mean[1], y + half * mean[3], spread, 0.0
                refused = True
        if told == 0 or (variant == MIDPOINT and not refused):
            return 0.0, 0.0, (0.0, 0.0, 0.0), 0.0
    x, y, spread = centroid(network, bitmap, b, c)
    return x, y, spread, 0.0


@lean_piece
def centroid(network: Any, bitmap: np.ndarray, b: int, c: Any) -> tuple[Any, ...]:
    """Mean of the awake nodes that detect, each uniform in a disc: variance R^2 / (4 n) on an axis."""
    positions, standing, members = network.positions[b], network.row[b], network.members[b]
    x, y, n = 0.0, 0.0, 0
    for k in range(-1 if standing.head >= 0 else 0, standing.n_members):
        node = standing.head if k < 0 else members[k]
        if bitmap[node] != 0 and network.battery[b, node] > 0.0:
            x += positions[node, 0]
            y += positions[node, 1]
            n += 1
    if n == 0:
        return 0.0, 0.0, (0.0, 0.0, 0.0)
    variance = c.radius_m**2 / (4.0 * n)
    return x / n, y / n, (variance, 0.0, variance)


@lean_piece
def _stand_at(x, y, spread, mean, cov):
    """A position without memory; what is believed of the velocity stays."""
    mean[0], mean[2] = x, y
    for axis in (0, 2):
        for j in range(4):
            cov[axis, j] = 0.0
            cov[j, axis] = 0.0
    cov[0, 0], cov[0, 2], cov[2, 0], cov[2, 2] = spread[0], spread[1], spread[1], spread[2]


@lean_piece
def update_by_ranges(belief: Any, positions: np.ndarray, nodes: np.ndarray, c: Any) -> None:
    """Extended Kalman update with 0 = |x - v T / 2 - p_i| - R for each boundary node i, linearised twice.

    The instant of the crossing is uniform in the period, so that the range errs by (v.u T)^2 / 12, u its direction;
    1 m^2 and the velocity's own uncertainty come on top.
    """
    mean, cov, prior = belief.mean, belief.cov, belief.predicted_cov
    half = 0.5 * c.period_s
    floor = 1.0 + (prior[1, 1] + prior[3, 3]) * c.period_s**2 / 24.0
    for _ in range(PASSES):
        about = mean[0], mean[1], mean[2], mean[3]  # where it is linearised
        x, y = middle(mean, c)
        take_prediction(belief)  # every pass starts from the prediction: a report counts once
        for node in nodes:
            dx, dy = x - positions[node, 0], y - positions[node, 1]
            distance = np.sqrt(dx * dx + dy * dy)
            ux, uy = dx / max(distance, 1e-9), dy / max(distance, 1e-9)
            h = ux, -half * ux, uy, -half * uy
            moved = 0.0
            for i in range(4):
                moved += h[i] * (mean[i] - about[i])
            radial = (ux * about[1] + uy * about[3]) * c.period_s
            scalar_update(mean, cov, h, c.radius_m - distance - moved, radial * radial / 12.0 + floor)
