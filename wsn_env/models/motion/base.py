"""What a motion has to say."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from wsn_env.compiled.elementary import HALF_PI, sincos
from wsn_env.compiled.kernels import lean_piece, piece
from wsn_env.models.kinds import Kind, by_kind
from wsn_env.models.quantity import ScenarioError

if TYPE_CHECKING:
    from wsn_env.models.measurement.base import Measurement
    from wsn_env.scenario import Scenario

FASTEST_MS, FARTHEST_M = 1e6, 1e6  # of settings: squares of what they lead to stay float32


class Course(NamedTuple):
    """Where and when a track is drawn."""

    period_s: float
    side_m: float  # extent of the field along x
    depth_m: float  # along y
    recorded: np.ndarray  # (N, periods + 1, 4): the motion's `recorded_tracks`
    bounded: bool  # the motion's, unless episodes end outside the field: False: the target may leave it


@dataclass(frozen=True)
class Motion(Kind):
    """Base of all motions. A track does not depend on what the network does, so it is drawn at an episode's start.

    A kind has `fitting_q`, the filter's process noise that suits its tracks [m/s^2], and

        draw(m, stream, course, track)
            Fill `track` (periods + 1, 4) with the true states (x, vx, y, vy) [m, m/s]. Random numbers are draws of
            `stream` by their numbers; `m` holds the motion's constants. What leaves the field is reflected after it,
            unless the kind says `bounded = False`.
    """

    abstract: ClassVar[bool] = True
    role: ClassVar[str] = "motion"
    required: ClassVar[tuple[str, ...]] = ("draw",)
    optional: ClassVar[tuple[str, ...]] = ()

    fitting_q: ClassVar[float]
    bounded: ClassVar[bool] = True  # False: a track may leave the field

    @property
    def process_noise_ms2(self) -> float | None:
        """sd of the track's own white acceleration; None: it has none, and turns as it likes."""
        return None

    @property
    def start_sds(self) -> tuple[float, float] | None:
        """sds of a normal start about the field's middle and of its velocity [m, m/s]; None: it is another."""
        return None

    def check(self, scenario: Scenario) -> None:
        """Raise ScenarioError where field or horizon leave it no room; asked when a world is made."""

    def check_measurement(self, measurement: Measurement) -> None:
        """Raise ScenarioError where nodes must measure something else; asked when a scenario is made."""

    def horizon(self, period_s: float) -> int | None:
        """How many periods it lasts; None: as many as one likes."""
        return None

    def recorded_tracks(self, scenario: Scenario) -> np.ndarray:
        """(N, periods + 1, 4) tracks that are known beforehand."""
        return np.zeros((0, scenario.periods + 1, 4))

    def recorded_packets(self, scenario: Scenario) -> np.ndarray:
        """(periods + 1, S, 2) packets that were recorded with the track; (0, 0, 2): none."""
        return np.zeros((0, 0, 2), np.float32)

    def _limit(self, name: str, allowed: str) -> ScenarioError:
        return ScenarioError(f"{type(self).__name__}.{name} = {getattr(self, name)}: must be {allowed}")


@by_kind
def draw(m: Any, stream: Any, course: Any, track: np.ndarray) -> Any:
    """Fill `track` (periods + 1, 4) with the true states."""


@piece
def reflect(state: Any, axis: int, side_m: float) -> None:
    """Fold a coordinate back into [0, side], as a mirror at the border would."""
    x = state[axis] - 2.0 * side_m * np.floor(state[axis] / (2.0 * side_m))
    if x > side_m:
        x = 2.0 * side_m - x
        state[axis + 1] = -state[axis + 1]
    state[axis] = min(max(x, 0.0), side_m)


@piece
def heading_of(s: float, c: Any) -> float:
    """The angle in (-pi, pi] of a unit vector, by Newton's steps from the octant (no libm)."""
    angle = 0.0
    if c < 0.0:
        angle = 2.0 * HALF_PI if s >= 0.0 else -2.0 * HALF_PI
    if abs(s) > abs(c):
        angle = HALF_PI if s >= 0.0 else -HALF_PI
    for _ in range(6):
        si, co = sincos(angle)
        angle += s * co - c * si
    return angle


@lean_piece
def set_state(state: Any, x: float, vx: float, y: float, vy: float) -> None:
    """Write a true state (4,)."""
    state[0], state[1], state[2], state[3] = x, vx, y, vy
