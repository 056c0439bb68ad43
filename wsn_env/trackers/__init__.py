"""Trackers: belief and reports in, belief out. `make_tracker` finds them by name."""

from pkgutil import resolve_name

from wsn_env.scenario import Scenario
from wsn_env.sections import TRACKERS
from wsn_env.types import Tracker


def make_tracker(scenario: Scenario, threads: int = 1, fast: bool = False) -> Tracker:
    """The tracker that a scenario names."""
    return resolve_name(TRACKERS[scenario.tracking.tracker])(scenario, threads, fast)
