"""The trackers of binary sensors: fixes on exact geometry, and filters against plain matrices over whole episodes."""

import numpy as np
import pytest

from wsn_env import Cluster, Scenario, World
from wsn_env.filters.least_squares import circle_centre, scalar_update
from wsn_env.papers.binary.readings import solve_pairs
from wsn_env.scenario.tracking import BOUNDARY_TRACKERS

T, R = 1.0, 60.0
F = np.array([[1, T, 0, 0], [0, 1, 0, 0], [0, 0, 1, T], [0, 0, 0, 1.0]])
G = np.array([[T * T / 2, 0], [T, 0], [0, T * T / 2], [0, T]])
Q = 0.1**2 * G @ G.T


def centre(points, radii_m=None):
    radii_m = np.full(len(points), R) if radii_m is None else radii_m
    return circle_centre(np.asarray(points, float), np.arange(len(points)), radii_m)


def scene(**overrides):
    """The paper's field and target."""
    scene = dict(motion="legs", start_m=(0, 500), legs=((50, 10, -10),), start="search", search=False, filter_q=0.1)
    return Scenario.named("Binary-v0", **(scene | overrides))


def play(scenario, keys=(3,), threads=1):
    """Everybody is awake; yields every state, the first too."""
    world = World(scenario, threads=threads)
    state = world.reset(np.array(keys, np.uint64))
    everybody = Cluster.of(np.zeros(len(keys), int), np.ones((len(keys), scenario.field.nodes), bool))
    yield state
    for _ in range(scenario.periods):
        state, _ = world.step(state, everybody)
        yield state


# --- the fix ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [3, 4, 9, 40])
def test_a_fix_is_exact_where_nodes_stand_on_a_circle(n):
    angle = np.random.default_rng(n).uniform(0, 2 * np.pi, n)
    x, y, condition, _ = centre(np.array([123.0, 45.0]) + 60 * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    assert (x, y) == pytest.approx((123, 45), abs=1e-8) and 1 <= condition < np.inf


def test_a_fix_is_exact_where_nodes_stand_at_radii_of_their_own_that_are_known():
    rng = np.random.default_rng(5)
    angle, radii_m = rng.uniform(0, 2 * np.pi, 9), rng.uniform(40, 80, 9)
    points = np.array([123.0, 45.0]) + radii_m[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    assert centre(points, radii_m)[:2] == pytest.approx((123, 45), abs=1e-8)
    assert np.hypot(*(np.array(centre(points)[:2]) - (123, 45))) > 1


@pytest.mark.parametrize("n", [4, 7, 25])
def test_all_pairs_are_centred_least_squares(n):
    points = np.random.default_rng(n).uniform(0, 500, (n, 2))
    x, y, condition, inverse = centre(points)
    oracle, its_condition = solve_pairs(points)
    np.testing.assert_allclose((x, y), oracle, rtol=1e-9)
    assert condition == pytest.approx(its_condition, rel=1e-9)
    offsets = points - points.mean(axis=0)
    np.testing.assert_allclose(np.array(inverse)[[0, 1, 1, 2]].reshape(2, 2), np.linalg.inv(offsets.T @ offsets))


def test_a_fix_moves_with_its_nodes():
    points = np.random.default_rng(0).uniform(-60, 60, (8, 2))
    np.testing.assert_allclose(np.array(centre(points + [3, -7])[:2]) - centre(points)[:2], [3, -7], atol=1e-10)


@pytest.mark.parametrize(
    "points", [[(1, 1), (2, 2), (3, 3), (7, 7)], [(5, 5)] * 4, [(0, 0), (4, 1e-9), (9, 0), (20, 0)]]
)
def test_nodes_in_a_line_fix_nothing(points):
    x, y, condition, inverse = centre(points)
    assert (x, y) == pytest.approx(tuple(np.mean(points, axis=0))) and condition == np.inf and inverse == (0, 0, 0)


# --- the filters --------------------------------------------------------------------------------------------


def matrix_update(x, p, h, z, r):
    gain = p @ h.T @ np.linalg.inv(h @ p @ h.T + r)
    return x + gain @ (z - h @ x), (np.eye(4) - gain @ h) @ p


def test_scalar_updates_are_the_kalman_update():
    rng = np.random.default_rng(1)
    root = rng.normal(size=(4, 4))
    x, p, h, r = rng.normal(size=4), root @ root.T, rng.normal(size=(3, 4)), rng.uniform(0.5, 2, 3)
    z = rng.normal(size=3)
    mean, cov = x.copy(), p.copy()
    for i in range(3):
        scalar_update(mean, cov, tuple(h[i]), z[i] - h[i] @ mean, r[i])
    expected = matrix_update(x, p, h, z, np.diag(r))
    np.testing.assert_allclose(mean, expected[0], rtol=1e-10)
    np.testing.assert_allclose(cov, expected[1], rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(cov, cov.T)


class Reference:
    """Every variant with matrices, as its paper and docstring have it; no gate."""

    def __init__(self, name, state, known):
        self.name, self.known = name, known
        self.x, self.p = state.belief.mean[0].copy(), state.belief.cov[0].copy()

    def step(self, state):
        self.x, self.p = F @ self.x, F @ self.p @ F.T + Q
        n, nodes = state.reports.count[0], state.network.positions[0]
        p = nodes[state.reports.node[0, :n][state.reports.value[0, :n, 1] == 1]]
        ones = nodes[state.reports.bitmap[0] == 1]
        if self.name == "boundary_ekf":
            self.by_ranges(p)
        else:
            self.by_position(p, ones, state.period[0])

    def by_position(self, p, ones, period):
        v, h = self.x[1::2], np.eye(4)[::2].copy()
        z, spread = None, None
        if self.name.startswith("boundary") and len(p) >= 4:
            z, condition = solve_pairs(p)
            offsets = p - p.mean(axis=0)
            spread = R**2 * (1 + v @ v * T**2 / 18) * np.linalg.inv(offsets.T @ offsets)
            if self.name == "boundary_mid":
                h[0, 1] = h[1, 3] = -T / 2
                z = z if condition <= 5 else None
            else:
                z = z + v * T / 2
        elif (self.name.startswith("centroid") or (len(p) and self.name != "boundary_mid")) and len(ones):
            z, spread = ones.mean(axis=0), R**2 / 4 / len(ones) * np.eye(2)
        if z is None:
            return
        if self.name in ("boundary_raw", "centroid"):
            self.x[::2] = z
            self.p[::2], self.p[:, ::2] = 0, 0
            self.p[np.ix_([0, 2], [0, 2])] = spread
        elif period == 1 and not self.known and self.name != "boundary_mid":
            self.x, self.p = np.array([z[0], 0, z[1], 0]), 1e4 * np.eye(4)
        else:
            self.x, self.p = matrix_update(self.x, self.p, h, z, np.eye(2))

    def by_ranges(self, p):
        if not len(p):
            return
        x, about = self.x, self.x
        for _ in range(2):
            d = about[::2] - about[1::2] * T / 2 - p
            r = np.linalg.norm(d, axis=1)
            u = d / r[:, None]
            h = np.stack([u[:, 0], -u[:, 0] * T / 2, u[:, 1], -u[:, 1] * T / 2], axis=1)
            variance = (u @ about[1::2] * T) ** 2 / 12 + 1 + (self.p[1, 1] + self.p[3, 3]) * T**2 / 24
            about, cov = matrix_update(x, self.p, h, R - r + h @ about, np.diag(variance))
        self.x, self.p = about, cov


@pytest.mark.parametrize("start", ["search", "known"])
@pytest.mark.parametrize("name", BOUNDARY_TRACKERS)
def test_every_variant_equals_plain_matrices_over_an_episode(name, start):
    reference = None
    for state in play(scene(tracker=name, start=start, nodes=450)):
        if reference is None:
            reference = Reference(name, state, start == "known")
            continue
        reference.step(state)
        np.testing.assert_allclose(state.belief.mean[0], reference.x, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(state.belief.cov[0], reference.p, rtol=1e-8, atol=1e-8)


def test_a_search_leaves_a_filter_that_knows_nothing():
    for name, p0 in (("boundary", [1e4] * 4), ("boundary_ekf", [100, 200, 100, 200])):
        state = next(play(scene(tracker=name)))
        np.testing.assert_array_equal(state.belief.cov[0], np.diag(p0))
        ones = state.network.positions[0, state.reports.bitmap[0] == 1]
        np.testing.assert_allclose(state.belief.mean[0, ::2], ones.mean(axis=0))


def test_without_boundary_nodes_a_filter_only_predicts():
    for name in BOUNDARY_TRACKERS:
        before = None
        for state in play(scene(tracker=name, legs=((1e-3, 10, -10),), start_m=(250, 250), start="known")):
            if before is not None and before.period[0] > 0 and not name.startswith("centroid"):
                assert state.reports.count[0] == 0
                np.testing.assert_array_equal(state.belief.mean[0], before.belief.predicted_mean[0])
            before = state


@pytest.mark.parametrize("name", BOUNDARY_TRACKERS)
def test_covariances_are_symmetric_and_positive(name):
    for state in play(scene(tracker=name, flip=0.01, nodes=300), keys=range(5)):
        cov = state.belief.cov
        np.testing.assert_array_equal(cov, np.swapaxes(cov, 1, 2))
        least, largest = np.linalg.eigvalsh(cov)[:, [0, -1]].T
        assert np.isfinite(largest).all() and (least >= -1e-9 * largest).all()


@pytest.mark.parametrize("name", BOUNDARY_TRACKERS)
def test_a_row_of_a_batch_is_a_batch_of_one_on_any_number_of_threads(name):
    scenario = scene(tracker=name, flip=0.002, gate_m=20.0, periods=15)
    for batch, alone in zip(play(scenario, range(20), threads=2), play(scenario, [17]), strict=True):
        assert batch.belief.row[17].tobytes() == alone.belief.row[0].tobytes()


# --- the gate -----------------------------------------------------------------------------------------------


def steady_error(**overrides):
    """Mean error of ten runs from 15 to 40 s."""
    inside = dict(start_m=(70, 430), legs=((43, 10, -10),), periods=43, filter_q=0.0)
    errors = [
        np.linalg.norm(state.belief.mean[:, ::2] - state.track[:, k, ::2], axis=1)
        for k, state in enumerate(play(scene(**(inside | overrides)), range(10)))
    ]
    return np.mean(errors[8:34])


@pytest.mark.parametrize("name", ["boundary", "boundary_mid", "boundary_ekf"])
def test_the_gate_keeps_misread_bits_out_and_the_rest_in(name):
    ungated, gated = (steady_error(tracker=name, flip=0.001, gate_m=gate) for gate in (None, 20.0))
    assert gated < 4 < 20 < ungated
    assert steady_error(tracker=name, gate_m=20.0) < 1.2 * steady_error(tracker=name) + 0.2


def test_a_gated_filter_finds_back_through_the_centroid():
    scenario = scene(tracker="boundary", gate_m=10.0, start="known", start_m=(100, 400), periods=30)
    world = World(scenario, threads=1)
    state = world.reset([5])
    for field in ("mean", "predicted_mean"):  # sure, and 200 m off
        state.belief.row[field][0, [0, 2]] += 200.0
    state.belief.row["predicted_cov"][0] = np.eye(4)
    everybody = Cluster.of(np.zeros(1, int), np.ones((1, 600), bool))
    errors = []
    for _ in range(30):
        state, outcome = world.step(state, everybody)
        errors.append(outcome.error_m[0])
    assert errors[0] > 30 and max(errors[-5:]) < 20
