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

from typing import Any, NamedTuple

import numpy as np

from wsn_env.compiled.kernels import kernel, lean_piece, over_rows
from wsn_env.filters.base import MomentTracker
from wsn_env.filters.least_squares import SINGULAR, circle_centre, scalar_update
from wsn_env.models.detection.base import known_radius
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


class Nodes(NamedTuple):
    """A row's nodes and what they last said."""

    positions: np.ndarray  # (S, 2) m
    battery: np.ndarray  # (S,) J
    standing: Any  # NETWORK: head and number of members
    members: np.ndarray  # (S,) the first of them
    bitmap: np.ndarray  # (S,) states as last reported


class Circle(NamedTuple):
    """The gate: where the boundary nodes' circle is expected."""

    x: float  # m, its centre
    y: float
    tolerance_m: float  # that centre and radius may be off; inf: there is no gate


class Boundary(NamedTuple):
    """A period's boundary nodes."""

    nodes: np.ndarray  # (n,) that stand close enough to the circle
    radii_m: np.ndarray  # (n,) within which they sense
    reported: int  # how many there were in all


class Fix(NamedTuple):
    """Where the target is by a period's reports alone."""

    x: float  # m
    y: float
    spread: tuple[float, float, float]  # m^2, the covariance xx, xy, yy; zeros where it is not told
    age_s: float  # how long ago that was


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
        how, handles = (self._variant, self._at_rest), (network.handle, reports.handle)
        over_rows(correct_rows, len(keys), self._threads, self._constants, how, periods, belief.row, handles)


@kernel
def correct_rows(
    start: int, stop: int, cs: Any, how: Any, periods: np.ndarray, beliefs: np.ndarray, handles: Any
) -> None:
    """One period of every row.

    Args:
        how: the variant; whether the target is at rest when an episode starts, somewhere.
        handles: of network and reports.
    """
    network, reports, (variant, at_rest) = network_at(handles[0]), reports_at(handles[1]), how
    room = np.empty(network.battery.shape[1], np.int32), np.empty(network.battery.shape[1])
    for b in range(start, stop):
        correct_row(beliefs[b], network, reports, b, (variant, at_rest and periods[b] == 1), room, cs[0])


@lean_piece
def correct_row(belief: Any, network: Any, reports: Any, b: int, how: Any, room: Any, c: Any) -> None:
    """One period of row b.

    Args:
        how: the variant; whether the filter starts here.
        room: (S,) int32 and (S,) for boundary nodes and their radii.
    """
    variant, starts = how
    nodes = Nodes(network.positions[b], network.battery[b], network.row[b], network.members[b], reports.bitmap[b])
    take_prediction(belief)
    circle = expect_circle(belief, nodes, c)
    boundary = list_boundary(circle, nodes, reports, b, room, c)
    if variant == RANGES:
        update_by_ranges(belief, nodes.positions, boundary, c)
        return
    fix = locate(belief.mean, nodes, boundary, circle, variant, c)
    if fix.spread[0] != 0.0:
        update_by_fix(belief, fix, variant, starts)


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
def expect_circle(belief: Any, nodes: Nodes, c: Any) -> Circle:
    """Where the circle is expected, within gate_m and three sds.

    By the prediction or by the centroid, whichever is sharper: before a filter has learnt a velocity, the centroid.
    """
    if c.tracking.gate_m == np.inf:
        return Circle(0.0, 0.0, np.inf)
    x, y = middle(belief.predicted_mean, c)
    variance = max(belief.predicted_cov[0, 0], belief.predicted_cov[2, 2])
    mean = centroid(nodes, c)
    if 0.0 < mean.spread[0] < variance:
        x, y, variance = mean.x, mean.y, mean.spread[0]
    return Circle(x, y, c.tracking.gate_m + GATE_SDS * np.sqrt(variance))


@lean_piece
def list_boundary(circle: Circle, nodes: Nodes, reports: Any, b: int, room: Any, c: Any) -> Boundary:
    """The boundary nodes of row b, in `room`."""
    n, reported = 0, 0
    for k in range(reports.count[b]):
        node, changed = reports.node[b, k], reports.value[b, k, 1]
        if changed != 0.0:
            reported += 1
            distance = np.sqrt(squared_distance(nodes.positions, node, circle.x, circle.y))
            radius_m = known_radius(c.detection, node)
            if abs(distance - radius_m) <= circle.tolerance_m:
                room[0][n], room[1][n] = node, radius_m
                n += 1
    return Boundary(room[0][:n], room[1][:n], reported)


@lean_piece
def update_by_fix(belief: Any, fix: Fix, variant: int, starts: Any) -> None:
    """Correct with where the target is by the reports."""
    mean, cov = belief.mean, belief.cov
    x, y, spread, age = fix
    if variant == RAW or variant == CENTROID:
        _stand_at(x, y, spread, mean, cov)
    elif starts and variant != MIDPOINT:
        for i in range(4):
            cov[i] = 0.0
            cov[i, i] = UNKNOWN
        mean[0], mean[1], mean[2], mean[3] = x, 0.0, y, 0.0
    else:
        scalar_update(mean, cov, (1.0, -age, 0.0, 0.0), x - mean[0] + age * mean[1], FIX_VARIANCE)
        scalar_update(mean, cov, (0.0, 0.0, 1.0, -age), y - mean[2] + age * mean[3], FIX_VARIANCE)


@lean_piece
def locate(mean: np.ndarray, nodes: Nodes, boundary: Boundary, circle: Circle, variant: int, c: Any) -> Fix:
    """The fix of the boundary nodes, or the centroid that stands in for it.

    The covariance of a fix is that of nodes that are off the circle by the radial part of an instant uniform in the
    period: on average over those met, of variance (|v| T)^2 / 18, and 1 m^2.
    """
    half = 0.5 * c.period_s
    if variant < CENTROID:
        refused = boundary.reported > len(boundary.nodes)
        if len(boundary.nodes) >= FEWEST:
            x, y, condition, inverse = circle_centre(nodes.positions, boundary.nodes, boundary.radii_m)
            if condition <= (WELL_CONDITIONED if variant == MIDPOINT else SINGULAR):
                if np.sqrt((x - circle.x) ** 2 + (y - circle.y) ** 2) <= circle.tolerance_m:
                    way = (mean[1] ** 2 + mean[3] ** 2) * c.period_s**2
                    scale = c.radius_m**2 * (1.0 + way / 18.0)
                    spread = scale * inverse[0], scale * inverse[1], scale * inverse[2]
                    if variant == MIDPOINT:
                        return Fix(x, y, spread, half)
                    # The same sign for nodes that were entered and left.
                    return Fix(x + half * mean[1], y + half * mean[3], spread, 0.0)
                refused = True
        if boundary.reported == 0 or (variant == MIDPOINT and not refused):
            return Fix(0.0, 0.0, (0.0, 0.0, 0.0), 0.0)
    return centroid(nodes, c)


@lean_piece
def centroid(nodes: Nodes, c: Any) -> Fix:
    """Mean of the awake nodes that detect, each uniform in a disc: variance R^2 / (4 n) on an axis."""
    x, y, n = 0.0, 0.0, 0
    for k in range(-1 if nodes.standing.head >= 0 else 0, nodes.standing.n_members):
        node = nodes.standing.head if k < 0 else nodes.members[k]
        if nodes.bitmap[node] != 0 and nodes.battery[node] > 0.0:
            x += nodes.positions[node, 0]
            y += nodes.positions[node, 1]
            n += 1
    if n == 0:
        return Fix(0.0, 0.0, (0.0, 0.0, 0.0), 0.0)
    variance = c.radius_m**2 / (4.0 * n)
    return Fix(x / n, y / n, (variance, 0.0, variance), 0.0)


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
def update_by_ranges(belief: Any, positions: np.ndarray, boundary: Boundary, c: Any) -> None:
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
        for node, radius_m in zip(boundary.nodes, boundary.radii_m):
            dx, dy = x - positions[node, 0], y - positions[node, 1]
            distance = np.sqrt(dx * dx + dy * dy)
            ux, uy = dx / max(distance, 1e-9), dy / max(distance, 1e-9)
            h = ux, -half * ux, uy, -half * uy
            moved = 0.0
            for i in range(4):
                moved += h[i] * (mean[i] - about[i])
            radial = (ux * about[1] + uy * about[3]) * c.period_s
            scalar_update(mean, cov, h, radius_m - distance - moved, radial * radial / 12.0 + floor)
