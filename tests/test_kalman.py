"""The EKF tracker against filterpy's linear filter and a plain extended one, over whole episodes."""

import math

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from wsn_env import Scenario, View, World, make_policy

F = np.array([[1, 1, 0, 0], [0, 1, 0, 0], [0, 0, 1, 1], [0, 0, 0, 1.0]])
G = np.array([[0.5, 0], [1, 0], [0, 0.5], [0, 1]])
H = np.eye(4)[::2]


def episode(check, **overrides):
    """Plays with nearest3; `check(state)` after every period. Returns the number of reports."""
    scenario = Scenario.named("PreDC-v0", tracker="ekf", search=False, **overrides)
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


def test_position_reports_equal_filterpys_linear_filter():
    oracle = KalmanFilter(dim_x=4, dim_z=2)
    oracle.F, oracle.H, oracle.Q, oracle.R = F, H, 0.05**2 * G @ G.T, 4 * np.eye(2)

    def check(state):
        if state.period[0] == 0:
            oracle.x, oracle.P = state.belief.mean[0].copy(), state.belief.cov[0].copy()
            return
        oracle.predict()
        for _, value in told(state):
            oracle.update(value)
        np.testing.assert_allclose(state.belief.mean[0], oracle.x, atol=1e-9)
        np.testing.assert_allclose(state.belief.cov[0], oracle.P, atol=1e-9)

    assert episode(check) > 100


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


def test_covariances_are_symmetric_and_positive():
    def check(state):
        cov = state.belief.cov[0]
        np.testing.assert_array_equal(cov, cov.T)
        assert np.linalg.eigvalsh(cov).min() > 0

    episode(check, measurement="rssi")


def test_rows_do_not_leak_into_each_other():
    """The tracker has one filterpy object: a row's belief must not depend on who went before."""
    scenario = Scenario.named("PreDC-v0", tracker="ekf", periods=15)
    world, policy = World(scenario, threads=1), make_policy("nearest3", scenario)
    batch, alone = world.reset([1, 2, 3]), world.reset([3])
    for _ in range(15):
        batch = world.step(batch, policy.act(View.of(batch)))[0]
        alone = world.step(alone, policy.act(View.of(alone)))[0]
        np.testing.assert_array_equal(batch.belief.mean[2], alone.belief.mean[0])
        np.testing.assert_array_equal(batch.belief.cov[2], alone.belief.cov[0])
