"""Trackers: belief and reports in, belief out. `make_tracker` finds them by name."""

from wsn_env.scenario import Scenario


def make_tracker(scenario: Scenario, threads: int = 1, fast: bool = False):
    """The tracker that a scenario names."""
    name = scenario.tracking.tracker
    if name == "particle":
        from wsn_env.trackers.particle import ParticleTracker

        return ParticleTracker(scenario, threads, fast)
    if name == "ekf":
        from wsn_env.trackers.kalman import EKFTracker

        return EKFTracker(scenario)
    from wsn_env.trackers.snapshot import SnapshotTracker

    return SnapshotTracker(scenario)
