"""The systems of Zhou, Cheng & Xing (2009) as trials: everything that is played for the paper."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import floor, hypot, pi
from typing import Any, Literal

import numpy as np

from wsn_env.models.detection.base import DetectionRule
from wsn_env.models.detection.radius import Detection
from wsn_env.models.detection.unequal import UnequalRadii
from wsn_env.models.measurement.binary import Binary
from wsn_env.models.motion.legs import Legs
from wsn_env.papers.rollout import Trial
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
SPREADS = (0.1, 0.2)  # half width of unequal radii, in R


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
UNEQUAL = ("raw", "paper", "mid", "ekf", "particle")
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
    spread: float = 0.0  # of the nodes' radii, in R
    knows: Literal["R", "the spread", "each radius"] = "R"  # what the tracker knows of them

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
            detection=self._detection(),
            measurement=Binary("changes" if faulty else system.reports, refresh=self.refresh, flip=self.flip),
            edge_m=self.spread * self.radius_m / pi if self.knows == "the spread" else 1.0,  # of the radii's variance
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

    def _detection(self) -> DetectionRule:
        if self.spread == 0:
            return Detection(radius_m=self.radius_m, softness=1e-6, ceiling=1.0)
        return UnequalRadii(self.radius_m, self.spread, self.knows == "each radius")


LIFETIME: dict[str, Any] = dict(motion="waypoint", speed_ms=hypot(*VELOCITY_MS), periods=2000, battery_j=0.005)
LIFETIMES = ("paper", "centroid")


def lifetime_trial(system: str, runs: int) -> Trial:
    """With small batteries and a target that never leaves; who reports does not hang on the tracker."""
    return Trial("all", Setting(system).trial(runs).scenario.override(**LIFETIME), runs)


def vary(system: str, field: str, values: Iterable[float]) -> list[Setting]:
    """A system's settings over a quantity, a field of them."""
    changes: list[dict[str, Any]] = [{field: value} for value in values]
    return [Setting(system, **change) for change in changes]


SETTINGS = (
    *(Setting(name) for name in SYSTEMS),
    *(one for name in SWEPT for one in vary(name, "nodes", NODES)),
    *(one for name in SWEPT for one in vary(name, "radius_m", RADII_M)),
    *(one for name in (*SWEPT, "paper_inside") for one in vary(name, "period_s", PERIODS_S)),
)
FAULTS = (
    *(Setting(name, flip=FLIP, gate_m=gate) for gate in (None, GATE_M) for name in FAULTED),
    *(Setting(name, success=SUCCESS, refresh=refresh) for refresh in REFRESHES for name in FAULTED),
)
RADII = (
    *(Setting(name, spread=s, knows=knows) for s in SPREADS for knows in ("R", "each radius") for name in UNEQUAL),
    *(Setting("particle", spread=s, knows="the spread") for s in SPREADS),
)
