"""Detection and measurement.

The likelihood of a measurement over a particle cloud stands with the filter, in trackers/kernels.
"""

from functools import lru_cache

import numpy as np

from wsn_env.compiled import draws
from wsn_env.compiled.elementary import exp, log, normal_cdf
from wsn_env.compiled.kernels import lean_kernel, lean_piece
from wsn_env.models.physics.constants import sensing_constants
from wsn_env.models.physics.field import squared_distance
from wsn_env.models.sections import Beacon, Binary, Detection, Measurement, Position, Rssi, RssiPower, Sonar, Threshold

KINDS = (Position, Rssi, RssiPower, Sonar, Binary, Beacon)
POSITION, STRENGTH, POWER, SONAR, BINARY, BEACON = (kind.code for kind in KINDS)
THRESHOLD = Threshold.code


@lean_piece
def detection_piece(distance, c):
    """Eqs. 2-3, or that of a threshold, for one distance [m] and a record of constants."""
    if c.detection == THRESHOLD:
        if distance >= c.reach_m:
            return 0.0
        return normal_cdf((strength(distance * distance, c) - c.threshold_db) / c.noise)
    if distance <= c.inner_m:
        return c.ceiling
    if distance >= c.reach_m:
        return 0.0
    a1 = distance - c.inner_m
    a2 = c.reach_m - distance
    return c.ceiling * exp(-c.decay * exp(c.decay_power * log(a1) - c.edge_power * log(a2)))


@lean_piece
def mean_detection(dx, dy, pxx, pxy, pyy, c):
    """Probability of detection of a target that is only believed to be somewhere.

    The cube root of the squared distance is nearly normal (Wilson & Hilferty, 1931, for this quadratic form). Over it
    the edge of eqs. 2-3 is taken for a normal distribution function, and the level of a threshold for a straight line,
    so that the mean has a closed form: for eqs. 2-3 it is within .02 (rms) of the true one for beliefs up to a sensing
    radius wide, where the probability at the mean is off by .13.

    Args:
        dx, dy: from the node to the belief's mean [m].
        pxx, pxy, pyy: its covariance [m^2].
    """
    squared = max(dx * dx + dy * dy + pxx + pyy, 1e-12)  # mean and variance of the squared distance
    variance = 2.0 * (pxx * pxx + 2.0 * pxy * pxy + pyy * pyy)
    variance += 4.0 * (dx * dx * pxx + 2.0 * dx * dy * pxy + dy * dy * pyy)
    ninth = variance / (9.0 * squared * squared)
    root = exp(log(squared) / 3.0)
    mean = root * (1.0 - ninth)  # ninth is 2 / 9 at most
    if c.detection == THRESHOLD:
        likely = mean * mean * mean
        sds = (strength(likely, c) - c.threshold_db) / c.noise
        steepness, ceiling = 1.5 * mean * mean * strength_slope(likely, c) / c.noise, 1.0
    else:
        sds, steepness, ceiling = (c.edge_root - mean) / c.edge_width, 1.0 / c.edge_width, c.ceiling
    return ceiling * normal_cdf(sds / np.sqrt(1.0 + steepness * steepness * root * root * ninth))


@lean_kernel
def _detection_probabilities(constants, distances, out):
    c = constants[0]
    for i in range(len(distances)):
        out[i] = detection_piece(distances[i], c)


def detection_probability(distance, detection: Detection | Threshold, measurement: Measurement = Position()):  # noqa: B008
    """Probability that a node detects the target.

        p(d) = l2                                    d <= (1 - delta) r
               l2 exp(-l1 a1**b1 / a2**b2)           in between
               0                                     d >= (1 + delta) r

    with a1 = d - (1 - delta) r and a2 = (1 + delta) r - d. Xiang & Guo (2013), eqs. 2-3. With a threshold

        p(d) = Phi((h(d) - threshold) / sigma)       where that is at least 1e-6; 0 beyond

    with h(d) the mean level and sigma the noise of what is measured.

    Args:
        distance: (...,) m, target to node.
        detection: radius_m (r), softness (delta), decay (l1), ceiling (l2), decay_power (b1), edge_power (b2); or
            threshold_db.
        measurement: what a node measures; only a threshold asks.

    Returns: (...,) probability.
    """
    record = sensing_constants(detection, measurement)
    distance = np.asarray(distance, dtype=float)
    out = np.empty(distance.size)
    _detection_probabilities(record, np.ascontiguousarray(distance).ravel(), out)
    return out.reshape(distance.shape)


def joint_detection_probability(probabilities):
    """Probability that at least one of the nodes detects: 1 - prod(1 - p_i). Xiang & Guo (2013), eq. 4.

    Args:
        probabilities: (..., n); nodes that do not take part have 0.

    Returns: (...,), the same bits for every batch (the product runs in the order of the nodes).
    """
    missed = np.cumprod(1.0 - np.asarray(probabilities, dtype=float), axis=-1)
    return 1.0 - missed[..., -1]


@lean_piece
def detects(key, period, node, squared, c):
    """Whether a node, if awake, detects the target at a squared distance [m^2] in this period."""
    return detects_by(detection_stream(key, period, c), node, squared, c)


@lean_piece
def detection_stream(key, period, c):
    """The draws that decide who detects in a period."""
    return draws.stream(key, period, draws.MEASUREMENT if c.detection == THRESHOLD else draws.DETECTION)


@lean_piece
def detects_by(stream, node, squared, c):
    """`detects`, where one stream serves many nodes."""
    if c.detection == THRESHOLD:
        return _noisy_strength(stream, node, squared, c) > c.threshold_db
    if squared >= 1.000001 * c.reach_m * c.reach_m:
        return False
    luck = draws.uniform(stream, node)
    return luck < c.ceiling and luck < detection_piece(np.sqrt(squared), c)  # many draws need no eqs. 2-3


@lean_piece
def tells(key, period, node, squared, c):
    """Whether a node takes the target to be there: it detects, unless it misreads its one bit."""
    misread = c.flip > 0.0 and draws.uniform(draws.stream(key, period, draws.MISREADING), node) < c.flip
    return detects(key, period, node, squared, c) != misread


@lean_piece
def strength(squared, c):
    """Noise-free strength at a squared distance [m^2], in dB or in power."""
    near = max(squared, c.floor_m * c.floor_m, 1e-12)
    fall = c.slope * log(near)
    if c.model == POWER:
        return c.level * exp(-fall)
    return c.level - fall - (c.absorption * np.sqrt(near) if c.model == SONAR else 0.0)


@lean_piece
def strength_slope(squared, c):
    """Derivative of the noise-free strength by distance, over the distance [1/m^2]; times (dx, dy), its gradient.

    0 nearer than the floor.
    """
    if squared < max(c.floor_m * c.floor_m, 1e-12):
        return 0.0
    slope = -2.0 * c.slope / squared
    if c.model == POWER:
        slope *= strength(squared, c)
    elif c.model == SONAR:
        slope -= c.absorption / np.sqrt(squared)
    return slope


@lean_kernel
def _strengths(cs, squared, strengths, slopes):
    for i in range(len(squared)):
        strengths[i] = strength(squared[i], cs[0])
        slopes[i] = strength_slope(squared[i], cs[0])


@lru_cache
def _constants_of(measurement: Measurement):
    return sensing_constants(Detection(), measurement)


def expected_strengths(points, nodes, measurement: Measurement):
    """Noise-free strengths (eq. 1) of targets at some points, at every node.

    Args:
        points: (..., 2) m.
        nodes: (n, 2) m.
        measurement: of a strength, in dB or in power.

    Returns: (..., n).
    """
    return _over_offsets(points, nodes, measurement)[1]


def linearised_strengths(points, nodes, measurement: Measurement):
    """The strengths of `expected_strengths`, and how they change with x and y [1/m]; 0 nearer than the floor.

    Returns: (..., n) and (..., n, 2).
    """
    offset, strengths, slopes = _over_offsets(points, nodes, measurement)
    return strengths, slopes[..., None] * offset


def _over_offsets(points, nodes, measurement: Measurement):
    offset = np.asarray(points)[..., None, :] - nodes
    squared = (offset**2).sum(axis=-1)
    strengths, slopes = np.empty(squared.size), np.empty(squared.size)
    _strengths(_constants_of(measurement), squared.ravel(), strengths, slopes)
    return offset, strengths.reshape(squared.shape), slopes.reshape(squared.shape)


@lean_piece
def measured_strength(key, period, node, squared, c):
    """The strength that a node measures at a squared distance [m^2] (eq. 1), in dB or in power."""
    return _noisy_strength(draws.stream(key, period, draws.MEASUREMENT), node, squared, c)


@lean_piece
def _noisy_strength(stream, node, squared, c):
    noise, _ = draws.normal_pair(stream, node)
    return strength(squared, c) + c.noise * noise


@lean_piece
def measure(key, period, node, positions, target, c, value):
    """What node `node` measures if it detects: `value` (2,) = x, y [m] (eq. 7), or strength and 0 (eq. 1).

    Args:
        target: (x, y), the true position [m].
    """
    if c.model == POSITION:
        e0, e1 = draws.normal_pair(draws.stream(key, period, draws.MEASUREMENT), node)
        value[0] = target[0] + c.noise * e0
        value[1] = target[1] + c.noise * e1
    else:
        squared = squared_distance(positions, node, target[0], target[1])
        value[0] = measured_strength(key, period, node, squared, c)
        value[1] = 0.0


@lean_piece
def log_miss_probability(mean, cov, positions, nodes, count, head, c):
    """Log of the probability that none of the awake nodes would have been heard, averaged over the belief.

    The average is Gauss and Hermite's with 3 x 3 points over the belief's position (exact to degree 5).

    Args:
        mean, cov: (4,), (4, 4) the belief about this period before its reports.
        nodes, count: the members.
        head: -1: nobody is awake.
    """
    a = np.sqrt(max(cov[0, 0], 1e-12))
    b = cov[0, 2] / a
    d = np.sqrt(max(cov[2, 2] - b * b, 0.0))
    total = 0.0
    for i in range(-1, 2):
        for j in range(-1, 2):
            weight = (2.0 / 3.0 if i == 0 else 1.0 / 6.0) * (2.0 / 3.0 if j == 0 else 1.0 / 6.0)
            u, v = 1.7320508075688772 * i, 1.7320508075688772 * j
            x, y = mean[0] + a * u, mean[2] + b * u + d * v
            missed = 1.0
            if head >= 0:
                distance = np.sqrt(squared_distance(positions, head, x, y))
                missed = 1.0 - c.head_delivery * detection_piece(distance, c)
            for k in range(count):
                distance = np.sqrt(squared_distance(positions, nodes[k], x, y))
                missed *= 1.0 - c.delivery * detection_piece(distance, c)
            total += weight * missed
    return log(max(total, 1e-300))
