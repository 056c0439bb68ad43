"""The network, the path and the methods of the fingerprint system as trials, and everything that is played for it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from wsn_env.evaluation.progress import Progress
from wsn_env.filters.linear import LinearModel
from wsn_env.models.detection.radius import Detection
from wsn_env.models.field import fixed_positions
from wsn_env.models.measurement.rssi import Rssi
from wsn_env.models.motion.legs import Legs
from wsn_env.papers.rollout import Record, Trial, play_all
from wsn_env.scenario import Scenario
from wsn_env.scenario.presets.Anchors_v0 import RING_OF_EIGHT
from wsn_env.simulation.world import World

PERIODS_S = (0.1, 0.2, 0.5, 1.0)
METHODS = {  # tracker: what it is called
    "trilateration": "least squares (eq. 9)",
    "nonlinear_ls": "nonlinear least squares",
    "grnn": "GRNN",
    "grnn_kf": "GRNN + KF",
    "ekf": "EKF",
    "ukf": "UKF",
    "ckf": "CKF",
    "ickf": "ICKF",
}
FILTERS = ("grnn_kf", "ekf", "ukf", "ckf", "ickf")
EQUAL_INFORMATION = ("grnn_kf", "ckf", "ickf")
STARTED, STARTS = ("ekf", "ckf", "ickf"), ("field", "fix")  # filters compared over starts
_CORNERS = ((0.0, 0.0), (200.0, 0.0), (0.0, 200.0), (200.0, 200.0))
ANCHORS: dict[str, tuple[tuple[float, float], ...]] = {
    "ring8": RING_OF_EIGHT,
    "mix8": _CORNERS + ((60.0, 60.0), (140.0, 60.0), (60.0, 140.0), (140.0, 140.0)),
}
PATH = Legs(start_m=(20.0, 15.0), legs=((12.5, 10, 5), (12.5, 2, 6), (12.5, -8, 2), (12.5, -3, -9)))
LENGTH_S, POOR_START_S = 50.0, 5.0
DENSITY = 3.0  # m^2/s^3, the filters' white acceleration
NOISE_DB, PRECISE_DB = 3.0, 0.5
COMPARED_S, PARTICLES = 0.5, 20_000


def scenario_as_read(tracker: str, period_s: float = 0.5, noise_db: float = NOISE_DB, **changes: object) -> Scenario:
    """The system in our reading: every anchor hears the target everywhere, and filters begin with a fix."""
    reading = dict(
        positions=ANCHORS["ring8"],
        side_m=200.0,
        measurement=Rssi(reference_dbm=-40.0, exponent=3.0, noise_db=noise_db, floor_m=1.0),
        detection=Detection(radius_m=360.0, ceiling=1.0),
        motion=PATH,
        period_s=period_s,
        periods=round(LENGTH_S / period_s),
        battery_j=1e6,  # energy is not this system's concern
        tracker=tracker,
        filter_q=(DENSITY / period_s) ** 0.5,
        start="fix",
        rest_sd_ms=10.0,
        search=False,
        particles=2,  # of no use here
    )
    return Scenario.named("PreDC-v0", **(reading | changes))


def method_trial(method: str, period_s: float, runs: int) -> Trial:
    """A method of the main table."""
    return Trial("all", scenario_as_read(method, period_s), runs)


def equal_information_trial(method: str, period_s: float, runs: int) -> Trial:
    """The noise of a strength grows with the rate of sampling, so that a second tells as much at any period."""
    return Trial("all", scenario_as_read(method, period_s, noise_db=period_s**-0.5), runs)


def start_trial(method: str, anchors: str, start: str, runs: int) -> Trial:
    """The first seconds with precise strengths, from the middle of the field or from a fix."""
    periods = round(POOR_START_S / 0.5)
    scenario = scenario_as_read(method, noise_db=PRECISE_DB, positions=ANCHORS[anchors], start=start, periods=periods)
    return Trial("all", scenario, runs)


def unaided_trial(period_s: float, runs: int) -> Trial:
    """ICKF alone: on the strengths, from the middle of the field and at rest, without the network's fix."""
    return Trial("all", scenario_as_read("ickf", period_s, start="field"), runs)


def particle_trial(runs: int) -> Trial:
    """A particle filter on the strengths, from anywhere in the field."""
    return Trial("all", scenario_as_read("particle", COMPARED_S, start="field", particles=PARTICLES), runs)


def track(period_s: float) -> np.ndarray:
    """(K + 1, 4) true states of a run's start and periods."""
    return World(scenario_as_read("snapshot", period_s), threads=1).reset([0]).track[0]


def cramer_rao_bound(anchors: str, points: np.ndarray, noise_db: float = NOISE_DB) -> np.ndarray:
    """Least error of an unbiased estimate from one period's strengths, sqrt(trace(J^-1)), J = sum of s s' / sd^2.

    Args:
        points: (K, 2) m; s are the strengths' slopes there.

    Returns: (K,) m.
    """
    scenario = scenario_as_read("snapshot", positions=ANCHORS[anchors])
    slopes = LinearModel(scenario).slopes(points, np.asarray(fixed_positions(scenario.field)))
    slopes = slopes / noise_db
    information = np.swapaxes(slopes, -1, -2) @ slopes
    return np.sqrt(np.trace(np.linalg.inv(information), axis1=-2, axis2=-1))


@dataclass(frozen=True, eq=False)
class Results:
    """Everything that was played."""

    runs: int
    records: dict[Trial, Record]

    def method(self, method: str, period_s: float) -> Record:
        """A method of the main table."""
        return self.records[method_trial(method, period_s, self.runs)]

    def equal_information(self, method: str, period_s: float) -> Record:
        """The same at an equal information rate."""
        return self.records[equal_information_trial(method, period_s, self.runs)]

    def start(self, method: str, anchors: str, start: str) -> Record:
        """The first seconds."""
        return self.records[start_trial(method, anchors, start, self.runs)]

    def unaided(self, period_s: float) -> Record:
        """ICKF from the middle of the field."""
        return self.records[unaided_trial(period_s, self.runs)]

    @property
    def particle(self) -> Record:
        """The particle filter."""
        return self.records[particle_trial(self.runs)]

    @cached_property
    def bound_m(self) -> dict[str, float]:
        """Root mean square of the static Cramer-Rao bound along the path, by anchors."""
        points = track(min(PERIODS_S))[1:, ::2]
        return {name: float(np.sqrt((cramer_rao_bound(name, points) ** 2).mean())) for name in ANCHORS}


def play_paper(runs: int, progress: Progress) -> Results:
    """Play everything."""
    trials = [method_trial(method, t, runs) for t in PERIODS_S for method in METHODS]
    trials += [equal_information_trial(method, t, runs) for t in PERIODS_S for method in EQUAL_INFORMATION]
    trials += [start_trial(method, *case, runs) for case in product(ANCHORS, STARTS) for method in STARTED]
    trials += [unaided_trial(t, runs) for t in PERIODS_S] + [particle_trial(runs)]
    return Results(runs, play_all(trials, progress))
