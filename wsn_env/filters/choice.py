"""The tracker that a scenario names."""

from pkgutil import resolve_name

from wsn_env.models.state import Tracker
from wsn_env.scenario import Scenario
from wsn_env.scenario.tracking import TRACKERS

GAUSSIAN = ("ekf", "ukf", "ckf", "ickf", "grnn_kf")  # a mean and a covariance carry what they remember


def make_tracker(scenario: Scenario, threads: int = 1, fast: bool = False) -> Tracker:
    """The tracker that a scenario names.

    Raises:
        ScenarioError: it cannot work on what the nodes measure, or where they stand.
    """
    name = scenario.tracking.tracker
    tracker = resolve_name(TRACKERS[name])(scenario, threads, fast)
    if scenario.tracking.start == "fix" and name in GAUSSIAN:
        from wsn_env.filters.first_fix import FirstFix

        return FirstFix(tracker, scenario)
    return tracker
