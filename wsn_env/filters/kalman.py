"""The extended and the unscented Kalman filter, through filterpy."""

import numpy as np

from wsn_env.filters.base import MomentTracker
from wsn_env.models.physics.sensing import expected_strengths, linearised_strengths
from wsn_env.models.sections import Level, Measurement, Position
from wsn_env.scenario import Scenario
from wsn_env.simulation.state import Belief, Network, Reports


def constant_velocity(scenario: Scenario) -> tuple[np.ndarray, np.ndarray]:
    """F and Q of the constant velocity model (eqs. 6-8), (4, 4) each: Q = q^2 G G', G = (T^2/2, T) an axis.

    The acceleration is constant within a period and has sd q. White acceleration of density w (m^2/s^3) is, up to
    w T^3/12 in the variance of the position, q = sqrt(w / T).
    """
    t, q = scenario.period_s, scenario.filter_q
    gain = np.array([[t * t / 2, 0], [t, 0], [0, t * t / 2], [0, t]])
    return np.array([[1, t, 0, 0], [0, 1, 0, 0], [0, 0, 1, t], [0, 0, 0, 1.0]]), q * q * gain @ gain.T


def noise_of(measurement: Measurement) -> float:
    """Its sd, in its unit."""
    if isinstance(measurement, Position):
        return measurement.noise_m
    return measurement.noise_db if isinstance(measurement, Level) else measurement.noise


class EKFTracker(MomentTracker):
    """filterpy's ExtendedKalmanFilter: each report corrects in turn, in the order of the nodes.

    A position report is linear, so the filter is then exact; a strength is linearised at the current mean. It keeps
    no memory but the belief, and loops over rows: its speed is filterpy's.
    """

    def __init__(self, scenario: Scenario, threads: int = 1, fast: bool = False):
        from filterpy.kalman import ExtendedKalmanFilter  # takes a second or two to import

        self._measurement, self._noise = scenario.measurement, noise_of(scenario.measurement)
        self._filter = ExtendedKalmanFilter(dim_x=4, dim_z=2)
        self._filter.F, self._filter.Q = constant_velocity(scenario)

    def correct(self, keys, periods, belief: Belief, network: Network, reports: Reports, resampled) -> None:
        """Predict and correct every row, in place."""
        ekf = self._filter
        for b in range(len(keys)):
            ekf.x, ekf.P = belief.mean[b].copy(), belief.cov[b].copy()
            ekf.predict()
            for j in range(reports.count[b]):
                self._update(network.positions[b, reports.node[b, j]], reports.value[b, j])
            belief.mean[b], belief.cov[b] = ekf.x, 0.5 * (ekf.P + ekf.P.T)

    def _update(self, node: np.ndarray, value: np.ndarray) -> None:
        variance = self._noise**2
        if isinstance(self._measurement, Position):
            self._filter.update(
                value, HJacobian=lambda x: POSITION_ROWS, Hx=lambda x: x[[0, 2]], R=variance * np.eye(2)
            )
            return
        expected, slope = linearised_strengths(self._filter.x[[0, 2]], node[None], self._measurement)
        row = np.zeros((1, 4))
        row[:, [0, 2]] = slope
        self._filter.update(value[:1], HJacobian=lambda x: row, Hx=lambda x: expected, R=np.array([[variance]]))


class UKFTracker(MomentTracker):
    """filterpy's UnscentedKalmanFilter: 9 points (alpha = .1, beta = 2, kappa = -1), all reports at once.

    Van der Merwe (2004). Keeps no memory but the belief; a covariance that has lost its sign, as the negative weight
    of the central point allows, gets it back.
    """

    def __init__(self, scenario: Scenario, threads: int = 1, fast: bool = False):
        from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

        transition, noise = constant_velocity(scenario)
        points = MerweScaledSigmaPoints(4, alpha=0.1, beta=2.0, kappa=-1.0, sqrt_method=square_root)
        self._filter = UnscentedKalmanFilter(
            dim_x=4, dim_z=1, dt=scenario.period_s, hx=None, fx=lambda x, dt: transition @ x, points=points
        )
        self._filter.Q = noise
        self._measurement, self._noise = scenario.measurement, noise_of(scenario.measurement)

    def correct(self, keys, periods, belief: Belief, network: Network, reports: Reports, resampled) -> None:
        """Predict and correct every row, in place."""
        ukf = self._filter
        for b in range(len(keys)):
            ukf.x, ukf.P = belief.mean[b].copy(), belief.cov[b].copy()
            ukf.predict()
            n = reports.count[b]
            if n > 0:
                self._update(network.positions[b, reports.node[b, :n]], reports.value[b, :n])
            root = square_root(ukf.P)
            belief.mean[b], belief.cov[b] = ukf.x, root.T @ root

    def _update(self, nodes: np.ndarray, values: np.ndarray) -> None:
        m = self._measurement
        if isinstance(m, Position):
            told, expect = values.ravel(), lambda x: np.tile(x[[0, 2]], len(nodes))
        else:
            told, expect = values[:, 0], lambda x: expected_strengths(x[[0, 2]], nodes, m)
        self._filter.update(told, R=self._noise**2 * np.eye(len(told)), hx=expect)


def square_root(cov: np.ndarray) -> np.ndarray:
    """U with U' U = cov, for any n; directions of negative variance are flattened."""
    cov = 0.5 * (cov + cov.T)
    try:
        return np.linalg.cholesky(cov).T
    except np.linalg.LinAlgError:
        variances, directions = np.linalg.eigh(cov)
        return np.sqrt(np.maximum(variances, 0.0))[:, None] * directions.T


POSITION_ROWS = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0]])
