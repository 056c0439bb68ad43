"""Detection within a hard disc whose radius is each node's own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from numba import uint64

from wsn_env.compiled import draws
from wsn_env.compiled.kernels import lean_piece
from wsn_env.models.detection.base import DetectionRule
from wsn_env.models.quantity import ScenarioError, quantity

if TYPE_CHECKING:
    from wsn_env.models.measurement.base import Measurement
    from wsn_env.scenario import Scenario

NARROWEST = 1e-9  # of a spread, which is divided by


@dataclass(frozen=True)
class UnequalRadii(DetectionRule):
    """A node detects within a radius of its own, uniform in r (1 -+ s); node i has the same one in every episode.

        p(d) = min(1, max(0, (r (1 + s) - d) / (2 r s)))

    is what is known of a node whose radius is not.
    """

    radius_m: float = quantity(10.0, "mean sensing radius r", above=0, at_most=100_000)
    radius_spread: float = quantity(0.1, "s: half width of the nodes' radii, in mean radii", at_least=0, below=1)
    radii_known: bool = quantity(
        False,
        "whether trackers of binary sensors know each node's radius; else they take the mean",
        choices=(True, False),
    )

    allocates: ClassVar[bool] = False

    def check(self, scenario: Scenario) -> None:
        """Only what reads states makes use of radii."""
        if self.radii_known and not scenario.measurement.reports_state:
            raise ScenarioError(
                f"UnequalRadii.radii_known = True: allowed is False with {type(scenario.measurement).__name__} reports,"
                " whose trackers make no use of it"
            )

    def distances_m(self, measurement: Measurement) -> tuple[float, float]:
        """The mean radius and the largest."""
        return self.radius_m, (1 + self.radius_spread) * self.radius_m

    @staticmethod
    def probability(d: Any, m: Any, distance: float) -> float:
        width = max(d.radius_spread, NARROWEST) * d.radius_m
        return min(1.0, max(0.0, (d.radius_m + width - distance) / (2.0 * width)))

    @staticmethod
    def detects(d: Any, m: Any, stream: Any, node: Any, x: float, y: float) -> bool:
        dx, dy, radius = node.x - x, node.y - y, own_radius(d, node.number)
        return dx * dx + dy * dy <= radius * radius

    @staticmethod
    def known_radius(d: Any, number: int) -> float:
        return own_radius(d, number) if d.radii_known != 0 else d.radius_m


@lean_piece
def own_radius(d: Any, number: int) -> float:
    """The sensing radius of a node [m]."""
    u = draws.uniform(draws.stream(uint64(0), 0, draws.RADIUS), number)
    return d.radius_m * (1.0 + d.radius_spread * (2.0 * u - 1.0))
