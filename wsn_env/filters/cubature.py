"""The cubature Kalman filter and its iterated form; Gaussian integrals by 2n points, n = 4.

Arasaratnam & Haykin (2009): the mean of f over N(x, P) is that of f at x +- sqrt(n) s_j, s_j the columns of a square
root of P: here the symmetric one, since points along the columns of Cholesky's depend on the order of the axes. A
measurement z = h(x) + noise is replaced by its best linear fit over the belief (statistical linear regression),
z = H x + b + residual of covariance W + noise. The iterated form fits again about the belief just found (posterior
linearisation; Garcia-Fernandez, Svensson, Morelande & Sarkka, 2015), and always corrects the *prior*: to correct the
posterior once more would count the measurement twice. A linear measurement fits at once: both are then the Kalman
filter.
"""

import numpy as np

from wsn_env.compiled.kernels import kernel, over_rows, piece
from wsn_env.filters.base import MomentTracker
from wsn_env.filters.root import symmetric_root
from wsn_env.models.measurement.base import at_point, linearise, node_at, unwrap
from wsn_env.models.motion.prediction import predict_moments
from wsn_env.models.state import Belief, Network, Reports, network_at, reports_at
from wsn_env.scenario import Scenario
from wsn_env.scenario.constants import constants

ITERATIONS = 5  # at most
TOLERANCE_M = 1e-3  # a shift of the position below this ends the iteration


class _CubatureTracker(MomentTracker):
    """Corrects with all reports of a period at once."""

    iterations: int

    def __init__(self, scenario: Scenario, threads: int = 1, fast: bool = False):
        self._constants, self._threads = constants(scenario), threads

    def correct(
        self,
        keys: np.ndarray,
        periods: np.ndarray,
        belief: Belief,
        network: Network,
        reports: Reports,
        resampled: np.ndarray,
    ) -> None:
        """Predict and correct every row, in place."""
        arguments = self._constants, self.iterations, belief.row, network.handle, reports.handle
        over_rows(_correct_rows, len(keys), self._threads, *arguments)


class CKFTracker(_CubatureTracker):
    """Cubature Kalman filter: one linear fit, over the prediction.

    Own work: filterpy's CubatureKalmanFilter does not draw its points anew once the process noise is added.
    """

    iterations = 1


class ICKFTracker(_CubatureTracker):
    """Iterated cubature Kalman filter: at most ITERATIONS fits, until the position shifts by less than TOLERANCE_M."""

    iterations = ITERATIONS


@kernel
def _correct_rows(start, stop, cs, iterations, beliefs, network_handle, reports_handle):
    network, reports, c = network_at(network_handle), reports_at(reports_handle), cs[0]
    prior, prior_cov = np.empty(4), np.empty((4, 4))
    for b in range(start, stop):
        mean, cov = beliefs[b].mean, beliefs[b].cov
        predict_moments(mean, cov, c.period_s, c.tracking.q, prior, prior_cov)
        mean[:], cov[:] = prior, prior_cov
        positions, nodes, values = network.positions[b], reports.node[b, : reports.count[b]], reports.value[b]
        if len(nodes) == 0:
            continue
        for _ in range(iterations):
            x, y = mean[0], mean[2]
            about, told, variance = _expect_about(x, y, positions, nodes, values, c)
            slope, level, residual = _fit(mean, cov, positions, nodes, about, c)
            for i in range(len(told)):  # what is told beyond the fit at the prior
                residual[i, i] += variance[i]
                level[i] = told[i] - level[i]
                for k in range(4):
                    level[i] -= slope[i, k] * (prior[k] - mean[k])
            _correct(prior, prior_cov, slope, level, residual, mean, cov)
            if (mean[0] - x) ** 2 + (mean[2] - y) ** 2 < TOLERANCE_M**2:
                break


@piece
def _expect_about(x, y, positions, nodes, values, c):
    """What these nodes are expected to measure of a target at (x, y), what they have measured, told near that, and the
    variance of the noise: (m,) each, all numbers of a node's value one after the other."""
    size = 0
    for node in nodes:
        size += len(linearise(c.measurement, node_at(positions, node), at_point(x, y)))
    about, told, variance = np.empty(size), np.empty(size), np.empty(size)
    i = 0
    for j in range(len(nodes)):
        k = 0
        for line in linearise(c.measurement, node_at(positions, nodes[j]), at_point(x, y)):
            about[i], variance[i] = line.expected, line.variance
            told[i] = unwrap(c.measurement, values[j, k], line.expected)
            i, k = i + 1, k + 1
    return about, told, variance


@piece
def _expect(state, positions, nodes, about, c, out):
    """h(x): what these nodes measure but for noise, as `_expect_about` lays it out, and told near that."""
    i = 0
    for node in nodes:
        place = node_at(positions, node)
        for line in linearise(c.measurement, place, at_point(state[0], state[2])):
            out[i] = unwrap(c.measurement, line.expected, about[i])
            i += 1


@piece
def _fit(mean, cov, positions, nodes, about, c):
    """Statistical linear regression of h over N(mean, cov), for m measured values.

    With S the symmetric root of cov, z+_j and z-_j the values at mean +- 2 s_j, and D_j = (z+_j - z-_j) / 4, the
    covariance of state and values is S D, so that H = (cov^-1 S D)' = D' S^-1.

    Returns: H (m, 4); the mean value (m,); the residual's covariance (m, m): that of the values less H cov H' = D' D.
    """
    size = len(about)
    root, inverse = np.empty((4, 4)), np.empty((4, 4))
    symmetric_root(cov, root, inverse)
    values = np.empty((8, size))
    for j in range(4):
        _expect(mean + 2.0 * root[j], positions, nodes, about, c, values[2 * j])
        _expect(mean - 2.0 * root[j], positions, nodes, about, c, values[2 * j + 1])
    level = np.zeros(size)
    for k in range(8):
        level += values[k] / 8.0
    cross, slope = np.empty((size, 4)), np.zeros((size, 4))  # D' and H
    for i in range(size):
        for j in range(4):
            cross[i, j] = 0.25 * (values[2 * j, i] - values[2 * j + 1, i])
        for j in range(4):
            for k in range(4):
                slope[i, j] += cross[i, k] * inverse[k, j]
    residual = np.empty((size, size))
    for i in range(size):
        for k in range(i + 1):
            total = 0.0
            for j in range(8):
                total += (values[j, i] - level[i]) * (values[j, k] - level[k]) / 8.0
            for j in range(4):
                total -= cross[i, j] * cross[k, j]
            residual[i, k] = residual[k, i] = total
    return slope, level, residual


@piece
def _correct(prior, prior_cov, slope, innovation, noise, mean, cov):
    """Kalman's correction of the prior; mean and cov are filled, innovation and noise used up.

    S = H P H' + noise = L L'; with Y = L^-1 H P and e = L^-1 innovation it is x + Y' e and P - Y' Y.
    """
    size = len(innovation)
    gain = np.zeros((size, 4))
    for i in range(size):
        for j in range(4):
            for k in range(4):
                gain[i, j] += slope[i, k] * prior_cov[k, j]
    for i in range(size):
        for j in range(i + 1):
            for k in range(4):
                noise[i, j] += gain[i, k] * slope[j, k]
    _factor(noise)
    mean[:], cov[:] = prior, prior_cov
    for i in range(size):
        for k in range(i):
            innovation[i] -= noise[i, k] * innovation[k]
            for j in range(4):
                gain[i, j] -= noise[i, k] * gain[k, j]
        innovation[i] /= noise[i, i]
        for j in range(4):
            gain[i, j] /= noise[i, i]
        for j in range(4):
            mean[j] += gain[i, j] * innovation[i]
            for k in range(4):
                cov[j, k] -= gain[i, j] * gain[i, k]
    for j in range(4):
        cov[j, j] = max(cov[j, j], 0.0)


@piece
def _factor(matrix):
    """Cholesky's lower factor, in place, of the matrix in the lower half. A pivot lost to rounding becomes tiny."""
    for j in range(len(matrix)):
        matrix[:j, j] = 0.0
        pivot = least = matrix[j, j]
        for k in range(j):
            pivot -= matrix[j, k] * matrix[j, k]
        root = np.sqrt(max(pivot, 1e-14 * least, 1e-30))
        matrix[j, j] = root
        for i in range(j + 1, len(matrix)):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = total / root
