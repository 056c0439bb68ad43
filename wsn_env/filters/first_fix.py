"""A Gaussian filter that begins with a fix: `start="fix"`."""

from dataclasses import replace

import numpy as np

from wsn_env.filters.grnn import GRNNTracker
from wsn_env.filters.snapshot import SnapshotTracker
from wsn_env.models.field import fixed_positions
from wsn_env.models.state import Belief, Network, Reports, Tracker
from wsn_env.scenario import Scenario
from wsn_env.scenario.tracking import reads


class FirstFix:
    """A tracker whose beliefs, while they are as wide as the field, are not corrected but made anew from a fix.

    Linearising strengths over the whole field may send a filter anywhere. The fix is the fingerprint network's, at
    rest, where nodes measure strengths and stand in the same places in every episode; else the mean of the reported
    positions, or of the reporting nodes' own, as after a search. A belief as wide as the field is one of which no
    report has been heard yet, so that no other memory is needed.
    """

    particles = 0

    def __init__(self, tracker: Tracker, scenario: Scenario) -> None:
        mapped = reads("grnn", scenario.measurement) and fixed_positions(scenario.field) is not None
        self._tracker = tracker
        self._fixer = GRNNTracker(scenario) if mapped else SnapshotTracker(scenario)
        self._whole_m2 = 0.999 * scenario.field.side_m**2 / 12  # of a uniform coordinate, but for rounding
        self._rest_m2s2 = scenario.tracking.rest_sd_ms**2

    def start(self, keys: np.ndarray, periods: np.ndarray, rows: np.ndarray, belief: Belief) -> None:
        """As the tracker does."""
        self._tracker.start(keys, periods, rows, belief)

    def relocate(self, keys: np.ndarray, periods: np.ndarray, rows: np.ndarray, belief: Belief) -> None:
        """As the tracker does."""
        self._tracker.relocate(keys, periods, rows, belief)

    def correct(
        self,
        keys: np.ndarray,
        periods: np.ndarray,
        belief: Belief,
        network: Network,
        reports: Reports,
        resampled: np.ndarray,
    ) -> None:
        """Predict and correct, or begin, every row in place."""
        first = (belief.cov[:, [0, 2], [0, 2]] > self._whole_m2).all(axis=1) & (reports.count > 0)
        self._tracker.correct(keys, periods, belief, network, reports, resampled)
        if first.any():
            fix = replace(belief, row=belief.row.copy())
            self._fixer.correct(keys, periods, fix, network, reports, resampled)
            fix.cov[:, [1, 3], [1, 3]] = self._rest_m2s2
            belief.mean[first], belief.cov[first] = fix.mean[first], fix.cov[first]
