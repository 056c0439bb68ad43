"""What was played for the paper, and the figures of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wsn_env.evaluation.intervals import Measured
from wsn_env.evaluation.progress import Progress
from wsn_env.papers.binary.systems import FAULTS, LIFETIMES, PERIODS_S, RADII, SETTINGS, Setting, lifetime_trial
from wsn_env.papers.rollout import Record, play_all, pooled_rms


@dataclass(frozen=True, eq=False)
class Results:
    """Everything that was played for the paper."""

    runs: int
    records: dict[Setting, Record]
    lifetimes: dict[str, Record]  # by system

    def error_m(self, setting: Setting) -> np.ndarray:
        """(R, K') error in each steady period."""
        return np.sqrt(self.records[setting].square_error()[:, setting.steady])

    def run_error_m(self, setting: Setting) -> np.ndarray:
        """(R,) mean error of each run."""
        return self.error_m(setting).mean(axis=1)

    def mean_m(self, setting: Setting) -> Measured:
        """Mean error."""
        return Measured.mean(self.run_error_m(setting))

    def median_m(self, setting: Setting) -> Measured:
        """Median error over runs and periods."""
        error = self.error_m(setting)
        return Measured.bootstrap(lambda runs: float(np.median(error[runs])), self.runs)

    def rms_m(self, setting: Setting) -> Measured:
        """Root of the mean square error over runs and periods."""
        return pooled_rms(self.error_m(setting) ** 2)

    def reporting(self, setting: Setting) -> np.ndarray:
        """(R,) mean number of nodes that report in a period (ANTNP) of each run."""
        return self.records[setting].detections[:, setting.steady].mean(axis=1)

    def energy_mj(self, setting: Setting) -> np.ndarray:
        """(R,) mean energy of a period of each run."""
        return self.records[setting].energy_mj[:, setting.steady].mean(axis=1)

    def crossing_s(self, system: str) -> Measured:
        """The sampling period from which the centroid has the lower RMS; NaN: none up to the longest."""
        settings = [[Setting(name, period_s=t) for t in PERIODS_S] for name in (system, "centroid")]
        squares = [np.stack([(self.error_m(one) ** 2).mean(axis=1) for one in row]) for row in settings]

        def crossing(runs: np.ndarray) -> float:
            own, other = (np.sqrt(square[:, runs].mean(axis=1)) for square in squares)
            return first_crossing(own - other)

        return Measured.bootstrap(crossing, self.runs)

    def even_s(self) -> Measured:
        """The sampling period from which more nodes change their state than detect; NaN: none."""
        own, other = (
            np.stack([self.reporting(Setting(name, period_s=t)) for t in PERIODS_S]) for name in ("paper", "centroid")
        )
        return Measured.bootstrap(lambda runs: first_crossing((own - other)[:, runs].mean(axis=1)), self.runs)


def first_crossing(excess: np.ndarray) -> float:
    """Where a quantity over PERIODS_S turns positive, interpolated [s]; NaN: nowhere."""
    for k in np.flatnonzero((excess[:-1] < 0) & (excess[1:] >= 0)):
        share = excess[k] / (excess[k] - excess[k + 1])
        return float(PERIODS_S[k] + share * (PERIODS_S[k + 1] - PERIODS_S[k]))
    return float("nan")


def play_paper(runs: int, progress: Progress) -> Results:
    """Play everything; what several tables share is played once."""
    trials = {setting: setting.trial(runs) for setting in (*SETTINGS, *FAULTS, *RADII)}
    lives = {system: lifetime_trial(system, runs) for system in LIFETIMES}
    records = play_all([*trials.values(), *lives.values()], progress)
    return Results(
        runs,
        {setting: records[trial] for setting, trial in trials.items()},
        {system: records[trial] for system, trial in lives.items()},
    )
