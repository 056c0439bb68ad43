"""The cubature filters against the Kalman filter, textbook matrices, filterpy, and their own covariances."""

import numpy as np
import pytest
from filterpy.kalman import CubatureKalmanFilter, KalmanFilter
from scipy.linalg import sqrtm

from tests.anchors import RING, everyone, play_subsets, ring_scenario, tell
from wsn_env import Scenario, World
from wsn_env.compiled.kernels import kernel
from wsn_env.filters.cubature import ITERATIONS, TOLERANCE_M, CKFTracker, ICKFTracker
from wsn_env.filters.kalman import UKFTracker, constant_velocity
from wsn_env.filters.root import symmetric_root
from wsn_env.models.state import State

NODES = np.array(RING, float)
POSITION = np.eye(4)[::2]


def strengths(points, nodes):
    """(..., n) dB at (..., 2)."""
    d = np.linalg.norm(np.asarray(points)[..., None, :] - nodes, axis=-1)
    return -40 - 30 * np.log10(np.maximum(d, 1))


def textbook(x, p, transition, noise, nodes, z, iterations, variance):
    """Predict and correct with inverses and sums over the cubature points, as they are printed."""
    x, p = transition @ x, transition @ p @ transition.T + noise
    at, spread = x, p
    for _ in range(iterations):
        root = 2 * sqrtm(spread).real
        points = np.concatenate([at + root, at - root])
        values = strengths(points[:, ::2], nodes)
        level = values.mean(axis=0)
        cross = (points - at).T @ (values - level) / 8
        h = (np.linalg.inv(spread) @ cross).T
        rest = (values - level).T @ (values - level) / 8 - h @ spread @ h.T
        s = h @ p @ h.T + rest + variance * np.eye(len(z))
        gain = p @ h.T @ np.linalg.inv(s)
        before, at = at, x + gain @ (z - level - h @ (x - at))
        spread = p - gain @ s @ gain.T
        if np.linalg.norm((at - before)[::2]) < TOLERANCE_M:
            break
    return at, spread


@pytest.mark.parametrize("tracker", ["ckf", "ickf"])
def test_a_linear_measurement_gives_the_kalman_filter(tracker):
    scenario = Scenario.named("PreDC-v0", tracker=tracker, search=False, nodes=40, radius_m=40, periods=30)
    oracle = KalmanFilter(dim_x=4, dim_z=2)
    oracle.F, oracle.Q = constant_velocity(scenario)
    oracle.H, oracle.R = POSITION, 4 * np.eye(2)
    heard = 0
    for k, state in enumerate(play_subsets(scenario, [3])):
        if k == 0:
            oracle.x, oracle.P = state.belief.mean[0].copy(), state.belief.cov[0].copy()
            continue
        oracle.predict()
        for value in tell(state)[1]:
            oracle.update(value)
            heard += 1
        np.testing.assert_allclose(state.belief.mean[0], oracle.x, atol=1e-9)
        np.testing.assert_allclose(state.belief.cov[0], oracle.P, atol=1e-9)
    assert heard > 100


@pytest.mark.parametrize(("tracker", "iterations"), [("ckf", 1), ("ickf", ITERATIONS)])
def test_strengths_give_the_textbooks_cubature_filter(tracker, iterations):
    scenario = ring_scenario(tracker=tracker, start_sd_m=10.0, start_sd_ms=3.0)
    matrices = constant_velocity(scenario)
    x = p = None
    for k, state in enumerate(play_subsets(scenario, [5])):
        if k > 0:
            nodes, values = tell(state)
            x, p = textbook(x, p, *matrices, nodes, values[:, 0], iterations, 9.0)
            np.testing.assert_allclose(state.belief.mean[0], x, rtol=1e-7, atol=1e-7)
            np.testing.assert_allclose(state.belief.cov[0], p, rtol=1e-7, atol=1e-7)
        x, p = state.belief.mean[0].copy(), state.belief.cov[0].copy()


def test_filterpys_cubature_filter_is_near():
    """It keeps the points drawn before the process noise was added, so that it is only near."""
    scenario = ring_scenario(tracker="ckf", start_sd_m=10.0, start_sd_ms=3.0)
    transition, noise = constant_velocity(scenario)
    other = CubatureKalmanFilter(4, 8, 0.5, lambda x: strengths(x[::2], NODES), lambda x, dt: transition @ x)
    other.Q, other.R = noise, 9 * np.eye(8)
    world = World(scenario, threads=1)
    state = world.reset([5])
    other.x, other.P = state.belief.mean[0][:, None].copy(), state.belief.cov[0].copy()
    for _ in range(scenario.periods):
        state, _ = world.step(state, everyone(1))
        other.predict()
        other.update(tell(state)[1][:, :1])
        assert 0 < np.linalg.norm((state.belief.mean[0] - other.x[:, 0])[::2]) < 1.5


def corrected(tracker, mean, cov, values, times=1, nodes=NODES):
    """Beliefs of as many rows after one period; `times` counts the measurement more than once."""
    scenario = ring_scenario(filter_q=0.0)
    rows = len(values)
    state = State.zeros(rows=rows, nodes=8, reports=8)
    state.belief.mean[:], state.belief.cov[:] = mean, cov
    state.network.positions[:] = nodes
    state.reports.count[:], state.reports.node[:], state.reports.value[:, :, 0] = 8, np.arange(8), values
    for i in range(times):
        if i > 0:  # undo the prediction
            back = np.linalg.inv(constant_velocity(scenario)[0])
            state.belief.mean[:] = state.belief.mean @ back.T
            state.belief.cov[:] = back @ state.belief.cov @ back.T
        tracker(scenario).correct(state.key, state.period, state.belief, state.network, state.reports, None)
    return state.belief


def test_covariances_are_honest_unless_a_measurement_is_counted_again():
    rng, rows = np.random.default_rng(1), 3000
    mean = np.array([60.0, 0, 110, 0])
    cov = np.diag([15.0, 1, 15, 1]) ** 2
    truth = rng.multivariate_normal(mean, cov, rows)
    truth[:, ::2] += 0.5 * truth[:, 1::2]
    values = strengths(truth[:, ::2], NODES) + rng.normal(0, 3, (rows, 8))
    nees = {}
    for name, tracker, times in (("ckf", CKFTracker, 1), ("ickf", ICKFTracker, 1), ("again", CKFTracker, 4)):
        belief = corrected(tracker, mean, cov, values, times)
        offset = (belief.mean - truth)[:, ::2]
        nees[name] = np.einsum("bi,bij,bj->b", offset, np.linalg.inv(belief.cov[:, ::2, ::2]), offset).mean() / 2
    doubt = 4 / rows**0.5  # chi squared of 2 has a variance of 4
    assert abs(nees["ckf"] - 1) < 0.1 + doubt and abs(nees["ickf"] - 1) < 0.1 + doubt
    assert nees["again"] > 1.5


def test_iteration_pays_with_a_poor_start():
    """From the field's middle with precise strengths, the first 5 s: one fit is misled by its own wide prior."""
    rms = {}
    for tracker in ("ckf", "ickf"):
        scenario = ring_scenario(tracker=tracker, noise_db=0.5, start="field", periods=10)
        world = World(scenario, threads=1)
        state = world.reset(np.arange(30))
        square = []
        for _ in range(scenario.periods):
            state, outcome = world.step(state, everyone(30))
            square.append(outcome.error_m**2)
        rms[tracker] = np.sqrt(np.mean(square))
    assert rms["ickf"] < 3 < 7 < rms["ckf"]


@pytest.mark.parametrize("tracker", ["ckf", "ickf"])
@pytest.mark.parametrize("start", ["known", "field", "fix"])
def test_a_row_is_the_same_alone_and_in_a_batch_on_any_number_of_threads(tracker, start):
    scenario = ring_scenario(tracker=tracker, start=start, periods=5)
    keys = np.arange(20, dtype=np.uint64)
    batch = World(scenario, threads=2)
    alone = World(scenario, threads=1)
    many, one = batch.reset(keys), alone.reset(keys[7:8])
    for _ in range(5):
        many, one = batch.step(many, everyone(20))[0], alone.step(one, everyone(1))[0]
        assert many.belief.row[7:8].tobytes() == one.belief.row.tobytes()


@pytest.mark.parametrize("tracker", [CKFTracker, ICKFTracker])
def test_a_belief_without_doubt_stays_as_it_is(tracker):
    mean = np.array([60.0, 1, 110, 2])
    belief = corrected(tracker, mean, np.zeros((4, 4)), strengths(np.array([[50.0, 100]]), NODES))
    np.testing.assert_allclose(belief.mean[0], [60.5, 1, 111, 2], atol=1e-9)
    assert np.abs(belief.cov[0]).max() < 1e-20


SWAPPED = [2, 3, 0, 1]  # y, vy, x, vx


@pytest.mark.parametrize("tracker", [CKFTracker, ICKFTracker, UKFTracker])
def test_swapped_axes_give_the_swapped_belief(tracker):
    """Points along the columns of Cholesky's factor depend on the order of the axes: metres here."""
    rng = np.random.default_rng(2)
    draw = rng.normal(size=(50, 4, 4)) * np.array([20.0, 4, 20, 4])[:, None]
    mean, cov = rng.uniform(20, 180, (50, 4)) * (1, 0.05, 1, 0.05), draw @ np.swapaxes(draw, 1, 2)
    values = strengths(mean[:, ::2], NODES) + rng.normal(0, 3, (50, 8))
    one = corrected(tracker, mean, cov, values)
    other = corrected(tracker, mean[:, SWAPPED], cov[:, SWAPPED][:, :, SWAPPED], values, nodes=NODES[:, ::-1])
    np.testing.assert_allclose(other.mean[:, SWAPPED], one.mean, rtol=1e-7, atol=1e-6)
    np.testing.assert_allclose(other.cov[:, SWAPPED][:, :, SWAPPED], one.cov, rtol=1e-7, atol=1e-5)


root_and_inverse = kernel(lambda cov, root, inverse: symmetric_root(cov, root, inverse))


@pytest.mark.parametrize("variances", [(9.0, 4, 1, 1), (1e4, 1e-6, 25, 3), (5.0, 5, 5, 5), (7.0, 2, 0, 0)])
def test_the_root_is_symmetric_and_its_square_the_covariance(variances):
    basis = np.linalg.qr(np.random.default_rng(4).normal(size=(4, 4)))[0]
    cov = (basis * variances) @ basis.T
    cov, root, inverse = 0.5 * (cov + cov.T), np.empty((4, 4)), np.empty((4, 4))
    root_and_inverse(cov, root, inverse)
    np.testing.assert_array_equal(root, root.T)
    np.testing.assert_allclose(root @ root, cov, atol=1e-12 * max(variances))
    np.testing.assert_allclose(inverse @ root, np.eye(4), atol=1e-5)
