"""What a detection rule has to say, and the defaults of what it need not."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from wsn_env.compiled import draws
from wsn_env.compiled.elementary import F, log
from wsn_env.models.kinds import Kind, by_kind

if TYPE_CHECKING:
    from wsn_env.models.measurement.base import Measurement
    from wsn_env.scenario import Scenario

LEAST, MOST = 1e-6, 1.0 - 1e-6  # probabilities as a filter takes them: no report rules a particle out
POINT = 1.7320508075688772  # sds: Gauss and Hermite's three points
STEP = 1e-5  # of a radius, for the slope of a probability


@dataclass(frozen=True)
class DetectionRule(Kind):
    """Base of the rules by which nodes detect.

    A kind has `distances_m` and

        probability(d, m, distance) -> probability that a node detects a target at this distance [m]

    `d` holds the rule's constants, `m` those of what nodes measure. The functions after it have defaults.
    """

    abstract: ClassVar[bool] = True
    role: ClassVar[str] = "detection rule"
    required: ClassVar[tuple[str, ...]] = ("probability", "distances_m")
    optional: ClassVar[tuple[str, ...]] = (
        "mean_probability",
        "stream_of",
        "detects",
        "weigh_detection",
        "weigh_silence",
        "information",
        "known_radius",
    )

    values_decide: ClassVar[bool] = False  # whether the measured value decides, so that detecting tells of the value

    @property
    def regular(self) -> bool:
        """Whether p(d) has a derivative everywhere and every period draws anew, as the bound supposes."""
        return False

    def check(self, scenario: Scenario) -> None:
        """Raise ScenarioError where it does not fit the rest of the scenario."""

    def constants(self, scenario: Scenario) -> dict[str, float]:
        """The settings, and the distances."""
        radius_m, reach_m = self.distances_m(scenario.measurement)
        return super().constants(scenario) | {"radius_m": radius_m, "reach_m": reach_m}

    def distances_m(self, measurement: Measurement) -> tuple[float, float]:
        """The sensing radius, and the reach, from where on nothing is detected [m]."""
        raise NotImplementedError

    @staticmethod
    def mean_probability(d: Any, m: Any, dx: float, dy: float, xx: float, xy: float, yy: float) -> float:
        """`probability` averaged over a target believed to be at (dx, dy) from the node with covariance (xx, xy, yy).

        Here by Gauss and Hermite's 3 x 3 points.
        """
        a = np.sqrt(max(xx, 1e-12))
        b = xy / a
        e = np.sqrt(max(yy - b * b, 0.0))
        total = 0.0
        for i in range(-1, 2):
            for j in range(-1, 2):
                weight = (2.0 / 3.0 if i == 0 else 1.0 / 6.0) * (2.0 / 3.0 if j == 0 else 1.0 / 6.0)
                x, y = dx + POINT * a * i, dy + POINT * (b * i + e * j)
                total += weight * probability(d, m, np.sqrt(x * x + y * y))
        return total

    @staticmethod
    def stream_of(d: Any, key: Any, period: int) -> Any:
        """The random numbers that decide who detects in a period."""
        return draws.stream(key, period, draws.DETECTION)

    @staticmethod
    def detects(d: Any, m: Any, stream: Any, node: Any, x: float, y: float) -> bool:
        """Whether a node, if awake, detects a target at (x, y)."""
        dx, dy = node.x - x, node.y - y
        return draws.uniform(stream, node.number) < probability(d, m, np.sqrt(dx * dx + dy * dy))

    @staticmethod
    def known_radius(d: Any, number: int) -> float:
        """The sensing radius of a node as a tracker of binary sensors knows it [m]; here all have the same."""
        return d.radius_m

    @staticmethod
    def weigh_detection(d: Any, m: Any, x: np.ndarray, log_weights: np.ndarray, node: Any) -> None:
        """Add to every particle the log probability that the node, which reported, detects a target there."""
        for i in range(x.shape[1]):
            dx, dy = x[0, i] - F(node.x), x[2, i] - F(node.y)
            p = probability(d, m, np.float64(np.sqrt(dx * dx + dy * dy)))
            log_weights[i] += F(log(min(max(p, LEAST), MOST)))

    @staticmethod
    def weigh_silence(d: Any, m: Any, x: np.ndarray, log_weights: np.ndarray, node: Any, delivery: float) -> None:
        """Add log(1 - delivery p(d)): the node was awake and nothing was heard of it.

        Args:
            delivery: probability that a report of the node arrives.
        """
        for i in range(x.shape[1]):
            dx, dy = x[0, i] - F(node.x), x[2, i] - F(node.y)
            p = probability(d, m, np.float64(np.sqrt(dx * dx + dy * dy)))
            log_weights[i] += F(log(1.0 - delivery * min(max(p, LEAST), MOST)))

    @staticmethod
    def information(d: Any, m: Any, distance: float) -> tuple[float, float]:
        """Fisher information about the target of an awake node's detection or silence, and of its value.

        Returns: the mean of the value's information in units of its H' R^-1 H; and along the line of sight [1/m^2] the
            information of whether it detects. Here p and p'^2 / (p (1 - p)).
        """
        p, step = probability(d, m, distance), min(STEP * d.radius_m, 0.5 * distance)
        change = probability(d, m, distance + step) - probability(d, m, distance - step)
        if change == 0.0 or p <= 0.0 or p >= 1.0:
            return p, 0.0
        return p, (0.5 * change / step) ** 2 / (p * (1.0 - p))


@by_kind
def probability(d: Any, m: Any, distance: float) -> Any:
    """Probability that a node detects a target at this distance [m]."""


mean_probability: Any = by_kind(DetectionRule.mean_probability)
stream_of: Any = by_kind(DetectionRule.stream_of)
detects: Any = by_kind(DetectionRule.detects)
known_radius: Any = by_kind(DetectionRule.known_radius)
weigh_detection: Any = by_kind(DetectionRule.weigh_detection)
weigh_silence: Any = by_kind(DetectionRule.weigh_silence)
information: Any = by_kind(DetectionRule.information)
