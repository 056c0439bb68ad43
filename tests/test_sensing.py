"""Detection and measurement at points computed by hand."""

import numba
import numpy as np
import pytest
from scipy import stats

from wsn_env import Cluster, Scenario, World
from wsn_env.compiled import draws
from wsn_env.models.detection.base import mean_probability
from wsn_env.models.detection.radius import Detection
from wsn_env.models.measurement.base import log_miss, node_at
from wsn_env.models.measurement.base import sample as measure
from wsn_env.scenario.constants import constants
from wsn_env.scenario.sensing import detection_probability, joint_detection_probability


def test_detection_probability_with_table_1():
    p = detection_probability([0.0, 8.0, 10.0, 11.9, 12.0, 1e6], Scenario())
    assert p[0] == p[1] == 0.6
    assert p[2] == pytest.approx(0.0812, abs=5e-5)  # 0.6 exp(-2**3 / 2**2)
    assert p[2] == pytest.approx(0.6 * np.exp(-2), rel=1e-14)
    assert 0 <= p[3] < 1e-200  # 0.6 exp(-3.9**3 / 0.1**2)
    assert p[4] == p[5] == 0


@pytest.mark.interpreted
@pytest.mark.parametrize(
    "detection",
    [
        Detection(),
        Detection(radius_m=30, softness=1, decay=0.3, ceiling=1, decay_power=1.5, edge_power=0.7),
        Detection(decay=0),
    ],
)
def test_detection_probability_against_its_formula(detection):
    d = np.linspace(0, 2.1 * detection.radius_m, 5001)
    a1 = d - (1 - detection.softness) * detection.radius_m
    a2 = (1 + detection.softness) * detection.radius_m - d
    with np.errstate(all="ignore"):
        between = detection.ceiling * np.exp(-detection.decay * a1**detection.decay_power / a2**detection.edge_power)
    formula = np.where(a1 <= 0, detection.ceiling, np.where(a2 <= 0, 0, between))
    p = detection_probability(d, Scenario(detection=detection))
    np.testing.assert_allclose(p, formula, rtol=1e-11, atol=1e-290)
    if detection.decay > 0:
        assert (np.diff(p) <= 0).all()


def test_detection_probability_keeps_the_shape():
    distance, scenario = np.linspace(0, 20, 24).reshape(2, 3, 4), Scenario()
    p = detection_probability(distance, scenario)
    assert p.shape == (2, 3, 4)
    assert p[1, 2, 3] == detection_probability(distance[1, 2, 3], scenario)
    np.testing.assert_array_equal(detection_probability(distance[:, :, ::2], scenario), p[:, :, ::2])


def test_joint_detection_probability():
    three, two = joint_detection_probability([[0.6, 0.6, 0.6], [0.6, 0.6, 0.0]])
    assert three == pytest.approx(1 - 0.4**3) and three > 0.9  # 0.936
    assert two == pytest.approx(0.84) and two < 0.9
    assert joint_detection_probability([[1.0, 0.3]]) == 1
    assert joint_detection_probability([[0.0, 0.0]]) == 0


@numba.njit
def mean_detection(dx, dy, xx, xy, yy, cs):
    return mean_probability(cs[0].detection, cs[0].measurement, dx, dy, xx, xy, yy)


@pytest.mark.parametrize(
    ("changes", "within"),  # rms of the deviation over beliefs as wide as a third and as wide as a whole sensing radius
    [
        (dict(), (0.01, 0.03)),
        (dict(decay=0.0), (0.02, 0.04)),  # a hard disc
        (dict(softness=1.0, decay=0.3), (0.02, 0.03)),
        (dict(measurement="rssi", detection="threshold", threshold_db=-65.0), (0.01, 0.03)),
    ],
)
def test_mean_detection_is_that_of_targets_drawn_from_the_belief(changes, within):
    scenario = Scenario.named("PreDC-v0", **changes)
    cs, radius, rng = constants(scenario), scenario.radius_m, np.random.default_rng(0)
    for width, rms in zip((0.3, 1.0), within):
        deviations = []
        for _ in range(100):
            offset = rng.uniform(-1.5, 1.5, 2) * radius
            root = rng.normal(size=(2, 2))
            cov = root @ root.T
            cov *= (width * radius * rng.uniform(0, 1)) ** 2 / np.trace(cov)
            targets = offset + rng.normal(size=(4000, 2)) @ np.linalg.cholesky(cov).T
            drawn = detection_probability(np.hypot(*targets.T), scenario).mean()
            deviations.append(mean_detection(*offset, cov[0, 0], cov[0, 1], cov[1, 1], cs) - drawn)
        assert np.mean(np.square(deviations)) ** 0.5 < rms  # 4,000 draws: .003 (rms)


@pytest.mark.parametrize(
    ("changes", "within"),
    [(dict(), 0.03), (dict(measurement="rssi", detection="threshold", threshold_db=-65.0), 1e-6)],
)
def test_mean_detection_of_a_sharp_belief_is_the_probability_there(changes, within):
    """Exactly so for a threshold; the edge of eqs. 2-3 is taken for a normal distribution function."""
    scenario = Scenario.named("PreDC-v0", **changes)
    for distance in np.linspace(0.5, 13.0, 101):
        there = detection_probability(distance, scenario)
        mean = mean_detection(distance, 0.0, 1e-12, 0.0, 1e-12, constants(scenario))
        assert abs(mean - there) < within


def test_mean_detection_tells_hopeless_nodes_apart():
    """So that a cluster for a lost target is not made of any nodes that cannot hear it."""
    cs = constants(Scenario.named("PreDC-v0"))
    chances = [mean_detection(distance, 0.0, 1.0, 0.0, 1.0, cs) for distance in np.arange(10.0, 30.0)]
    assert (np.diff(chances) < 0).all() and chances[-1] > 0


@numba.njit
def measured(cs, target, positions, count):
    out = np.empty((count, 2))
    for i in range(count):
        stream = draws.stream(np.uint64(1), i, draws.MEASUREMENT)
        out[i] = measure(cs[0].measurement, stream, node_at(positions, 0), target[0], target[2])
    return out


def sample(distance, count=100_000, **overrides):
    """Measurements of a target `distance` metres east and none north of a node at (20, 30)."""
    scenario = Scenario.named("PreDC-v0", **overrides)
    return measured(constants(scenario), np.array([20.0 + distance, 1, 30, 1]), np.array([[20.0, 30.0]]), count)


def assert_normal(sample, mean, sd):
    n = len(sample)
    assert abs(sample.mean() - mean) < 4 * sd / n**0.5
    assert abs(sample.std() / sd - 1) < 4 / (2 * n) ** 0.5
    assert stats.kstest((sample - mean) / sd, "norm").pvalue > 1e-4


def test_position_measurements():
    z = sample(7.0)
    assert_normal(z[:, 0], 27, 2)
    assert_normal(z[:, 1], 30, 2)
    assert abs(np.corrcoef(z.T)[0, 1]) < 5 / len(z) ** 0.5


@pytest.mark.parametrize(("distance", "level"), [(10.0, -65.0), (1.0, -40.0), (0.3, -40.0), (0.0, -40.0)])
def test_rssi_measurements(distance, level):
    z = sample(distance, measurement="rssi")
    assert_normal(z[:, 0], level, 3)  # -40 - 25 log10(d), nearer than 1 m no stronger
    assert (z[:, 1] == 0).all()


@pytest.mark.parametrize(("distance", "power"), [(10.0, 1.0), (5.0, 4.0), (1.0, 100.0), (0.5, 100.0)])
def test_rssi_power_measurements(distance, power):
    assert_normal(sample(distance, measurement="rssi_power")[:, 0], power, 0.2)  # 100 / d**2


def test_rssi_power_with_another_exponent():
    z = sample(10.0, measurement="rssi_power", exponent=3.5, noise=1e-3)[:, 0]
    assert_normal(z, 100 * 10**-3.5, 1e-3)


def test_nodes_detect_as_often_as_their_probability_says():
    """One node 8 and one 10 m from a target at rest, over many periods and rows."""
    scenario = Scenario.named(
        "PreDC-v0",
        positions=((42, 50), (50, 60)),
        motion="straight",
        from_m=50,
        velocity_ms=0,
        particles=2,
        search=False,
    )
    world, rows = World(scenario, threads=1), 400
    state = world.reset(np.arange(rows))
    cluster = Cluster(np.zeros(rows, int), np.ones((rows, 1), int))
    heard = np.zeros((scenario.periods, rows, 2), bool)
    for k in range(scenario.periods):
        state, outcome = world.step(state, cluster, donate=True)
        for j in range(2):
            heard[k, np.arange(rows), state.reports.node[:, j]] |= state.reports.count > j
        np.testing.assert_array_equal(outcome.detections, heard[k].sum(axis=1))
    n = rows * scenario.periods
    for node, p in enumerate((0.6, 0.6 * np.exp(-2))):
        assert abs(heard[:, :, node].mean() - p) < 4 * (p * (1 - p) / n) ** 0.5
    flat = heard.reshape(n, 2)
    assert abs(np.corrcoef(flat.T)[0, 1]) < 5 / n**0.5
    assert abs(np.corrcoef(heard[1:, :, 0].ravel(), heard[:-1, :, 0].ravel())[0, 1]) < 5 / n**0.5


@pytest.mark.parametrize("ceiling", [1.0, 0.6])
def test_the_probability_of_silence_against_sampling(ceiling):
    """log_miss averages over the belief; a wide belief is compared with a Monte Carlo mean."""
    scenario = Scenario.named("PreDC-v0", ceiling=ceiling, packet_success=0.5, retries=0)
    positions = np.array([[50.0, 50.0], [53.0, 58.0], [45.0, 57.0]])
    cov = np.zeros((4, 4))
    cov[np.ix_([0, 2], [0, 2])] = [[0.5, 0.2], [0.2, 0.3]]
    mean = np.array([51.0, 0, 52.0, 0])
    got = silence(mean, cov, positions, np.array([1, 2], np.int32), 2, 0, constants(scenario))
    points = np.random.default_rng(0).multivariate_normal(mean[[0, 2]], cov[np.ix_([0, 2], [0, 2])], 40_000)
    p = detection_probability(np.linalg.norm(points[:, None] - positions, axis=2), scenario)
    missed = np.prod(1 - p * [1, 0.5, 0.5], axis=1)
    slack = 0.02 * missed.mean()  # the quadrature's own error where the edge bends within the belief
    assert abs(np.exp(got) - missed.mean()) < 4 * missed.std() / len(points) ** 0.5 + slack + 1e-12


@numba.njit
def silence(mean, cov, positions, nodes, count, head, cs):
    return log_miss(cs[0].measurement, mean, cov, positions, head, nodes[:count], cs[0])


def test_the_probability_of_silence_when_nobody_is_awake():
    nobody = silence(np.zeros(4), np.eye(4), np.zeros((1, 2)), np.empty(0, np.int32), 0, -1, constants(Scenario()))
    assert nobody == pytest.approx(0, abs=1e-15)


def test_silence_of_a_sure_node_is_finite():
    scenario = Scenario.named("PreDC-v0", ceiling=1)
    args = np.zeros(4), np.zeros((4, 4)), np.zeros((1, 2)), np.empty(0, np.int32), 0, 0, constants(scenario)
    assert np.isfinite(silence(*args)) and silence(*args) < -600


def test_detection_uses_its_own_purpose():
    assert len({draws.DETECTION, draws.MEASUREMENT, draws.PACKET}) == 3
