"""Stone Soup's joint probabilistic data association on reports that heads of ours have heard, node by node."""

from __future__ import annotations

from datetime import datetime, timedelta
from typing import Any

import numpy as np
from stonesoup.dataassociator.probability import JPDA
from stonesoup.functions import gm_reduce_single
from stonesoup.hypothesiser.probability import PDAHypothesiser
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.models.transition.linear import LinearGaussianTimeInvariantTransitionModel
from stonesoup.predictor.kalman import KalmanPredictor
from stonesoup.types.array import StateVectors
from stonesoup.types.detection import Detection
from stonesoup.types.numeric import Probability
from stonesoup.types.prediction import GaussianStatePrediction
from stonesoup.types.state import GaussianState
from stonesoup.types.track import Track
from stonesoup.types.update import GaussianStateUpdate
from stonesoup.updater.kalman import KalmanUpdater

from wsn_env import Scenario
from wsn_env.models.association.fit import LOST
from wsn_env.models.state import State
from wsn_env.scenario.sensing import detection_probability

START = datetime(2025, 1, 1)
POSITION = (0, 2)


class Once(KalmanPredictor):
    """Predicts to an instant but once, whatever a model without time says of no time at all."""

    def predict(self, prior: Any, timestamp: Any = None, **more: Any) -> Any:
        """The prior itself, if it is of that instant."""
        if prior.timestamp == timestamp:
            return GaussianStatePrediction(prior.state_vector, prior.covar, timestamp=timestamp)
        return super().predict(prior, timestamp=timestamp, **more)


class ByDistance(PDAHypothesiser):
    """With a probability of detection of each track's own."""

    def hypothesise(self, track: Any, *arguments: Any, **more: Any) -> Any:
        """Take the track's for the time."""
        self.prob_detect = Probability(track.metadata["chance"])
        return super().hypothesise(track, *arguments, **more)


class Trackers:
    """A Kalman filter for each target of each field, from the first beliefs of a state."""

    def __init__(self, state: State, scenario: Scenario) -> None:
        t, q, measurement = scenario.period_s, scenario.filter_q, scenario.measurement
        noise_m: float = measurement.noise_m  # type: ignore[attr-defined]  # of a Position
        axis, gain = np.array([[1.0, t], [0.0, 1.0]]), np.array([[0.5 * t * t], [t]])
        two = np.eye(2)
        transition = LinearGaussianTimeInvariantTransitionModel(
            transition_matrix=np.kron(two, axis), covariance_matrix=np.kron(two, q * q * gain @ gain.T)
        )
        predictor, self._scenario = Once(transition), scenario
        self._updater = KalmanUpdater(LinearGaussian(4, POSITION, noise_m**2 * two))
        clutter: float = scenario.association.clutter  # type: ignore[attr-defined]  # of an Unknown
        density = (clutter + LOST) / (np.pi * scenario.radius_m**2)
        self._hypothesiser = ByDistance(
            predictor, self._updater, density, prob_gate=Probability(1 - 1e-4), include_all=False
        )
        self._associator, self._period = JPDA(self._hypothesiser), 0
        self._tracks = [
            Track([GaussianState(mean.reshape(4, 1), cov.copy(), START)])
            for mean, cov in zip(state.belief.mean, state.belief.cov)
        ]

    def correct(self, state: State) -> np.ndarray:
        """Predict, then correct with the lists of the nodes that the heads of each field have heard.

        Returns: (B, 2) estimates [m].
        """
        self._period += 1
        now, targets = START + timedelta(seconds=self._period * self._scenario.period_s), self._scenario.targets
        for first in range(0, state.rows, targets):
            tracks = self._tracks[first : first + targets]
            for track in tracks:
                track.append(self._hypothesiser.predictor.predict(track[-1], timestamp=now))
                del track.states[:-1]
            count = state.reports.count[first]
            nodes, values = state.reports.node[first, :count], state.reports.value[first, :count]
            for node in np.unique(nodes):
                self._take(tracks, state.network.positions[first, node], values[nodes == node], now)
        return np.array([track.state_vector[[0, 2], 0] for track in self._tracks], float)

    def _take(self, tracks: list[Track], place: np.ndarray, values: np.ndarray, now: datetime) -> None:
        model = self._updater.measurement_model
        detections = {Detection(value.reshape(2, 1), timestamp=now, measurement_model=model) for value in values}
        for track in tracks:
            distance_m = np.hypot(*(np.asarray(track.state_vector[[0, 2], 0], float) - place))
            track.metadatas[-1]["chance"] = min(float(detection_probability(distance_m, self._scenario)), 0.999)
        for track, found in self._associator.associate(set(tracks), detections, now).items():
            states, weights = [], []
            for hypothesis in found:
                states.append(hypothesis.prediction if not hypothesis else self._updater.update(hypothesis))
                weights.append(float(hypothesis.probability))
            mean, cov = gm_reduce_single(
                StateVectors([state.state_vector for state in states]),
                np.stack([state.covar for state in states], axis=2),
                np.array(weights),
            )
            track[-1] = GaussianStateUpdate(mean, cov, found, now)
