"""Where a target is, from one period's strengths alone: linear and nonlinear least squares."""

from typing import Any

import numpy as np

from wsn_env.compiled.kernels import kernel
from wsn_env.filters.base import MemorylessTracker
from wsn_env.models.measurement.base import at_point, linearise, node_at
from wsn_env.scenario import Scenario
from wsn_env.scenario.constants import constants

ON_A_LINE = 1e-6  # nodes whose squared extents differ by more than this factor fix no point
FARTHEST = 10  # sides
NEWTON_STEPS, NEWTON_END_M = 15, 1e-3
RIDGE = 1e-6  # 1/m^2: information that keeps the step finite where the likelihood is flat


class TrilaterationTracker(MemorylessTracker):
    """Linear least squares (`trilaterate`). Needs three nodes that do not stand on one line.

    What lies FARTHEST sides from the field or more is taken to lie there, and no sd is larger.
    """

    def __init__(self, scenario: Scenario, threads: int = 1, fast: bool = False) -> None:
        super().__init__(scenario)
        self._measurement: Any = scenario.measurement  # one with squared_ranges: scenario.tracking.reads
        self._constants, self._side_m = constants(scenario), scenario.field.side_m

    def locate(self, nodes: np.ndarray, places: np.ndarray, values: np.ndarray) -> Any:
        """The solution, if there is one."""
        far = FARTHEST * self._side_m
        found = trilaterate(places, *self._measurement.squared_ranges(values[:, 0], far))
        if found is None:
            return None
        point, cov = found
        return np.clip(point, -far, self._side_m + far), cov * min(1.0, far**2 / max(np.trace(cov), 1e-300))


class NonlinearLSTracker(TrilaterationTracker):
    """Maximum likelihood: Gauss and Newton's iteration on the strengths, from the linear solution.

    The estimate stays within a tenth of the side about the field, and so does each step's length.
    """

    def locate(self, nodes: np.ndarray, places: np.ndarray, values: np.ndarray) -> Any:
        """The solution, where there is a linear one."""
        rough = super().locate(nodes, places, values)
        if rough is None:
            return None
        point, cov = np.clip(rough[0], 0.0, self._side_m), np.empty((2, 2))
        _fit_point(self._constants, places, values[:, 0].copy(), point, cov)
        return point, cov


@kernel
def _fit_point(cs, nodes, strengths, point, cov):
    """Gauss and Newton's iteration from `point` (2,), in place; `cov` (2, 2) is filled with the inverse information."""
    c = cs[0]
    margin = 0.1 * c.tracking.side_m
    for _ in range(NEWTON_STEPS):
        a, b, d, u, v = RIDGE, 0.0, RIDGE, 0.0, 0.0  # the normal equations (a b; b d) step = (u, v)
        for i in range(len(strengths)):
            place = node_at(nodes, i)
            line = linearise(c.measurement, place, at_point(point[0], point[1]))[0]
            noise = np.sqrt(line.variance)
            beyond, hx, hy = (strengths[i] - line.expected) / noise, line.slope_x / noise, line.slope_y / noise
            a += hx * hx
            b += hx * hy
            d += hy * hy
            u += hx * beyond
            v += hy * beyond
        determinant = max(a * d - b * b, RIDGE * RIDGE)
        cov[0, 0], cov[1, 1] = d / determinant, a / determinant
        cov[0, 1] = cov[1, 0] = -b / determinant
        x, y = (d * u - b * v) / determinant, (a * v - b * u) / determinant
        length = np.sqrt(x * x + y * y)
        share = margin / max(length, margin)
        point[0] = min(max(point[0] + share * x, -margin), c.tracking.side_m + margin)
        point[1] = min(max(point[1] + share * y, -margin), c.tracking.side_m + margin)
        if length < NEWTON_END_M:
            break


def trilaterate(nodes: np.ndarray, squared: np.ndarray, sd: np.ndarray) -> Any:
    """Linear least squares from squared ranges d_i^2 to nodes p_i.

    The first node's circle is taken from the others', which leaves 2 (p_i - p_1)' x = d_1^2 - d_i^2 + |p_i|^2 - |p_1|^2
    (Lan, Nie et al., eq. 9).

    Args:
        nodes: (n, 2) m.
        squared, sd: (n,) d_i^2 and their sds [m^2].

    Returns: the point (2,) and its covariance (2, 2); None from fewer than three nodes, or where all stand on a line.
    """
    if len(nodes) < 3:
        return None
    design = 2 * (nodes[1:] - nodes[0])
    normal = design.T @ design
    if np.linalg.det(normal) <= ON_A_LINE * np.trace(normal) ** 2:
        return None
    power = (nodes**2).sum(axis=1)
    gain = np.linalg.solve(normal, design.T)
    point = gain @ (squared[0] - squared[1:] + power[1:] - power[0])
    common = gain.sum(axis=1)  # the first range enters every equation
    return point, (gain * sd[1:] ** 2) @ gain.T + sd[0] ** 2 * np.outer(common, common)
