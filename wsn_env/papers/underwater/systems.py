"""The trials of the underwater system: what is played, and how a run is judged."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Any

import numpy as np

from wsn_env.evaluation.progress import Progress
from wsn_env.papers.rollout import Record, Trial, play_all
from wsn_env.scenario import Scenario

NOISES = {1e-5: 60, 1e-3: 60, 3e-2: 30}  # density of the white acceleration [m^2/s^3]: periods
SMOOTH, MIDDLE, ROUGH = NOISES
RESAMPLING_NOISES = (SMOOTH, ROUGH)
PARTICLES = (100, 300)
HANDOVERS = {"carried": False, "redrawn": True}
RESAMPLINGS = ("systematic", "spread")
THRESHOLDS_DB = (80.0, 82.0, 84.0, 85.0, 86.0, 88.0, 90.0, 92.0)
HYSTERESES_DB = (0.0, 3.0, 6.0, 10.0)
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
        speed_ms=2.0,
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
    redraw = HANDOVERS[handover]
    return _trial(scenario_as_read(noise, particles, resampling=resampling, redraw_on_handover=redraw), runs)


def threshold_trial(threshold_db: float, silent: bool, runs: int) -> Trial:
    """A point of the trade-off between reports and error, with or without what silence tells."""
    scenario = scenario_as_read(MIDDLE, threshold_db=threshold_db, silent_information=silent, redraw_on_handover=True)
    return _trial(scenario, runs)


def hysteresis_trial(hysteresis_db: float, runs: int) -> Trial:
    """A head that stays unless another node is so much stronger."""
    scenario = scenario_as_read(MIDDLE, silent_information=True, redraw_on_handover=True)
    return _trial(scenario, runs, hysteresis_db)


@dataclass(frozen=True, eq=False)
class Results:
    """Everything that was played."""

    runs: int
    records: dict[Trial, Record]

    def resampling(self, noise: float, particles: int, handover: str, resampling: str) -> Record:
        """A cell of the resampling table."""
        return self.records[resampling_trial(noise, particles, handover, resampling, self.runs)]

    def threshold(self, threshold_db: float, silent: bool) -> Record:
        """A point of the trade-off."""
        return self.records[threshold_trial(threshold_db, silent, self.runs)]

    def hysteresis(self, hysteresis_db: float) -> Record:
        """A head with so much hysteresis."""
        return self.records[hysteresis_trial(hysteresis_db, self.runs)]


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
    return Results(runs, play_all(trials, progress))


def lost(record: Record) -> np.ndarray:
    """(R,) bool: the runs whose target was lost."""
    error = np.sqrt(record.square_error())
    return error[:, -LOST_PERIODS:].mean(axis=1) > LOST_M


def median_rms_m(record: Record) -> tuple[float, float]:
    """Median of the runs' RMS, and its standard error (bootstrap)."""
    rms = record.rms_m()
    picks = np.random.default_rng(0).integers(len(rms), size=(1000, len(rms)))
    return float(np.median(rms)), float(np.median(rms[picks], axis=1).std(ddof=1))
