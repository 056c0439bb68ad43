"""Nothing but reports enters a tracker: every one that a scenario can name is replayed from its reports alone."""

import numpy as np
import pytest

from tests.anchors import play_subsets, ring_scenario
from wsn_env import World
from wsn_env.filters import make_tracker
from wsn_env.filters.fingerprint import _network, _training, trained_network, training_of
from wsn_env.filters.surprise import note_surprise
from wsn_env.models.motion.prediction import predict_moments
from wsn_env.scenario.tracking import BOUNDARY_TRACKERS, TRACKERS

CASES = [(name, start) for name in TRACKERS for start in ("known", "fix")]
OVERRIDES = {  # name: what a tracker needs in place of the anchors' strengths
    name: dict(measurement="binary", radius_m=80.0) for name in BOUNDARY_TRACKERS
}


def scenario_for(name, **more):
    return ring_scenario(**(dict(tracker=name, periods=12) | OVERRIDES.get(name, {}) | more))


def bits(belief):
    return [array.tobytes() for array in (belief.row, belief.particles, belief.log_weights)]


@pytest.mark.parametrize(("name", "start"), CASES)
def test_a_replay_of_the_reports_gives_the_same_beliefs(name, start):
    scenario = scenario_for(name, start=start)
    states = list(play_subsets(scenario, [3, 4]))
    tracker, belief = make_tracker(scenario), states[0].copy().belief
    for before, after in zip(states, states[1:]):
        tracker.correct(before.key, after.period.copy(), belief, after.network, after.reports, np.zeros(2, bool))
        for row in range(2):
            b = belief.row[row]
            if after.reports.count[row] > 0:
                note_surprise(b)
            predict_moments(b["mean"], b["cov"], 0.5, scenario.filter_q, b["predicted_mean"], b["predicted_cov"])
        assert bits(belief) == bits(after.belief)


class Meddler:
    """Spoils the truth before the tracker corrects."""

    def __init__(self, tracker):
        self.tracker, self.particles = tracker, tracker.particles
        self.start, self.relocate = tracker.start, tracker.relocate
        self.track = None

    def correct(self, *given):
        kept = self.track.copy()
        self.track[:] = 1e3 * np.random.default_rng(0).normal(size=self.track.shape)
        self.tracker.correct(*given)
        self.track[:] = kept  # the next period is sensed as ever


@pytest.mark.parametrize(("name", "start"), CASES)
def test_another_truth_under_the_same_reports_changes_nothing(name, start):
    scenario = scenario_for(name, start=start)
    honest = [bits(state.belief) for state in play_subsets(scenario, [3, 4])]
    world = World(scenario, threads=1)
    world.tracker = Meddler(world.tracker)
    reset, step = world.reset, world.step

    def watched(state):
        world.tracker.track = state.track
        return state

    world.reset = lambda keys: watched(reset(keys))
    world.step = lambda state, cluster: step(watched(state.copy()), cluster, donate=True)
    assert [bits(state.belief) for state in play_subsets(scenario, [3, 4], world=world)] == honest


def test_training_knows_neither_key_nor_track():
    networks = []
    for key, changes in ((1, {}), (2, dict(period_s=1.0)), (3, dict(legs=((50, 1, 3),), start_m=(0, 0)))):
        _training.cache_clear()
        _network.cache_clear()
        np.random.seed(key)
        scenario = ring_scenario(tracker="grnn", start="fix", **changes)
        list(play_subsets(scenario, [key]))
        networks.append(trained_network(scenario))
    for other in networks[1:]:
        assert other is not networks[0]
        assert other.width == networks[0].width
        np.testing.assert_array_equal(other.map.strengths, networks[0].map.strengths)


def test_the_network_is_not_trained_on_the_path_it_is_tested_on():
    """The map is a regular grid whatever the path; of the random points none lies on it."""
    scenario = ring_scenario(tracker="grnn", periods=500, period_s=0.1)
    training, track = training_of(scenario), World(scenario, threads=1).reset([1]).track[0, :, ::2]
    line = np.linspace(0, 200, 21)
    np.testing.assert_array_equal(np.unique(training.map.points, axis=0), [(x, y) for x in line for y in line])
    assert np.linalg.norm(training.points[:, None] - track, axis=2).min() > 0.01
