"""The trials of the underwater system: what is played, and how a run is judged."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Any, NamedTuple

import numpy as np

from wsn_env.compiled import draws
from wsn_env.evaluation.progress import Progress
from wsn_env.evaluation.rollout import FIRST_SEED
from wsn_env.papers.rollout import Record, Trial, play_all
from wsn_env.scenario import Scenario
from wsn_env.simulation.view import View
from wsn_env.simulation.world import World

NOISES = {1e-5: 60, 1e-3: 60, 3e-2: 30}  # density of the white acceleration [m^2/s^3]: periods
SMOOTH, MIDDLE, ROUGH = NOISES
MOTIONS = {SMOOTH: "smooth", MIDDLE: "middle", ROUGH: "rough"}
SPEED_MS = 2.0
RESAMPLING_NOISES = (SMOOTH, ROUGH)
PARTICLES = (100, 300)
HANDOVERS: dict[str, dict[str, Any]] = {
    "carried": {"handover": "particles"},
    "redrawn": {"redraw_on_handover": True},
}
RESAMPLINGS = {"systematic": "systematic", "common_spread": "patent's", "spread": "ours"}
THRESHOLDS_DB = (80.0, 82.0, 84.0, 85.0, 86.0, 88.0, 90.0, 92.0)
HYSTERESES_DB = (0.0, 3.0, 6.0, 10.0)
STARTS: dict[str, dict[str, Any]] = {  # where the first head comes from
    "nearest to a known start": {},
    "strongest signal of a search": {"start": "search", "rest_sd_ms": SPEED_MS / sqrt(2)},
}
LIFETIME: dict[str, Any] = dict(motion="waypoint", speed_ms=SPEED_MS, filter_q=0.1, periods=1000, battery_j=30.0)
LIFETIMES_DB = (0.0, 3.0)
LEAVING_PERIODS = 150  # within which every target leaves
LOST_M, LOST_PERIODS = 100.0, 10  # a run is lost when its mean error over the last ten periods is larger


def scenario_as_read(noise: float, particles: int = 300, **changes: Any) -> Scenario:
    """Underwater-v0 in our reading of the experiment: the filter knows the track's noise, and resamples always.

    Args:
        noise: density of the white acceleration [m^2/s^3], one of NOISES.
        particles: number of particles.
        changes: further quantities.
    """
    period_s = Scenario.named("Underwater-v0").period_s
    acceleration = sqrt(noise / period_s)
    reading: dict[str, Any] = dict(
        periods=NOISES[noise],
        speed_ms=SPEED_MS,
        acceleration_ms2=acceleration,
        filter_q=acceleration,
        particles=particles,
        resample_below=1.0,
        silent_information=False,
        search=False,
    )
    return Scenario.named("Underwater-v0", **(reading | changes))


def _trial(scenario: Scenario, runs: int, hysteresis_db: float = 0.0) -> Trial:
    return Trial("strongest_signal", scenario, runs, (("hysteresis_db", hysteresis_db),))


def resampling_trial(noise: float, particles: int, handover: str, resampling: str, runs: int) -> Trial:
    """A cell of the resampling table."""
    return _trial(scenario_as_read(noise, particles, resampling=resampling, **HANDOVERS[handover]), runs)


def threshold_trial(threshold_db: float, silent: bool, runs: int) -> Trial:
    """A point of the trade-off between reports and error, with or without what silence tells."""
    scenario = scenario_as_read(MIDDLE, threshold_db=threshold_db, silent_information=silent, redraw_on_handover=True)
    return _trial(scenario, runs)


def hysteresis_trial(hysteresis_db: float, runs: int) -> Trial:
    """A head that stays unless another node is so much stronger."""
    scenario = scenario_as_read(MIDDLE, silent_information=True, redraw_on_handover=True)
    return _trial(scenario, runs, hysteresis_db)


def lifetime_trial(hysteresis_db: float, runs: int) -> Trial:
    """The same with small batteries and a target that never leaves."""
    reading: dict[str, Any] = dict(silent_information=True, redraw_on_handover=True)
    return _trial(scenario_as_read(MIDDLE, **reading).override(**LIFETIME), runs, hysteresis_db)


def start_trial(noise: float, start: str, runs: int) -> Trial:
    """A first head, one of STARTS."""
    return _trial(scenario_as_read(noise, silent_information=True, redraw_on_handover=True, **STARTS[start]), runs)


def leaving_trial(noise: float, resampling: str, runs: int) -> Trial:
    """Until the target leaves the field; the record goes on after that."""
    leaving = dict(periods=LEAVING_PERIODS, ends_outside=True)
    return _trial(scenario_as_read(noise, resampling=resampling, redraw_on_handover=True, **leaving), runs)


class FirstHeads(NamedTuple):
    """Who leads first in R runs."""

    node: np.ndarray  # (R,)
    distance_m: np.ndarray  # (R,) to the target


@dataclass(frozen=True, eq=False)
class Results:
    """Everything that was played."""

    runs: int
    records: dict[Trial, Record]
    first_heads: dict[tuple[float, str], FirstHeads]  # by density and start

    def resampling(self, noise: float, particles: int, handover: str, resampling: str) -> Record:
        """A cell of the resampling table."""
        return self.records[resampling_trial(noise, particles, handover, resampling, self.runs)]

    def threshold(self, threshold_db: float, silent: bool) -> Record:
        """A point of the trade-off."""
        return self.records[threshold_trial(threshold_db, silent, self.runs)]

    def hysteresis(self, hysteresis_db: float) -> Record:
        """A head with so much hysteresis."""
        return self.records[hysteresis_trial(hysteresis_db, self.runs)]

    def lifetime(self, hysteresis_db: float) -> Record:
        """The same with small batteries."""
        return self.records[lifetime_trial(hysteresis_db, self.runs)]

    def start(self, noise: float, start: str) -> Record:
        """A first head."""
        return self.records[start_trial(noise, start, self.runs)]

    def leaving(self, noise: float, resampling: str) -> Record:
        """Until the target leaves, and after."""
        return self.records[leaving_trial(noise, resampling, self.runs)]


def play_system(runs: int, progress: Progress) -> Results:
    """Play everything; trials that several tables share are played once."""
    trials = [
        resampling_trial(noise, particles, handover, resampling, runs)
        for noise in RESAMPLING_NOISES
        for particles in PARTICLES
        for handover in HANDOVERS
        for resampling in RESAMPLINGS
    ]
    trials += [
        threshold_trial(threshold_db, silent, runs) for threshold_db in THRESHOLDS_DB for silent in (False, True)
    ]
    trials += [hysteresis_trial(hysteresis_db, runs) for hysteresis_db in HYSTERESES_DB]
    trials += [lifetime_trial(hysteresis_db, runs) for hysteresis_db in LIFETIMES_DB]
    trials += [start_trial(noise, start, runs) for noise in NOISES for start in STARTS]
    trials += [leaving_trial(noise, resampling, runs) for noise in NOISES for resampling in RESAMPLINGS]
    heads = {(noise, start): first_heads(noise, start, runs) for noise in NOISES for start in STARTS}
    return Results(runs, play_all(trials, progress), heads)


def first_heads(noise: float, start: str, runs: int) -> FirstHeads:
    """Whom the policy chooses first."""
    world = World(start_trial(noise, start, runs).scenario)
    state = world.reset([draws.key_of_seed(FIRST_SEED + run) for run in range(runs)])
    view = View.of(state)
    node = np.where(view.head < 0, view.nearest_living(), view.head)
    offset_m = state.network.positions[np.arange(runs), node] - state.track[:, 0, ::2]
    return FirstHeads(node, np.linalg.norm(offset_m, axis=1))


def lost(record: Record) -> np.ndarray:
    """(R,) bool: the runs whose target was lost."""
    error = np.sqrt(record.square_error())
    return error[:, -LOST_PERIODS:].mean(axis=1) > LOST_M


def median_rms_m(record: Record) -> tuple[float, float]:
    """Median of the runs' RMS, and its standard error (bootstrap)."""
    rms = record.rms_m()
    picks = np.random.default_rng(0).integers(len(rms), size=(1000, len(rms)))
    return float(np.median(rms)), float(np.median(rms[picks], axis=1).std(ddof=1))


def periods_inside(record: Record, side_m: float) -> np.ndarray:
    """(R,) periods up to the first in which the target is outside, that one included."""
    outside = np.any((record.target_m < 0) | (record.target_m > side_m), axis=2)
    return np.where(outside.any(axis=1), outside.argmax(axis=1) + 1, outside.shape[1])
