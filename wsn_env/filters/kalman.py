"""The extended and the unscented Kalman filter, through filterpy."""

from typing import Any

import numpy as np

from wsn_env.filters.base import MomentTracker
from wsn_env.filters.linear import LinearModel
from wsn_env.models.state import Belief, Network, Reports
from wsn_env.scenario import Scenario


def constant_velocity(scenario: Scenario) -> tuple[np.ndarray, np.ndarray]:
    """F and Q of the constant velocity model (eqs. 6-8), (4, 4) each: Q = q^2 G G', G = (T^2/2, T) an axis.

    The acceleration is constant within a period and has sd q. White acceleration of density w (m^2/s^3) is, up to
    w T^3/12 in the variance of the position, q = sqrt(w / T).
    """
    t, q = scenario.period_s, scenario.filter_q
    gain = np.array([[t * t / 2, 0], [t, 0], [0, t * t / 2], [0, t]])
    return np.array([[1, t, 0, 0], [0, 1, 0, 0], [0, 0, 1, t], [0, 0, 0, 1.0]]), q * q * gain @ gain.T


class FilterpyTracker(MomentTracker):
    """Base of the trackers that one of filterpy's filters predicts and corrects: final classes add `update`.

    They keep no memory but the belief, and loop over rows: their speed is filterpy's.

    Args:
        kalman: the filter.
    """

    def __init__(self, kalman: Any) -> None:
        self._filter = kalman

    def update(self, nodes: np.ndarray, places: np.ndarray, values: np.ndarray) -> None:
        """Correct the filter with a period's reports.

        Args:
            nodes: (n,) who reported, n > 0.
            places: (n, 2) where they stand [m].
            values: (n, 2) what they measured.
        """
        raise NotImplementedError

    def repair(self, cov: np.ndarray) -> np.ndarray:
        """A covariance (4, 4) without what rounding has done to it."""
        return 0.5 * (cov + cov.T)

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
        kalman = self._filter
        for b in range(len(keys)):
            kalman.x, kalman.P = belief.mean[b].copy(), belief.cov[b].copy()
            kalman.predict()
            nodes, values = reports.node[b, : reports.count[b]], reports.value[b, : reports.count[b]]
            if len(nodes):
                self.update(nodes, network.positions[b, nodes], values)
            belief.mean[b], belief.cov[b] = kalman.x, self.repair(kalman.P)


class EKFTracker(FilterpyTracker):
    """filterpy's ExtendedKalmanFilter: each report corrects in turn, in the order of the nodes.

    A linear measurement, such as a position, makes it exact; others are linearised at the current mean.
    """

    def __init__(self, scenario: Scenario, threads: int = 1, fast: bool = False) -> None:
        from filterpy.kalman import ExtendedKalmanFilter  # takes a second or two to import

        super().__init__(ExtendedKalmanFilter(dim_x=4, dim_z=2))
        self._model = LinearModel(scenario)
        self._filter.F, self._filter.Q = constant_velocity(scenario)

    def update(self, nodes: np.ndarray, places: np.ndarray, values: np.ndarray) -> None:
        """Correct with one report after the other."""
        for place, value in zip(places, values):
            self._update_by_one(place, value)

    def _update_by_one(self, place: np.ndarray, value: np.ndarray) -> None:
        x, _, y, _ = self._filter.x
        lines = self._model.lines(x, y, place[None], value[None])
        rows = np.zeros((self._model.values, 4))
        rows[:, [0, 2]] = lines.slope[0]
        noise = np.diag(lines.variance[0])
        self._filter.update(lines.value[0], HJacobian=lambda x: rows, Hx=lambda x: lines.expected[0], R=noise)


class UKFTracker(FilterpyTracker):
    """filterpy's UnscentedKalmanFilter: 9 points (alpha = .1, beta = 2, kappa = -1), all reports at once.

    Van der Merwe (2004). A covariance that has lost its sign, as the negative weight of the central point allows, gets
    it back.
    """

    def __init__(self, scenario: Scenario, threads: int = 1, fast: bool = False) -> None:
        from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

        transition, noise = constant_velocity(scenario)
        points = MerweScaledSigmaPoints(4, alpha=0.1, beta=2.0, kappa=-1.0, sqrt_method=square_root)
        super().__init__(
            UnscentedKalmanFilter(
                dim_x=4, dim_z=1, dt=scenario.period_s, hx=None, fx=lambda x, dt: transition @ x, points=points
            )
        )
        self._filter.Q = noise
        self._model = LinearModel(scenario)

    def update(self, nodes: np.ndarray, places: np.ndarray, values: np.ndarray) -> None:
        """Correct with all reports at once."""
        x, _, y, _ = self._filter.x
        about = self._model.lines(x, y, places, values)

        def expect(state):
            there = self._model.lines(state[0], state[2], places, values)
            return self._model.near(there.expected, about.expected).ravel()

        self._filter.update(about.value.ravel(), R=np.diag(about.variance.ravel()), hx=expect)

    def repair(self, cov: np.ndarray) -> np.ndarray:
        """Without negative variances."""
        root = square_root(cov)
        return root.T @ root


def square_root(cov: np.ndarray) -> np.ndarray:
    """The symmetric S with S S = cov, for any n; directions of negative variance are flattened.

    Unlike Cholesky's factor it does not depend on the order of the axes, nor do points spread along its columns.
    """
    variances, directions = np.linalg.eigh(0.5 * (cov + cov.T))
    return (directions * np.sqrt(np.maximum(variances, 0.0))) @ directions.T


POSITION_ROWS = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0]])
