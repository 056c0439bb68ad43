"""Detection within a sensing radius with a soft edge."""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from wsn_env.compiled import draws
from wsn_env.compiled.elementary import F, exp, exp32, expm1_32, log, log32, normal_cdf
from wsn_env.compiled.kernels import inline_piece, lean_piece
from wsn_env.models.detection.base import DetectionRule, probability
from wsn_env.models.quantity import quantity

if TYPE_CHECKING:
    from wsn_env.models.measurement.base import Measurement
    from wsn_env.scenario import Scenario

SHARPEST = 1e-6  # m^(2/3): an edge without width would divide by it
LOG_LEAST, LOG_MOST = F(-13.815510558), F(-1.0000005e-6)  # p in [1e-6, 1 - 1e-6]: no report rules a particle out
TINY = F(1e-30)
LEAST_SOFT = 0.05  # of an edge whose information a mean over episodes meets


@lean_piece
def detection_curve(d: Any) -> tuple[Any, ...]:
    """Eqs. 2-3 in float32 and logarithms: inner and outer end [m], ln l1, b1, b2, ln l2."""
    return (
        F(d.inner_m),
        F(d.reach_m),
        F(log(max(d.decay, 1e-30))),
        F(d.decay_power),
        F(d.edge_power),
        F(log(max(d.ceiling, 1e-30))),
    )


@inline_piece
def log_detection32(squared: Any, curve: Any) -> Any:
    """Log of the detection probability at a squared distance [m^2] (eqs. 2-3), clipped to finite odds."""
    inner, reach, log_decay, decay_power, edge_power, log_ceiling = curve
    d = np.sqrt(squared)
    a1, a2 = d - inner, reach - d
    y = log_decay + decay_power * log32(max(a1, TINY)) - edge_power * log32(max(a2, TINY))
    fall = exp32(min(y, F(3))) * F(a1 > F(0)) + F(20) * F(a2 <= F(0))  # beyond e**3 p is below the least anyway
    return min(max(log_ceiling - fall, LOG_LEAST), LOG_MOST)


@dataclass(frozen=True)
class Detection(DetectionRule):
    """Probability of detection against distance.

        p(d) = l2                                    d <= (1 - delta) r
               l2 exp(-l1 a1**b1 / a2**b2)           in between
               0                                     d >= (1 + delta) r

    with a1 = d - (1 - delta) r and a2 = (1 + delta) r - d. Xiang & Guo (2013), eqs. 2-3.
    """

    radius_m: float = quantity(10.0, "sensing radius r_s", above=0, at_most=100_000)
    softness: float = quantity(0.2, "delta: half width of the soft edge, in radii", above=0, at_most=1)
    decay: float = quantity(1.0, "lambda1", at_least=0)
    ceiling: float = quantity(0.6, "lambda2: probability well inside the radius", above=0, at_most=1)
    decay_power: float = quantity(3.0, "beta1", above=0, at_most=50)
    edge_power: float = quantity(2.0, "beta2", above=0, at_most=50)

    allocates: ClassVar[bool] = False

    @property
    def regular(self) -> bool:
        """Not where the edge is all but a jump."""
        return self.decay > 0 and self.softness >= LEAST_SOFT and self.decay_power > 1

    @property
    def reach_m(self) -> float:
        """From here on a node detects nothing."""
        return (1 + self.softness) * self.radius_m

    def distance_m(self, share: float) -> float:
        """Where the probability falls to a share of its ceiling (eqs. 2-3 the other way round)."""
        inner, wanted = (1 - self.softness) * self.radius_m, -math.log(share) / max(self.decay, 1e-12)
        near, far = inner, self.reach_m
        for _ in range(60):  # bisection to the last bit
            middle = (near + far) / 2
            a1, a2 = middle - inner, self.reach_m - middle
            near, far = (middle, far) if a1**self.decay_power < wanted * a2**self.edge_power else (near, middle)
        return far

    def distances_m(self, measurement: Measurement) -> tuple[float, float]:
        """Sensing radius and reach, whatever is measured."""
        return self.radius_m, self.reach_m

    def constants(self, scenario: Scenario) -> dict[str, float]:
        """The settings; and the edge as a normal distribution in the cube root of the squared distance."""
        near, far = (self.distance_m(NormalDist().cdf(sds)) ** (2 / 3) for sds in (1, -1))
        edge = {"edge_root": (near + far) / 2, "edge_width": max((far - near) / 2, SHARPEST)}
        return super().constants(scenario) | edge | {"inner_m": (1 - self.softness) * self.radius_m}

    @staticmethod
    def probability(d: Any, m: Any, distance: float) -> float:
        if distance <= d.inner_m:
            return d.ceiling
        if distance >= d.reach_m:
            return 0.0
        a1 = distance - d.inner_m
        a2 = d.reach_m - distance
        return d.ceiling * exp(-d.decay * exp(d.decay_power * log(a1) - d.edge_power * log(a2)))

    @staticmethod
    def mean_probability(d: Any, m: Any, dx: float, dy: float, xx: float, xy: float, yy: float) -> float:
        """The cube root of the squared distance is nearly normal (Wilson & Hilferty, 1931, for this quadratic form).

        Over it the edge is taken for a normal distribution function, so that the mean has a closed form: within .02
        (rms) of the true one for beliefs up to a sensing radius wide, where the probability at the mean is off by .13.
        """
        root, mean, variance = cube_root(dx, dy, xx, xy, yy)
        sds, steepness = (d.edge_root - mean) / d.edge_width, 1.0 / d.edge_width
        return d.ceiling * normal_cdf(sds / np.sqrt(1.0 + steepness * steepness * root * root * variance))

    @staticmethod
    def detects(d: Any, m: Any, stream: Any, node: Any, x: float, y: float) -> bool:
        dx, dy = node.x - x, node.y - y
        squared = dx * dx + dy * dy
        if squared >= 1.000001 * d.reach_m * d.reach_m:
            return False
        uniform = draws.uniform(stream, node.number)
        return uniform < d.ceiling and uniform < probability(d, m, np.sqrt(squared))  # many draws need no eqs. 2-3

    @staticmethod
    def weigh_detection(d: Any, m: Any, x: np.ndarray, log_weights: np.ndarray, node: Any) -> None:
        px, py = x[0], x[2]
        sx, sy = F(node.x), F(node.y)
        curve = detection_curve(d)
        for i in range(x.shape[1]):
            dx = px[i] - sx
            dy = py[i] - sy
            log_weights[i] += log_detection32(dx * dx + dy * dy, curve)

    @staticmethod
    def weigh_silence(d: Any, m: Any, x: np.ndarray, log_weights: np.ndarray, node: Any, delivery: float) -> None:
        px, py = x[0], x[2]
        sx, sy = F(node.x), F(node.y)
        curve = detection_curve(d)
        sent, lost = F(delivery), F(1.0 - delivery)
        for i in range(x.shape[1]):
            dx = px[i] - sx
            dy = py[i] - sy
            unseen = -expm1_32(log_detection32(dx * dx + dy * dy, curve))
            log_weights[i] += log32(min(lost + sent * unseen, F(1)))  # <= 0, as log weights have to be


@lean_piece
def cube_root(dx: float, dy: float, xx: float, xy: float, yy: float) -> tuple[Any, ...]:
    """The cube root of the squared distance to a target believed to be at (dx, dy), as a normal distribution.

    Returns: the cube root of the mean squared distance, its mean, and its variance as a share of the root's square.
    """
    squared = max(dx * dx + dy * dy + xx + yy, 1e-12)  # mean and variance of the squared distance
    variance = 2.0 * (xx * xx + 2.0 * xy * xy + yy * yy)
    variance += 4.0 * (dx * dx * xx + 2.0 * dx * dy * xy + dy * dy * yy)
    ninth = variance / (9.0 * squared * squared)
    root = exp(log(squared) / 3.0)
    return root, root * (1.0 - ninth), ninth  # ninth is 2 / 9 at most
