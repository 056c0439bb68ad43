"""The memoryless tracker."""

import numpy as np

from wsn_env import Cluster, Scenario, World


def play(**overrides):
    """One period after another with all nodes awake; yields the state before and after."""
    scenario = Scenario.named("PreDC-v0", **(dict(tracker="snapshot", search=False, periods=30) | overrides))
    world = World(scenario, threads=1)
    state = world.reset([5])
    everybody = Cluster(np.zeros(1, int), np.arange(scenario.field.nodes)[None])
    for _ in range(scenario.periods):
        before = state
        state, _ = world.step(state, everybody)
        yield before, state


def test_the_estimate_is_the_mean_of_the_reported_positions():
    for _, state in play():
        n = state.reports.count[0]
        if n > 0:
            np.testing.assert_allclose(state.belief.mean[0, ::2], state.reports.value[0, :n].mean(axis=0))
            np.testing.assert_allclose(state.belief.cov[0], np.diag([4 / n, 0, 4 / n, 0]))


def test_strengths_give_the_mean_of_the_reporting_nodes():
    heard = 0
    for _, state in play(measurement="rssi"):
        n = state.reports.count[0]
        if n > 0:
            places = state.network.positions[0, state.reports.node[0, :n]]
            np.testing.assert_allclose(state.belief.mean[0, ::2], places.mean(axis=0))
            np.testing.assert_allclose(np.diag(state.belief.cov[0])[::2], 10**2 / 2 / n)
            heard += 1
    assert heard > 20


def test_a_silent_period_keeps_the_estimate_and_widens_it():
    silent = 0
    for before, state in play(nodes=12, measurement="position"):
        if state.reports.count[0] == 0:
            silent += 1
            np.testing.assert_array_equal(state.belief.mean[0, ::2], before.belief.mean[0, ::2])
            grown = np.diag(state.belief.cov[0] - before.belief.cov[0])[::2]
            np.testing.assert_allclose(grown, 1)
    assert silent > 5


def test_it_believes_in_no_velocity():
    for _, state in play():
        assert (state.belief.mean[0, 1::2] == 0).all()
        np.testing.assert_array_equal(state.belief.predicted_mean[0, ::2], state.belief.mean[0, ::2])
