"""Detection by a threshold on the measured level."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from wsn_env.compiled import draws
from wsn_env.compiled.elementary import HALF_PI, F, exp, exp32, log32, log_normal_cdf32, normal_cdf
from wsn_env.models.detection.base import DetectionRule
from wsn_env.models.detection.radius import cube_root
from wsn_env.models.measurement.base import level, level_slope, sample
from wsn_env.models.measurement.level import FARTHEST_M
from wsn_env.models.quantity import ScenarioError, quantity

if TYPE_CHECKING:
    from wsn_env.models.measurement.base import Measurement
    from wsn_env.scenario import Scenario

LEAST_SDS = 4.753424308822899  # Phi(-this) = 1e-6


@dataclass(frozen=True)
class Threshold(DetectionRule):
    """A node detects when the strength that it measures exceeds a threshold; it reports that very measurement.

        p(d) = Phi((h(d) - threshold) / sigma)       where that is at least 1e-6; 0 beyond

    with the mean level h and its noise sd sigma. Needs a level in dB.
    """

    threshold_db: float = quantity(85.0, "weakest level that counts")

    allocates: ClassVar[bool] = False
    values_decide: ClassVar[bool] = True

    @property
    def regular(self) -> bool:
        """The level's noise makes it so."""
        return True

    def check(self, scenario: Scenario) -> None:
        """Raise ScenarioError unless the mean level falls to the threshold somewhere."""
        self._check_levels(scenario.measurement)

    def _check_levels(self, measurement) -> None:
        if not hasattr(measurement, "mean_db"):
            raise ScenarioError(
                f"Scenario.detection = {self}: needs a measured level in dB, so that the measurement must be a Rssi or"
                f" Sonar; it is a {type(measurement).__name__}"
            )
        low, high = (measurement.mean_db(d) for d in (FARTHEST_M, 0.0))
        if not low < self.threshold_db < high:
            raise ScenarioError(
                f"Threshold.threshold_db = {self.threshold_db}: must be between the mean levels at {FARTHEST_M:g} m and"
                f" at the source, {low:.4g} and {high:.4g} dB"
            )

    def distances_m(self, measurement: Measurement) -> tuple[float, float]:
        """Sensing radius, where the mean level is at the threshold, and reach, where p falls to 1e-6 (taken as 0)."""
        self._check_levels(measurement)
        levels: Any = measurement
        weakest = self.threshold_db - LEAST_SDS * levels.noise_db
        return levels.distance_m(self.threshold_db), levels.distance_m(weakest)

    @staticmethod
    def probability(d: Any, m: Any, distance: float) -> float:
        if distance >= d.reach_m:
            return 0.0
        return normal_cdf((level(m, distance * distance) - d.threshold_db) / m.noise)

    @staticmethod
    def mean_probability(d: Any, m: Any, dx: float, dy: float, xx: float, xy: float, yy: float) -> float:
        """The mean level is taken for a straight line over the cube root of the squared distance, which is nearly
        normal; so the mean has a closed form."""
        root, mean, variance = cube_root(dx, dy, xx, xy, yy)
        likely = mean * mean * mean
        sds = (level(m, likely) - d.threshold_db) / m.noise
        steepness = 1.5 * mean * mean * level_slope(m, likely) / m.noise
        return normal_cdf(sds / np.sqrt(1.0 + steepness * steepness * root * root * variance))

    @staticmethod
    def information(d: Any, m: Any, distance: float) -> tuple[float, float]:
        """Of a normal level that is known above the threshold, and below it only that it is below.

        1 - Phi(a) + a phi(a) + phi(a)^2 / Phi(a),   a = (threshold - h(d)) / sigma
        """
        a = (d.threshold_db - level(m, distance * distance)) / m.noise
        below, density = normal_cdf(a), exp(-0.5 * a * a) / np.sqrt(4.0 * HALF_PI)
        return max(1.0 - below + a * density + (density * density / below if below > 0.0 else 0.0), 0.0), 0.0

    @staticmethod
    def stream_of(d: Any, key: Any, period: int) -> Any:
        return draws.stream(key, period, draws.MEASUREMENT)  # what decides is the measurement itself

    @staticmethod
    def detects(d: Any, m: Any, stream: Any, node: Any, x: float, y: float) -> bool:
        return sample(m, stream, node, x, y)[0] > d.threshold_db

    @staticmethod
    def weigh_detection(d: Any, m: Any, x: np.ndarray, log_weights: np.ndarray, node: Any) -> None:
        """A report's value tells all; that it came adds nothing."""

    @staticmethod
    def weigh_silence(d: Any, m: Any, x: np.ndarray, log_weights: np.ndarray, node: Any, delivery: float) -> None:
        """Add the log probability that nothing was heard of the awake node.

        ln Phi((threshold - h(d)) / sigma)               delivery = 1: the level was below the threshold
        ln(1 - delivery + delivery Phi(...))             else: or the report was lost
        """
        px, py = x[0], x[2]
        sx, sy = F(node.x), F(node.y)
        per_sd = 1.0 / max(m.noise, 1e-10)
        below = F((d.threshold_db - m.at_1m) * per_sd)
        slope, absorption, floor = F(m.slope * per_sd), F(m.absorption * per_sd), F(max(m.floor_m * m.floor_m, 1e-12))
        sent, lost = F(delivery), F(1.0 - delivery)
        for i in range(x.shape[1]):
            dx = px[i] - sx
            dy = py[i] - sy
            near = max(dx * dx + dy * dy, floor)
            quiet = log_normal_cdf32(below + (slope * log32(near) + absorption * np.sqrt(near)))
            if lost > F(0):
                quiet = log32(min(lost + sent * exp32(quiet), F(1)))
            log_weights[i] += quiet
