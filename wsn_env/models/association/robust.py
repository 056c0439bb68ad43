"""Weighing reports of which some may be wrong: a gate, a likelihood that reckons with outliers, nodes that may stand
elsewhere."""

from typing import Any, NamedTuple

import numpy as np

from wsn_env.compiled.elementary import HALF_PI, F, exp32, log32
from wsn_env.compiled.kernels import lean_piece
from wsn_env.models.measurement.base import AtHead, PositionBelief, linearise, node_at, unwrap, weigh


class Judgement(NamedTuple):
    """What a report looks like from the prediction."""

    sds: float  # how far off it is
    temper: float  # share of its information that is left if its node may stand elsewhere
    outlier: float  # density of an outlier over the highest of a good report


@lean_piece
def judge(node: Any, value: np.ndarray, target: PositionBelief, c: Any) -> Any:
    """Compare a report with what it should be, its numbers linearised about the prediction and each taken by itself.

    An outlier is taken for a report of a target anywhere within the sensing radius, its numbers uniform.
    """
    t, k = c.tracking, 0
    sds, temper, outlier = 0.0, 1.0, 1.0
    for line in linearise(c.measurement, node, target):
        sx, sy = line.slope_x, line.slope_y
        steepness = sx * sx + sy * sy
        own = line.variance + t.node_sd_m * t.node_sd_m * steepness
        variance = own + sx * sx * target.xx + 2.0 * sx * sy * target.xy + sy * sy * target.yy
        off = unwrap(c.measurement, value[k], line.expected) - line.expected
        sds = max(sds, abs(off) / np.sqrt(variance))
        temper = min(temper, line.variance / own)
        spread = 2.0 * t.radius_m * np.sqrt(steepness)
        outlier *= min(np.sqrt(4.0 * HALF_PI * own) / max(spread, 1e-12), 1.0)
        k += 1
    return Judgement(sds, temper, outlier)


@lean_piece
def weigh_robustly(head: AtHead, c: Any, scratch: np.ndarray) -> None:
    """Weigh the particles with what a head has heard in a period, in place.

    A report more than `gate_sds` off the prediction is not used. Of the others, with e = `outlier_share`,

        w *= (1 - e) L^t + e k

    with the likelihood L in units of its peak, t = R / (R + node_sd_m^2 H H') and k as `judge` has them.

    Args:
        scratch: (P,) float32.
    """
    belief, network, reports, b = head
    x, log_weights, t = belief.particles[b], belief.log_weights[b], c.tracking
    mean, cov = belief.row[b].predicted_mean, belief.row[b].predicted_cov
    target = PositionBelief(mean[0], mean[2], cov[0, 0], cov[0, 2], cov[2, 2])
    count = reports.count[b]
    for j in range(count):
        node, value = node_at(network.positions[b], reports.node[b, j]), reports.value[b, j]
        seen = judge(node, value, target, c)
        if seen.sds > t.gate_sds:
            continue
        temper, good, other = F(seen.temper), F(1.0 - t.outlier_share), F(t.outlier_share * seen.outlier)
        scratch[:] = F(0)
        if t.pooled:  # every count-th particle from the j-th on
            weigh(c.measurement, x[0, j::count], x[2, j::count], scratch[j::count], node, value)
            _add(log_weights[j::count], scratch[j::count], temper, good, other)
        else:
            weigh(c.measurement, x[0], x[2], scratch, node, value)
            _add(log_weights, scratch, temper, good, other)


@lean_piece
def _add(log_weights, likelihoods, temper, good, other):
    """Add the log of good L^temper + other, given ln L."""
    if other > F(0):
        for i in range(len(log_weights)):
            log_weights[i] += log32(min(good * exp32(temper * likelihoods[i]) + other, F(1)))
    else:
        for i in range(len(log_weights)):
            log_weights[i] += temper * likelihoods[i]
