"""The extended Kalman filter, through filterpy: each report corrects in turn (in the order of the nodes)."""

import math

import numpy as np

from wsn_env.scenario import Scenario
from wsn_env.sections import Position, Rssi
from wsn_env.types import Belief, Network, Reports


class EKFTracker:
    """filterpy's ExtendedKalmanFilter on the constant velocity model (eqs. 6-8).

    A position report is linear, so the filter is then exact; a strength is linearised at the current mean. It keeps
    no memory but the belief, and loops over rows: its speed is filterpy's.
    """

    particles = 0

    def __init__(self, scenario: Scenario, threads: int = 1, fast: bool = False):
        from filterpy.kalman import ExtendedKalmanFilter  # takes a second or two to import

        t, q = scenario.period_s, scenario.filter_q
        gain = np.array([[t * t / 2, 0], [t, 0], [0, t * t / 2], [0, t]])
        self._measurement = scenario.measurement
        self._filter = ExtendedKalmanFilter(dim_x=4, dim_z=2)
        self._filter.F = np.array([[1, t, 0, 0], [0, 1, 0, 0], [0, 0, 1, t], [0, 0, 0, 1.0]])
        self._filter.Q = q * q * gain @ gain.T

    def start(self, keys, periods, rows, belief: Belief) -> None:
        """Nothing to spread: mean and covariance are the whole belief."""

    def relocate(self, keys, periods, rows, belief: Belief) -> None:
        """Nothing to move but mean and covariance."""

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
        m = self._measurement
        if isinstance(m, Position):
            self._filter.update(
                value, HJacobian=lambda x: POSITION_ROWS, Hx=lambda x: x[[0, 2]], R=m.noise_m**2 * np.eye(2)
            )
            return
        noise = m.noise_db if isinstance(m, Rssi) else m.noise
        self._filter.update(
            value[:1],
            HJacobian=lambda x: self._strength(x, node)[1],
            Hx=lambda x: self._strength(x, node)[0],
            R=np.array([[noise**2]]),
        )

    def _strength(self, x: np.ndarray, node: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Strength (1,) at a state, and its slope (1, 4); flat nearer than the floor."""
        m = self._measurement
        offset = x[[0, 2]] - node
        squared = max(float(offset @ offset), m.floor_m**2, 1e-12)
        flat = offset @ offset < m.floor_m**2
        if isinstance(m, Rssi):
            level = m.reference_dbm - 5 * m.exponent * math.log10(squared)
            slope = -10 * m.exponent / math.log(10) / squared
        else:
            level = m.amplitude * squared ** (-m.exponent / 2)
            slope = -m.exponent * level / squared
        row = np.zeros((1, 4))
        if not flat:
            row[0, [0, 2]] = slope * offset
        return np.array([level]), row


POSITION_ROWS = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0]])
