"""The EKF and the UKF tracker against filterpy's filters and a plain extended one, over whole episodes."""

import math

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter, MerweScaledSigmaPoints, UnscentedKalmanFilter
from scipy.linalg import sqrtm

from tests.anchors import play_subsets, ring_scenario, tell
from wsn_env import Scenario, View, World, make_policy
from wsn_env.filters.kalman import constant_velocity, square_root

F = np.array([[1, 1, 0, 0], [0, 1, 0, 0], [0, 0, 1, 1], [0, 0, 0, 1.0]])
G = np.array([[0.5, 0], [1, 0], [0, 0.5], [0, 1]])
H = np.eye(4)[::2]


def episode(check, tracker="ekf", **overrides):
    """Plays with nearest3; `check(state)` after every period. Returns the number of reports."""
    scenario = Scenario.named("PreDC-v0", tracker=tracker, search=False, **overrides)
    world, policy = World(scenario, threads=1), make_policy("nearest3", scenario)
    state = world.reset([4])
    check(state)
    heard = 0
    for _ in range(scenario.periods):
        state, _ = world.step(state, policy.act(View.of(state)))
        heard += state.reports.count[0]
        check(state)
    return heard


def told(state):
    """(node, value) of the period's reports."""
    n = state.reports.count[0]
    return zip(state.reports.node[0, :n], state.reports.value[0, :n], strict=True)


@pytest.mark.parametrize(("tracker", "within"), [("ekf", 1e-9), ("ukf", 1e-8)])
def test_position_reports_equal_filterpys_linear_filter(tracker, within):
    oracle = KalmanFilter(dim_x=4, dim_z=2)
    oracle.F, oracle.H, oracle.Q, oracle.R = F, H, 0.05**2 * G @ G.T, 4 * np.eye(2)

    def check(state):
        if state.period[0] == 0:
            oracle.x, oracle.P = state.belief.mean[0].copy(), state.belief.cov[0].copy()
            return
        oracle.predict()
        for _, value in told(state):
            oracle.update(value)
        np.testing.assert_allclose(state.belief.mean[0], oracle.x, atol=within)
        np.testing.assert_allclose(state.belief.cov[0], oracle.P, atol=within)

    assert episode(check, tracker) > 100


@pytest.mark.parametrize("measurement", ["rssi", "rssi_power"])
def test_strength_reports_equal_a_plain_extended_filter(measurement):
    memory = {}

    def slope_and_level(x, node):
        dx, dy = x[0] - node[0], x[2] - node[1]
        d = max(math.hypot(dx, dy), 1.0)
        if measurement == "rssi":
            level, derivative = -40 - 25 * math.log10(d), -25 / math.log(10) / d
        else:
            level, derivative = 100 / d**2, -200 / d**3
        inside = math.hypot(dx, dy) < 1
        return level, np.array([0.0, 0, 0, 0]) if inside else derivative * np.array([dx, 0, dy, 0]) / d

    def check(state):
        if state.period[0] > 0:
            x, p = memory["x"], memory["p"]
            x, p = F @ x, F @ p @ F.T + 0.05**2 * G @ G.T
            for node, value in told(state):
                level, h = slope_and_level(x, state.network.positions[0, node])
                gain = p @ h / (h @ p @ h + (9.0 if measurement == "rssi" else 0.04))
                x, p = x + gain * (value[0] - level), p - np.outer(gain, h) @ p
            np.testing.assert_allclose(state.belief.mean[0], x, rtol=1e-7, atol=1e-7)
            np.testing.assert_allclose(state.belief.cov[0], p, rtol=1e-7, atol=1e-7)
        memory["x"], memory["p"] = state.belief.mean[0].copy(), state.belief.cov[0].copy()

    assert episode(check, measurement=measurement) > 50


def test_the_unscented_filter_is_filterpys():
    """With all reports of a period as one measurement, whichever anchors they come from."""
    scenario = ring_scenario(tracker="ukf", start_sd_m=10.0, start_sd_ms=3.0)
    transition, noise = constant_velocity(scenario)
    points = MerweScaledSigmaPoints(4, 0.1, 2.0, -1.0, sqrt_method=lambda cov: sqrtm(cov).real)
    oracle = UnscentedKalmanFilter(4, 8, 0.5, None, lambda x, dt: transition @ x, points)
    oracle.Q = noise
    for k, state in enumerate(play_subsets(scenario, [5])):
        if k == 0:
            oracle.x, oracle.P = state.belief.mean[0].copy(), state.belief.cov[0].copy()
            continue
        nodes, values = tell(state)
        oracle.predict()
        if len(nodes):
            hx = lambda x, nodes=nodes: -40 - 15 * np.log10(((x[::2] - nodes) ** 2).sum(axis=1))  # noqa: E731
            oracle.update(values[:, 0], R=9 * np.eye(len(nodes)), hx=hx)
        np.testing.assert_allclose(state.belief.mean[0], oracle.x, rtol=1e-8, atol=1e-8)
        np.testing.assert_allclose(state.belief.cov[0], oracle.P, rtol=1e-8, atol=1e-8)


def test_a_root_is_found_where_a_direction_has_no_variance_or_less():
    cov = np.diag([4.0, 0, -1, 9])
    cov[0, 3] = cov[3, 0] = 2
    root = square_root(cov)
    np.testing.assert_allclose(root.T @ root, np.where(cov == -1, 0, cov), atol=1e-12)


@pytest.mark.parametrize("tracker", ["ekf", "ukf"])
def test_covariances_are_symmetric_and_positive(tracker):
    def check(state):
        cov = state.belief.cov[0]
        np.testing.assert_array_equal(cov, cov.T)
        assert np.linalg.eigvalsh(cov).min() > 0

    episode(check, tracker, measurement="rssi")


@pytest.mark.parametrize("tracker", ["ekf", "ukf"])
def test_rows_do_not_leak_into_each_other(tracker):
    """The tracker has one filterpy object: a row's belief must not depend on who went before."""
    scenario = Scenario.named("PreDC-v0", tracker=tracker, periods=15)
    world, policy = World(scenario, threads=1), make_policy("nearest3", scenario)
    batch, alone = world.reset([1, 2, 3]), world.reset([3])
    for _ in range(15):
        batch = world.step(batch, policy.act(View.of(batch)))[0]
        alone = world.step(alone, policy.act(View.of(alone)))[0]
        np.testing.assert_array_equal(batch.belief.mean[2], alone.belief.mean[0])
        np.testing.assert_array_equal(batch.belief.cov[2], alone.belief.cov[0])
