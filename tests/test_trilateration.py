"""Positions from strengths by least squares."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from tests.anchors import RING, everyone, play_subsets, ring_scenario, tell
from wsn_env import Cluster, Scenario, ScenarioError, World
from wsn_env.filters.linear import LinearModel
from wsn_env.filters.trilateration import trilaterate

NODES = np.array(RING, float)


def test_exact_ranges_give_the_point():
    point = np.array([37.0, 141.0])
    for chosen in ([0, 2, 4], [1, 3, 6, 7], list(range(8))):
        squared = ((NODES[chosen] - point) ** 2).sum(axis=1)
        found, cov = trilaterate(NODES[chosen], squared, np.zeros(len(chosen)))
        np.testing.assert_allclose(found, point, atol=1e-9)
        np.testing.assert_array_equal(cov, 0)


def test_it_is_least_squares_of_the_circles_differences():
    squared = np.random.default_rng(0).uniform(1e3, 3e4, 8)
    design, power = 2 * (NODES[1:] - NODES[0]), (NODES**2).sum(axis=1)
    expected = np.linalg.lstsq(design, squared[0] - squared[1:] + power[1:] - power[0])[0]
    np.testing.assert_allclose(trilaterate(NODES, squared, squared)[0], expected)


@pytest.mark.parametrize("chosen", [[], [3], [0, 7], [0, 1, 2], [5, 6, 7]])
def test_too_few_nodes_or_nodes_on_a_line_fix_nothing(chosen):
    assert trilaterate(NODES[chosen], np.ones(len(chosen)), np.ones(len(chosen))) is None


@pytest.mark.parametrize(
    "overrides", [dict(measurement="rssi", noise_db=1e-6), dict(measurement="rssi_power", noise=1e-9)]
)
def test_ranges_turn_the_strength_law_round(overrides):
    scenario = Scenario.named("PreDC-v0", **overrides)
    point = np.array([60.0, 30.0])
    strengths = LinearModel(scenario).expected([point], NODES)[0]
    squared, sd = scenario.measurement.squared_ranges(strengths, 1e4)
    np.testing.assert_allclose(squared, ((NODES - point) ** 2).sum(axis=1), rtol=1e-9)
    nearby, _ = scenario.measurement.squared_ranges(strengths + overrides.get("noise_db", 1e-9), 1e4)
    np.testing.assert_allclose(np.abs(nearby - squared), sd, rtol=1e-3)


def test_a_power_below_nothing_comes_from_afar():
    measurement = Scenario.named("PreDC-v0", measurement="rssi_power").measurement
    squared, sd = measurement.squared_ranges(np.array([-1.0, 0.0]), 500.0)
    np.testing.assert_allclose(squared, 500.0**2)
    assert np.isfinite(sd).all()


def test_its_covariance_is_that_of_small_noise():
    rng, point = np.random.default_rng(3), np.array([70.0, 120.0])
    scenario = ring_scenario(noise_db=0.1)
    ranges, level = scenario.measurement.squared_ranges, LinearModel(scenario).expected([point], NODES)[0]
    found = np.array([trilaterate(NODES, *ranges(level + rng.normal(0, 0.1, 8), 1e4))[0] for _ in range(2000)])
    _, cov = trilaterate(NODES, *ranges(level, 1e4))
    np.testing.assert_allclose(np.cov(found.T), cov, atol=0.12 * cov.max())


def test_nonlinear_least_squares_finds_scipys_minimum():
    scenario = ring_scenario(tracker="nonlinear_ls", noise_db=1.0)
    model = LinearModel(scenario)
    compared = 0
    for k, state in enumerate(play_subsets(scenario, [1])):
        nodes, values = tell(state)
        if k == 0 or len(nodes) < 3 or trilaterate(nodes, values[:, 0], values[:, 0]) is None:
            continue
        mean = state.belief.mean[0, ::2]
        best = least_squares(lambda x, nodes=nodes, z=values[:, 0]: model.expected([x], nodes)[0] - z, mean)
        if (best.x > 0).all() and (best.x < 200).all():
            np.testing.assert_allclose(mean, best.x, atol=0.05)
            np.testing.assert_allclose(state.belief.cov[0, ::2, ::2], np.linalg.inv(best.jac.T @ best.jac), rtol=0.05)
            compared += 1
    assert compared > 8


@pytest.mark.parametrize("tracker", ["trilateration", "nonlinear_ls"])
def test_without_a_fix_the_last_one_stays_and_widens(tracker):
    scenario = ring_scenario(tracker=tracker)
    world = World(scenario, threads=1)
    state, _ = world.step(world.reset([4]), everyone(1))
    later, _ = world.step(state, Cluster.of(np.zeros(1, int), np.zeros((1, 8), bool)))
    assert later.reports.count[0] == 1
    np.testing.assert_array_equal(later.belief.mean, state.belief.mean)
    wider = np.diag(later.belief.cov[0] - state.belief.cov[0])
    np.testing.assert_allclose(wider, [25, 0, 25, 0])  # (10 m/s, 0.5 s) squared


@pytest.mark.parametrize("tracker", ["trilateration", "nonlinear_ls"])
def test_positions_are_refused(tracker):
    with pytest.raises(ScenarioError, match=f"Tracking.tracker = '{tracker}': cannot read Position"):
        World(Scenario.named("PreDC-v0", tracker=tracker))


def test_the_errors_of_both_on_the_ring():
    """About 53 m and 19 m at 3 dB: a circle's difference takes the far nodes' huge errors at face value."""
    for tracker, expected in (("trilateration", 53.3), ("nonlinear_ls", 19.2)):
        scenario = ring_scenario(tracker=tracker, periods=100)
        world = World(scenario, threads=1)
        state = world.reset(np.arange(20))
        square = []
        for _ in range(100):
            state, outcome = world.step(state, everyone(20))
            square.append(outcome.error_m**2)
        assert np.sqrt(np.mean(square)) == pytest.approx(expected, rel=0.1)
