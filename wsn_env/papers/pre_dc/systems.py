"""The systems of Xiang & Guo (2013) as trials, and everything that is played for the paper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from wsn_env.evaluation.progress import Progress
from wsn_env.models.measurement.position import Position
from wsn_env.models.motion.straight import Straight
from wsn_env.papers.rollout import Record, Trial, play_all
from wsn_env.scenario import Scenario

NODES = (81, 121, 169, 225)
READING: dict[str, Any] = dict(
    motion=Straight(from_m=5.0, velocity_ms=0.9),
    measurement=Position(noise_m=1.75),
    filter_q=0.02,
    particles=5000,
    fusion="pooled",
    search=False,
)
PARTICLES = (10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10_000)
MOTIONS = ("straight", "sine", "circle", "turns")
FILTERS: dict[str, dict[str, Any]] = {  # of Figs. 5-6: what each changes in the reading
    # The q that fits the motion, and a search for lost tracks.
    "fitting": dict(filter_q=None, manoeuvre_q=None, search=True),
    "curves": dict(filter_q=0.2, search=True),  # the q that fits the curved ones: on the straight one
    "as read": {},
}
FOLLOWED = (  # track and filter
    *(("straight", tracking) for tracking in FILTERS),
    *((motion, tracking) for motion in MOTIONS[1:] for tracking in ("fitting", "as read")),
)
LIFETIME: dict[str, Any] = FILTERS["fitting"] | dict(motion="waypoint", battery_j=0.001, periods=2000, particles=500)
LIFETIME_POLICIES = ("static_cluster", "pre_dc")
SAME_TRACKER: dict[str, tuple[tuple[str, float], ...]] = {
    "pre_dc": (),
    "centroid": (),
    "static_cluster": (),
    "nearest1": (("hysteresis_m", 0.0),),
}


@dataclass(frozen=True)
class System:
    """A (policy, tracker) pair of Table 2 and what it changes in the reading."""

    policy: str
    parameters: tuple[tuple[str, float], ...] = ()
    changes: tuple[tuple[str, object], ...] = ()
    runs_factor: int = 1  # so many times the runs of the others
    heard_only: bool = False  # leave out periods without a report

    def trial(self, nodes: int, runs: int) -> Trial:
        """The system in the reading, in a field of so many nodes."""
        scenario = scenario_as_read(nodes=nodes, **dict(self.changes))
        return Trial(self.policy, scenario, runs * self.runs_factor, self.parameters)


NEAREST_LEADS = (("hysteresis_m", 0.0),)
SYSTEMS = {
    "static": System("all", changes=(("tracker", "snapshot"),), runs_factor=3, heard_only=True),
    "ekf": System("nearest1", NEAREST_LEADS, (("tracker", "ekf"), ("filter_q", 0.03))),
    "ekf_same_q": System("nearest1", NEAREST_LEADS, (("tracker", "ekf"),)),
    "ekf_three": System("nearest2", NEAREST_LEADS, (("tracker", "ekf"),)),
    "pre_dc": System("pre_dc"),
    "pre_dc_joint": System("pre_dc", changes=(("fusion", "joint"),)),
}


def scenario_as_read(**changes: Any) -> Scenario:
    """PreDC-v0 in our reading of the paper's experiment, with changes."""
    return Scenario.named("PreDC-v0", **(READING | changes))


def as_printed_trial(runs: int) -> Trial:
    """Pre-DC with Phi0 alone, which keeps clusters that the target has left."""
    return Trial("pre_dc", scenario_as_read(), runs, (("keep_theta", 0.0),))


def same_tracker_trial(policy: str, nodes: int, runs: int) -> Trial:
    """A policy with the particle filter that all policies share."""
    return Trial(policy, scenario_as_read(nodes=nodes), runs, SAME_TRACKER[policy])


def particle_trial(particles: int, runs: int) -> Trial:
    """Pre-DC with so many particles (Figs. 7-8)."""
    return Trial("pre_dc", scenario_as_read(particles=particles), runs)


def motion_trial(motion: str, runs: int, tracking: str = "fitting") -> Trial:
    """Pre-DC on a track (Figs. 5-6), with one of FILTERS."""
    return Trial("pre_dc", scenario_as_read(motion=motion, **FILTERS[tracking]), runs)


def lifetime_trial(policy: str, runs: int) -> Trial:
    """A policy with the common tracker and small batteries, until they are empty."""
    return Trial(policy, scenario_as_read(**LIFETIME), runs)


@dataclass(frozen=True, eq=False)
class Results:
    """Everything that was played for the paper."""

    runs: int
    records: dict[Trial, Record]

    def system(self, name: str, nodes: int = 225) -> Record:
        """A system of Table 2."""
        return self.records[SYSTEMS[name].trial(nodes, self.runs)]

    def system_rms_m(self, name: str, nodes: int) -> np.ndarray:
        """(R,) RMS of each run of a system of Table 2."""
        return self.system(name, nodes).rms_m(SYSTEMS[name].heard_only)

    def same_tracker(self, policy: str, nodes: int = 225) -> Record:
        """A policy with the common tracker."""
        return self.records[same_tracker_trial(policy, nodes, self.runs)]

    def as_printed(self) -> Record:
        """Pre-DC with Phi0 alone."""
        return self.records[as_printed_trial(self.runs)]

    def particles(self, count: int) -> Record:
        """Pre-DC with so many particles."""
        return self.records[particle_trial(count, self.runs)]

    def motion(self, name: str, tracking: str = "fitting") -> Record:
        """Pre-DC on a track, with one of FILTERS."""
        return self.records[motion_trial(name, self.runs, tracking)]

    def lifetime(self, policy: str) -> Record:
        """A policy until the batteries are empty."""
        return self.records[lifetime_trial(policy, self.runs)]


def play_paper(runs: int, progress: Progress) -> Results:
    """Play everything; trials that several tables share are played once."""
    trials = [system.trial(nodes, runs) for nodes in NODES for system in SYSTEMS.values()]
    trials += [same_tracker_trial(policy, nodes, runs) for nodes in NODES for policy in SAME_TRACKER]
    trials += [motion_trial(motion, runs, tracking) for motion, tracking in FOLLOWED]
    trials += [as_printed_trial(runs)]
    trials += [particle_trial(count, runs) for count in PARTICLES]
    trials += [lifetime_trial(policy, runs) for policy in LIFETIME_POLICIES]
    return Results(runs, play_all(trials, progress))
