"""How the target is tracked: the filter, its start, the search rule; every tracker by name, and what it can read."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, Literal

from wsn_env.models.library import MEASUREMENTS
from wsn_env.models.measurement.base import Measurement
from wsn_env.models.quantity import ScenarioError, Section, quantity

if TYPE_CHECKING:
    from wsn_env.scenario.scenario import Scenario

BOUNDARY_TRACKERS = ("boundary_raw", "boundary", "boundary_mid", "boundary_ekf", "centroid", "centroid_rls")
TRACKERS = {  # name: where the class stands
    "particle": "wsn_env.filters.particle:ParticleTracker",
    "ekf": "wsn_env.filters.kalman:EKFTracker",
    "snapshot": "wsn_env.filters.snapshot:SnapshotTracker",
    "ukf": "wsn_env.filters.kalman:UKFTracker",
    "ckf": "wsn_env.filters.cubature:CKFTracker",
    "ickf": "wsn_env.filters.cubature:ICKFTracker",
    "trilateration": "wsn_env.filters.trilateration:TrilaterationTracker",
    "nonlinear_ls": "wsn_env.filters.trilateration:NonlinearLSTracker",
    "grnn": "wsn_env.filters.grnn:GRNNTracker",
    "grnn_kf": "wsn_env.filters.grnn:GRNNKalmanTracker",
    **dict.fromkeys(BOUNDARY_TRACKERS, "wsn_env.filters.boundary:BoundaryTracker"),
}
ROBUST = ("gate_sds", "outlier_share", "node_sd_m")  # what reckons with wrong reports
PARTICLE_ONLY = ("silent_information", *ROBUST, "resampling", "redraw_on_handover", "velocity_s")
STRENGTHS = ("grnn", "grnn_kf")  # trackers that read values of one number
RANGES = ("trilateration", "nonlinear_ls")  # that turn a value into a distance


def reads(tracker: str, measurement: Measurement) -> bool:
    """Whether a tracker can read what a measurement's nodes report."""
    if tracker == "particle":
        return True
    if tracker in BOUNDARY_TRACKERS:
        return measurement.reports_state
    if tracker in STRENGTHS:
        return measurement.independent and hasattr(measurement, "fingerprint_unit")
    if tracker in RANGES:
        return measurement.independent and hasattr(measurement, "squared_ranges")
    return measurement.independent


@dataclass(frozen=True)
class Tracking(Section):
    """The filter at the head, and the search rule for lost tracks.

    An episode's first belief, `start`: "known" is N(truth, P0); "search" is what a search in period 0 finds; "field" is
    the whole field with the target at rest; "fix" is the same, but a Gaussian filter (ekf, ukf, ckf, ickf, grnn_kf)
    does not correct it: it begins with a fix of the first reports (see trackers/first_fix.py).
    """

    tracker: str = quantity("particle", " | ".join(TRACKERS), choices=tuple(TRACKERS))
    particles: int = quantity(5000, "number of particles P", at_least=2, at_most=1_000_000, whole=True)
    fusion: Literal["joint", "pooled"] = quantity(
        "joint", "joint (members send z) or pooled (eqs. 9-15)", choices=("joint", "pooled")
    )
    silent_information: bool = quantity(
        False,
        "weigh with who reported and who kept silent, too (particle only)",
        choices=(True, False),
    )
    gate_sds: float | None = quantity(
        None,
        "refuse a report that is off the prediction by more than so many sds in any number; None: use all (particle"
        " only)",
        above=0,
        at_most=1e9,
        optional=True,
    )
    outlier_share: float = quantity(
        0.0,
        "probability that a report is of something else, as the likelihood reckons with (particle only)",
        at_least=0,
        below=1,
    )
    node_sd_m: float = quantity(
        0.0,
        "sd of a node's position in x and in y, as the likelihood reckons with (particle only)",
        at_least=0,
        at_most=1e6,
    )
    resample_below: float = quantity(
        2 / 3, "resample at N_eff below this share of P (eq. 14); 1: always", at_least=0, at_most=1
    )
    resampling: Literal["systematic", "spread", "common_spread"] = quantity(
        "systematic",
        "systematic: copies of the chosen; spread: further copies lie about them in pairs, along a direction of each"
        " parent's own; common_spread: along one direction for all, the sds of the cloud",
        choices=("systematic", "spread", "common_spread"),
    )
    spread_scale: float = quantity(
        0.5, "(common_)spread: distance of the first pair, in sds of the cloud", at_least=0, at_most=10
    )
    redraw_on_handover: bool = quantity(
        False,
        "the new head draws its particles from the mean and covariance handed over (particle only)",
        choices=(True, False),
    )
    filter_q: float | None = quantity(
        None,
        "sd of the filter's acceleration noise [m/s^2] throughout; None: manoeuvre_q's modes, and where there are none"
        " what suits the motion",
        at_least=0,
        at_most=1000,
        optional=True,
    )
    manoeuvre_q: float | None = quantity(
        0.6,
        "the filter's target switches between modes of motion, from quiet to manoeuvring with acceleration noise of"
        " this sd [m/s^2], so that the filter finds out how it moves; None, or filter_q or velocity_s given, or another"
        " tracker: no modes (particle only)",
        above=0,
        at_most=1000,
        optional=True,
    )
    velocity_s: float | None = quantity(
        None,
        "the filter's target walks in the room: its velocity is an Ornstein-Uhlenbeck process of sd rest_sd_ms and this"
        " time constant, reflected at the walls; None: white acceleration of filter_q anywhere (particle only)",
        above=0,
        at_most=1e9,
        optional=True,
    )
    gate_m: float | None = quantity(
        None,
        "boundary trackers refuse what is off the prediction by more than this and three sds; None: nothing",
        above=0,
        at_most=1e9,
        optional=True,
    )
    start: Literal["known", "search", "field", "fix"] = quantity(
        "known",
        "known: mean ~ N(truth, P0); search: from a search; field: anywhere; fix: from a fix of the first reports",
        choices=("known", "search", "field", "fix"),
    )
    start_sd_m: float = quantity(1.0, "position sd of P0", above=0, at_most=100_000)
    start_sd_ms: float = quantity(0.1, "velocity sd of P0", above=0, at_most=1000)
    rest_sd_ms: float = quantity(
        1.0, "velocity sd of a target of which none is known yet (starts other than known)", above=0, at_most=1000
    )
    search: bool = quantity(True, "search for lost tracks", choices=(True, False))
    search_miss: float = quantity(1e-3, "search when missing so long was less probable", above=0, at_most=1)
    search_gap: int = quantity(5, "periods between searches, at least", at_least=1, at_most=10**9, whole=True)
    width_search: Literal["golden", "foa"] = quantity(
        "golden", "how a fingerprint network's width is found: golden section or fruit flies", choices=("golden", "foa")
    )
    training_seed: int = quantity(
        0, "seed of a fingerprint network's training, apart from every episode's", at_least=0, whole=True
    )

    @property
    def robust(self) -> bool:
        """Whether the likelihood reckons with wrong reports."""
        return self.gate_sds is not None or self.outlier_share > 0 or self.node_sd_m > 0

    @property
    def switches(self) -> bool:
        """Whether the filter finds out how the target moves: nothing else was said of its motion."""
        told = self.filter_q is not None or self.velocity_s is not None
        return self.tracker == "particle" and self.manoeuvre_q is not None and not told

    def check(self, scenario: Scenario) -> None:
        """Raise ScenarioError where it does not fit the rest of the scenario."""
        self._check_tracker(scenario.measurement)
        self._check_robust(scenario.measurement)

    def _check_tracker(self, measurement: Measurement) -> None:
        name = self.tracker
        if not reads(name, measurement):
            kinds: dict[str, Any] = dict(MEASUREMENTS.kinds)
            able = [known for known, its_kind in kinds.items() if reads(name, its_kind())]
            allowed = "allowed are the measurements" if len(able) > 1 else "allowed is the measurement"
            kind = type(measurement).__name__
            raise ScenarioError(
                f"Tracking.tracker = {name!r}: cannot read {kind} reports; {allowed} {' and '.join(able)}"
            )
        if name in BOUNDARY_TRACKERS and not name.startswith("centroid"):
            reports = getattr(measurement, "reports", "changes")
            if reports != "changes":
                raise ScenarioError(f"Binary.reports = {reports!r}: allowed is 'changes' with the tracker {name!r}")
        of_others = () if name == "particle" else PARTICLE_ONLY
        idle = of_others if name in BOUNDARY_TRACKERS else (*of_others, "gate_m")
        usual = {item.name: item.default for item in fields(self)}
        wrong = [item for item in idle if getattr(self, item) != usual[item]]
        if wrong:
            given = ", ".join(f"Tracking.{item} = {getattr(self, item)!r}" for item in wrong)
            allowed = ", ".join(repr(usual[item]) for item in wrong)
            raise ScenarioError(f"{given}: allowed is {allowed} with the tracker {name!r}, which makes no use of it")

    def _check_robust(self, measurement: Measurement) -> None:
        """What reckons with wrong reports weighs them one by one; a gate leaves some out."""
        if self.robust and type(measurement).weigh_period is not Measurement.weigh_period:
            given, kind = (f"Tracking.{name} = {getattr(self, name)}" for name in ROBUST), type(measurement).__name__
            raise ScenarioError(f"{', '.join(given)}: allowed is None, 0, 0 with {kind}, which weighs a period at once")
        for name, needed in (("fusion", "joint"), ("silent_information", False)):
            if self.gate_sds is not None and getattr(self, name) != needed:
                raise ScenarioError(
                    f"Tracking.{name} = {getattr(self, name)!r}: allowed is {needed!r} with gate_sds, which leaves"
                    " reports out"
                )
