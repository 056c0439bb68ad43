"""The systems of Zhou, Cheng & Xing (2009) as trials, and everything that is played for the paper."""

from __future__ import annotations

from dataclasses import dataclass
from math import floor
from typing import Any, Literal

import numpy as np

from wsn_env.evaluation.progress import Progress
from wsn_env.models.detection.radius import Detection
from wsn_env.models.measurement.binary import Binary
from wsn_env.models.motion.legs import Legs
from wsn_env.papers.rollout import Record, Trial, play_all
from wsn_env.scenario import Scenario

NODES = (400, 500, 600, 700, 800)
RADII_M = (40.0, 50.0, 60.0, 70.0, 80.0)
PERIODS_S = (1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0)
SIDE_M = 500.0
VELOCITY_MS = (10.0, -10.0)
STEADY_S = (15.0, 40.0)  # the target is well inside the field
INSIDE_S = 7.0  # a system that starts inside begins when the whole disc has entered
FLIP, GATE_M, SUCCESS = 0.001, 20.0, 0.7  # the faults, and the gate against them
REFRESHES = (0, 10, 5)


@dataclass(frozen=True)
class System:
    """A tracker, and where and how it starts."""

    tracker: str
    inside: bool = False
    reports: Literal["changes", "presence"] = "changes"
    tracking: tuple[tuple[str, object], ...] = ()


SURE = (("start", "known"), ("start_sd_m", 1e-6), ("start_sd_ms", 1e-6))
CLOUD = (("filter_q", 0.6), ("particles", 5000), ("rest_sd_ms", 10.0), ("resampling", "spread"))
SYSTEMS = {
    "raw": System("boundary_raw", tracking=SURE),  # the velocity is given
    "paper": System("boundary"),
    "paper_inside": System("boundary", inside=True),
    "mid": System("boundary_mid", inside=True),
    "ekf": System("boundary_ekf", inside=True),
    "particle": System("particle", inside=True, tracking=CLOUD),
    "centroid": System("centroid", reports="presence"),
    "centroid_rls": System("centroid_rls", reports="presence"),
}
SWEPT = ("raw", "paper", "mid", "ekf", "centroid")
FAULTED = ("raw", "paper", "paper_inside", "mid", "ekf", "particle", "centroid")


@dataclass(frozen=True)
class Setting:
    """A system in a field."""

    system: str
    nodes: int = 600
    radius_m: float = 60.0
    period_s: float = 1.0
    flip: float = 0.0
    gate_m: float | None = None
    success: float = 1.0  # of a single try; reports that are lost stay lost
    refresh: int = 0

    @property
    def begin_s(self) -> float:
        """When the system starts, on the target's clock."""
        return INSIDE_S if SYSTEMS[self.system].inside else 0.0

    @property
    def time_s(self) -> np.ndarray:
        """(K,) end of every period on the target's clock."""
        return self.begin_s + self.period_s * np.arange(1, self.trial(1).scenario.periods + 1)

    @property
    def steady(self) -> np.ndarray:
        """(K,) bool: the periods that count."""
        return (self.time_s >= STEADY_S[0] - 1e-9) & (self.time_s <= STEADY_S[1] + 1e-9)

    def trial(self, runs: int) -> Trial:
        """Everybody is awake, always."""
        system = SYSTEMS[self.system]
        left_s = SIDE_M / VELOCITY_MS[0] - self.begin_s
        start_m = (VELOCITY_MS[0] * self.begin_s, SIDE_M + VELOCITY_MS[1] * self.begin_s)
        faulty = self.flip > 0 or self.success < 1  # the centroid, too, then lives on the bitmap
        values: dict[str, Any] = dict(
            periods=floor(left_s / self.period_s + 1e-9),
            period_s=self.period_s,
            nodes=self.nodes,
            side_m=SIDE_M,
            motion=Legs(start_m=start_m, legs=((left_s, *VELOCITY_MS),)),
            detection=Detection(radius_m=self.radius_m, softness=1e-6, ceiling=1.0),
            measurement=Binary("changes" if faulty else system.reports, refresh=self.refresh, flip=self.flip),
            packet_success=self.success,
            retries=0,
            tracker=system.tracker,
            gate_m=None if system.tracker == "particle" else self.gate_m,
            filter_q=0.0,
            search=False,
            start="search",
            rest_sd_ms=1e-6,
        )
        return Trial("all", Scenario.named("Binary-v0", **(values | dict(system.tracking))), runs)


SETTINGS = (
    *(Setting(name) for name in SYSTEMS),
    *(Setting(name, nodes=n) for n in NODES for name in SWEPT),
    *(Setting(name, radius_m=r) for r in RADII_M for name in SWEPT),
    *(Setting(name, period_s=t) for t in PERIODS_S for name in (*SWEPT, "paper_inside")),
)
FAULTS = (
    *(Setting(name, flip=FLIP, gate_m=gate) for gate in (None, GATE_M) for name in FAULTED),
    *(Setting(name, success=SUCCESS, refresh=refresh) for refresh in REFRESHES for name in FAULTED),
)


@dataclass(frozen=True, eq=False)
class Results:
    """Everything that was played for the paper."""

    runs: int
    records: dict[Setting, Record]

    def error_m(self, setting: Setting) -> np.ndarray:
        """(R, K') error in each steady period."""
        return np.sqrt(self.records[setting].square_error()[:, setting.steady])

    def run_error_m(self, setting: Setting) -> np.ndarray:
        """(R,) mean error of each run."""
        return self.error_m(setting).mean(axis=1)

    def rms_m(self, setting: Setting) -> float:
        """Root of the mean square error over runs and periods."""
        return float(np.sqrt((self.error_m(setting) ** 2).mean()))

    def reporting(self, setting: Setting) -> np.ndarray:
        """(R,) mean number of nodes that report in a period (ANTNP) of each run."""
        return self.records[setting].detections[:, setting.steady].mean(axis=1)

    def energy_mj(self, setting: Setting) -> np.ndarray:
        """(R,) mean energy of a period of each run."""
        return self.records[setting].energy_mj[:, setting.steady].mean(axis=1)

    def rms_by_period_s(self, system: str) -> np.ndarray:
        """RMS of a system for each of PERIODS_S [m]."""
        return np.array([self.rms_m(Setting(system, period_s=t)) for t in PERIODS_S])

    def crossing_s(self, system: str) -> float:
        """The sampling period from which the centroid has the lower RMS, interpolated; NaN: none up to the longest."""
        excess = self.rms_by_period_s(system) - self.rms_by_period_s("centroid")
        for k in np.flatnonzero((excess[:-1] < 0) & (excess[1:] >= 0)):
            share = excess[k] / (excess[k] - excess[k + 1])
            return float(PERIODS_S[k] + share * (PERIODS_S[k + 1] - PERIODS_S[k]))
        return float("nan")


def play_paper(runs: int, progress: Progress) -> Results:
    """Play everything; what several tables share is played once."""
    trials = {setting: setting.trial(runs) for setting in (*SETTINGS, *FAULTS)}
    records = play_all(trials.values(), progress)
    return Results(runs, {setting: records[trial] for setting, trial in trials.items()})
