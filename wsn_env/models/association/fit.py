"""How a measurement fits a target that is believed to be somewhere, and how it fits none."""

from typing import Any, NamedTuple

import numpy as np

from wsn_env.compiled.elementary import HALF_PI, exp
from wsn_env.compiled.kernels import lean_piece
from wsn_env.models.detection.base import probability
from wsn_env.models.measurement.base import PositionBelief, linearise, unwrap

LOST = 1e-3  # false measurements of a node that are reckoned with beside clutter: of targets whose track is lost
POINTS = 64  # of a disc, over which densities are averaged
GOLDEN_COS, GOLDEN_SIN = -0.7373688780783197, 0.6754902942615238  # of the golden angle: points spread evenly


class Fit(NamedTuple):
    """A measurement beside what it should be."""

    squares: float  # how far off it is: innovations squared, over their variances
    density: float  # of it, from where the target is believed to be
    corrected: Any  # PositionBelief, if it is of that target


@lean_piece
def fit(node: Any, value: np.ndarray, target: PositionBelief, c: Any) -> Any:
    """Compare a measurement with what it should be: the Kalman filter, number by number, linearised at the belief."""
    x, y, xx, xy, yy = target
    squares, density, k = 0.0, 1.0, 0
    for line in linearise(c.measurement, node, target):
        sx, sy = line.slope_x, line.slope_y
        gx, gy = xx * sx + xy * sy, xy * sx + yy * sy
        variance = max(line.variance + sx * gx + sy * gy, 1e-12)
        off = unwrap(c.measurement, value[k], line.expected) - line.expected - sx * (x - target.x) - sy * (y - target.y)
        x, y = x + gx * off / variance, y + gy * off / variance
        xx, xy, yy = xx - gx * gx / variance, xy - gx * gy / variance, yy - gy * gy / variance
        squares += off * off / variance
        density /= np.sqrt(4.0 * HALF_PI * variance)
        k += 1
    return Fit(squares, density * exp(-0.5 * min(squares, 1400.0)), PositionBelief(x, y, xx, xy, yy))


@lean_piece
def highest_density(node: Any, target: PositionBelief, c: Any) -> float:
    """Of a measurement that is just what it should be: what a likelihood of 1 stands for."""
    density = 1.0
    for line in linearise(c.measurement, node, target):
        density /= np.sqrt(4.0 * HALF_PI * max(line.variance, 1e-12))
    return density


@lean_piece
def cell_variance(c: Any) -> float:
    """Along x, and along y, of a place in a point's share of the sensing disc [m^2]."""
    return 2.0 * HALF_PI * c.radius_m * c.radius_m / (12.0 * POINTS)


@lean_piece
def false_density(node: Any, value: np.ndarray, c: Any) -> float:
    """Density of a false measurement: of a target anywhere within the sensing radius, if the node detects it.

    The mean over points of a sunflower, each as wide as its share of the disc.
    """
    total, mass, cos, sin = 0.0, 0.0, 1.0, 0.0
    variance = cell_variance(c)
    for k in range(POINTS):
        far = c.radius_m * np.sqrt((k + 0.5) / POINTS)
        seen = probability(c.detection, c.measurement, far)
        if seen > 0.0:
            place = PositionBelief(node.x + far * cos, node.y + far * sin, variance, 0.0, variance)
            total += seen * fit(node, value, place, c).density
            mass += seen
        cos, sin = cos * GOLDEN_COS - sin * GOLDEN_SIN, sin * GOLDEN_COS + cos * GOLDEN_SIN
    return total / mass if mass > 0.0 else 0.0
