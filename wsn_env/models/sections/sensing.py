"""What nodes detect and what they measure."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from wsn_env.models.physics.acoustics import absorption_db_per_km
from wsn_env.models.quantity import ScenarioError, Section, quantity


@dataclass(frozen=True)
class Detection(Section):
    """Probability of detection against distance (eqs. 2-3)."""

    code: ClassVar[int] = 0
    radius_m: float = quantity(10.0, "sensing radius r_s", above=0)
    softness: float = quantity(0.2, "delta: half width of the soft edge, in radii", above=0, at_most=1)
    decay: float = quantity(1.0, "lambda1", at_least=0)
    ceiling: float = quantity(0.6, "lambda2: probability well inside the radius", above=0, at_most=1)
    decay_power: float = quantity(3.0, "beta1", above=0)
    edge_power: float = quantity(2.0, "beta2", above=0)

    @property
    def reach_m(self) -> float:
        """From here on a node detects nothing."""
        return (1 + self.softness) * self.radius_m

    def distance_m(self, share: float) -> float:
        """Where the probability falls to a share of its ceiling (eqs. 2-3 the other way round)."""
        inner, wanted = (1 - self.softness) * self.radius_m, -math.log(share) / max(self.decay, 1e-12)
        near, far = inner, self.reach_m
        for _ in range(60):  # bisection to the last bit
            middle = (near + far) / 2
            a1, a2 = middle - inner, self.reach_m - middle
            near, far = (middle, far) if a1**self.decay_power < wanted * a2**self.edge_power else (near, middle)
        return far

    def distances_m(self, measurement: Measurement) -> tuple[float, float]:
        """Sensing radius and reach, whatever is measured."""
        return self.radius_m, self.reach_m


@dataclass(frozen=True)
class Threshold(Section):
    """A node detects when the strength that it measures exceeds a threshold; it reports that very measurement.

        p(d) = Phi((h(d) - threshold) / sigma)

    with the mean level h and its noise sd sigma. Needs a level in dB.
    """

    code: ClassVar[int] = 1
    threshold_db: float = quantity(85.0, "weakest level that counts")

    def check(self, measurement: Measurement) -> None:
        """Raise ScenarioError unless the mean level falls to the threshold somewhere."""
        if not isinstance(measurement, Level):
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
        self.check(measurement)
        weakest = self.threshold_db - LEAST_SDS * measurement.noise_db
        return measurement.distance_m(self.threshold_db), measurement.distance_m(weakest)


LEAST_SDS = 4.753424308822899  # Phi(-this) = 1e-6
DETECTIONS = {"radius": Detection, "threshold": Threshold}


@dataclass(frozen=True)
class Measurement(Section):
    """Base of what a detecting node measures."""

    code: ClassVar[int]


@dataclass(frozen=True)
class Position(Measurement):
    """Its own noisy position of the target (eq. 7)."""

    code: ClassVar[int] = 0
    noise_m: float = quantity(2.0, "sd of each coordinate", above=0)


FARTHEST_M = 1e7  # as far as a mean level is followed


class Level(Measurement):
    """Base of strengths in dB, with the mean level

        h(d) = level at 1 m - 10 n log10(d) - absorption d,    d at least `floor_m`

    and Gaussian noise of sd `noise_db`.
    """

    exponent: float
    noise_db: float
    floor_m: float
    absorption_db_per_m: ClassVar[float] = 0.0

    @property
    def at_1m_db(self) -> float:
        """The first term."""
        raise NotImplementedError

    def mean_db(self, distance_m: float) -> float:
        """h(d)."""
        d = max(distance_m, self.floor_m)
        return self.at_1m_db - 10 * self.exponent * math.log10(d) - self.absorption_db_per_m * d

    def distance_m(self, level_db: float) -> float:
        """Where the mean level falls to this one, by bisection; 0: nowhere so high; FARTHEST_M: not before there."""
        if self.mean_db(self.floor_m) <= level_db:
            return 0.0
        near, far = self.floor_m, max(FARTHEST_M, self.floor_m)
        for _ in range(200):
            middle = math.sqrt(near * far)
            near, far = (middle, far) if self.mean_db(middle) > level_db else (near, middle)
        return far


@dataclass(frozen=True)
class Rssi(Level):
    """Received strength in dB: reference - 10 n log10(max(d, floor)) + noise (eq. 1 in its log-distance form)."""

    code: ClassVar[int] = 1
    reference_dbm: float = quantity(-40.0, "level at 1 m")
    exponent: float = quantity(2.5, "path loss exponent n", above=0)
    noise_db: float = quantity(3.0, "sd", above=0)
    floor_m: float = quantity(1.0, "nearer than this the level grows no more", above=0)

    @property
    def at_1m_db(self) -> float:
        """The reference."""
        return self.reference_dbm


@dataclass(frozen=True)
class Sonar(Level):
    """Received level of a sound in the sea: source - 10 k log10(d) - alpha(f) d + noise, d at least `floor_m`.

    Urick's passive sonar equation with Thorp's absorption; k = 1 is cylindrical spreading, 2 spherical, 1.5 the
    customary middle. The source's 120 dB are an assumption of ours.
    """

    code: ClassVar[int] = 3
    source_db: float = quantity(120.0, "source level at 1 m, dB re 1 uPa")
    spreading: float = quantity(1.5, "k", above=0)
    frequency_khz: float = quantity(10.0, "f", at_least=0.4, at_most=1000)
    noise_db: float = quantity(3.0, "sd of a measured level", above=0)
    floor_m: float = quantity(1.0, "nearer than this the level grows no more", above=0)

    @property
    def at_1m_db(self) -> float:
        """The source level."""
        return self.source_db

    @property
    def exponent(self) -> float:
        """k, by the name that it has on land."""
        return self.spreading

    @property
    def absorption_db_per_m(self) -> float:
        """alpha(f)."""
        return absorption_db_per_km(self.frequency_khz) / 1000


@dataclass(frozen=True)
class RssiPower(Measurement):
    """Received power: a max(d, floor)^-beta + noise (eq. 1 as printed, 2 <= beta <= 4)."""

    code: ClassVar[int] = 2
    amplitude: float = quantity(100.0, "power a at 1 m, in any unit", above=0)
    exponent: float = quantity(2.0, "beta", at_least=2, at_most=4)
    noise: float = quantity(0.2, "sd, in the same unit", above=0)
    floor_m: float = quantity(1.0, "nearer than this the power grows no more", above=0)


@dataclass(frozen=True)
class Binary(Measurement):
    """One bit: whether the node detects (Zhou, Cheng & Xing, 2009); a hard disc where detection has no soft edge.

    A node compares with what it sensed last, however long ago, and reports the new state when it differs; before it has
    ever sensed, that is 0.
    """

    code: ClassVar[int] = 4
    reports: str = quantity(
        "changes",
        "changes: a state that differs from the last one sensed; presence: every 1, in every period",
        choices=("changes", "presence"),
    )
    refresh: int = quantity(
        0,
        "in every so many periods all awake nodes report their state; 0: never",
        at_least=0,
        at_most=10**9,
        whole=True,
    )
    flip: float = quantity(0.0, "probability that a node misreads its state in a period", at_least=0, below=0.5)
    edge_m: float = quantity(1.0, "width of the edge of detection that the particle filter believes in", above=0)
