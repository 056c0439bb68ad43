"""The particle filter against exact filters, plain NumPy and its own theory."""

import numba
import numpy as np
import pytest

from tests.worlds import leaves
from wsn_env import Scenario, World, make_policy
from wsn_env.compiled.kernels import fast
from wsn_env.evaluation.rollout import episodes
from wsn_env.filters import kernels
from wsn_env.filters.particle import ParticleTracker
from wsn_env.models.detection.base import weigh_detection, weigh_silence
from wsn_env.models.measurement.base import node_at
from wsn_env.models.motion.prediction import predict_moments
from wsn_env.models.state import State
from wsn_env.scenario.constants import constants
from wsn_env.scenario.sensing import detection_probability

NODES = np.array([[40.0, 50.0], [55.0, 45.0], [52.0, 60.0], [47.0, 41.0]])
P0 = np.diag([1.0, 0.01, 1.0, 0.01])
START = np.array([48.0, 0.5, 50.0, -0.4])
F = np.array([[1, 1, 0, 0], [0, 1, 0, 0], [0, 0, 1, 1], [0, 0, 0, 1.0]])
G = np.array([[0.5, 0], [1, 0], [0, 0.5], [0, 1]])


def weighted_cloud(belief, row=0):
    """Particles (P, 4) and normalised weights (P,) of a row."""
    weights = np.exp(belief.log_weights[row].astype(float))
    return belief.particles[row].T.astype(float), weights / weights.sum()


class Filter:
    """A tracker of one motion with `rows` clouds that all see the same reports but have keys of their own."""

    def __init__(self, rows=1, start=START, cov=P0, key=0, fast=False, **overrides):
        self.scenario = Scenario.named("PreDC-v0", manoeuvre_q=None, **overrides)
        self.tracker = ParticleTracker(self.scenario, fast=fast)
        particles, self.rows, self.period = self.tracker.particles, rows, 0
        self.keys = np.arange(key, key + rows).astype(np.uint64)
        self.state = State.zeros(rows=rows, nodes=len(NODES), reports=len(NODES), particles=particles)
        self.state.network.positions[:] = NODES
        self.belief = self.state.belief
        self.belief.mean[:], self.belief.cov[:] = start, cov
        self.tracker.start(self.keys, self._periods(), np.ones(rows, bool), self.belief)
        self._predict()

    def _periods(self):
        return np.full(self.rows, self.period)

    def _predict(self):
        b = self.belief
        for row in range(self.rows):
            q = self.scenario.filter_q
            predict_moments(b.mean[row], b.cov[row], 1.0, q, b.predicted_mean[row], b.predicted_cov[row])

    def step(self, reports):
        """A period with [(node, x, y) or (node, strength, 0)]; returns which rows were resampled."""
        self.period += 1
        network, told = self.state.network, self.state.reports
        told.count[:] = len(reports)
        for j, (i, *z) in enumerate(reports):
            told.node[:, j], told.value[:, j] = i, z
        resampled = np.zeros(self.rows, bool)
        self.tracker.correct(self.keys, self._periods(), self.belief, network, told, resampled)
        self._predict()
        return resampled


def walk(periods, seed=0, noise=2.0):
    """Position reports of two nodes a period about a straight way."""
    rng = np.random.default_rng(seed)
    truth, out = START + [0.7, 0.05, -0.5, 0.1], []
    for _ in range(periods):
        truth = F @ truth
        out.append([(i, *(truth[::2] + noise * rng.standard_normal(2))) for i in (0, 2)])
    return out


def kalman(reports, q, noise=2.0):
    """The exact posterior, by the textbook's matrices."""
    x, p, h = START.copy(), P0.copy(), np.eye(4)[::2]
    for period in reports:
        x, p = F @ x, F @ p @ F.T + q * q * G @ G.T
        for _, *z in period:
            k = p @ h.T @ np.linalg.inv(h @ p @ h.T + noise**2 * np.eye(2))
            x, p = x + k @ (z - h @ x), p - k @ h @ p
    return x, p


def test_the_start_is_drawn_from_the_prior():
    filter = Filter(rows=40)
    clouds = filter.belief.particles.transpose(0, 2, 1).reshape(-1, 4)
    n = len(clouds)
    assert (np.abs(clouds.mean(axis=0) - START) < 4 * (np.diag(P0) / n) ** 0.5).all()
    cov = np.cov(clouds.T)
    assert (np.abs(np.diag(cov) / np.diag(P0) - 1) < 4 * (2 / n) ** 0.5).all()
    assert np.abs(np.corrcoef(clouds.T) - np.eye(4)).max() < 5 / n**0.5
    assert (filter.belief.log_weights == 0).all()


def test_a_correlated_start_is_drawn_from_the_prior():
    prior = np.zeros((4, 4))
    prior[:2, :2], prior[2:, 2:] = [[2.0, 0.3], [0.3, 0.09]], [[1.0, -0.1], [-0.1, 0.02]]
    clouds = Filter(rows=40, cov=prior).belief.particles.transpose(0, 2, 1).reshape(-1, 4)
    se = np.sqrt((np.outer(np.diag(prior), np.diag(prior)) + prior**2) / len(clouds))
    assert (np.abs(np.cov(clouds.T) - prior) < 5 * se).all()


def test_joint_fusion_of_positions_is_the_kalman_filter():
    reports, rows = walk(20), 60
    filter = Filter(rows=rows, particles=5000)
    for period in reports:
        filter.step(period)
    mean, cov = kalman(reports, q=0.05)
    standard_error = filter.belief.mean.std(axis=0, ddof=1) / rows**0.5
    assert (np.abs(filter.belief.mean.mean(axis=0) - mean) < 3 * standard_error).all()
    scale = np.sqrt(np.outer(np.diag(cov), np.diag(cov)))
    assert (np.abs(filter.belief.cov.mean(axis=0) - cov) / scale).max() < 0.05
    assert (standard_error < 0.05 * np.diag(cov) ** 0.5).all()  # or the first line could not fail


def test_prediction_alone_is_the_kalman_prediction():
    rows = 60
    filter = Filter(rows=rows, filter_q=0.3)
    for _ in range(10):
        assert not filter.step([]).any()
    mean, cov = kalman([[]] * 10, q=0.3)
    standard_error = filter.belief.mean.std(axis=0, ddof=1) / rows**0.5
    assert (np.abs(filter.belief.mean.mean(axis=0) - mean) < 4 * standard_error).all()
    scale = np.sqrt(np.outer(np.diag(cov), np.diag(cov)))
    assert (np.abs(filter.belief.cov.mean(axis=0) - cov) / scale).max() < 4 * (2 / rows / 5000) ** 0.5
    assert filter.belief.n_eff == pytest.approx(5000)


def test_the_error_falls_with_the_root_of_the_number_of_particles():
    counts, rows = np.array([500, 2000, 8000, 32000]), 64
    reports = walk(6, seed=3)
    mean = kalman(reports, q=0.05)[0]
    errors = []
    for particles in counts:
        filter = Filter(rows=rows, particles=particles, key=particles)
        for period in reports:
            filter.step(period)
        errors.append((filter.belief.mean - mean)[:, ::2].std())
    slope = np.polyfit(np.log(counts), np.log(errors), 1)[0]
    # ln of a sd from 2 x 64 values has a standard error of 1 / sqrt(2 x 128).
    standard_error = (1 / 256 / ((np.log(counts) - np.log(counts).mean()) ** 2).sum()) ** 0.5
    assert abs(slope + 0.5) < 4 * standard_error


# --- one step against plain NumPy, given the same particles ---------------------------------------------------

MEASUREMENTS = {
    "position": [(0, 49.0, 50.5), (1, 47.2, 51.0), (3, 50.3, 48.4)],
    "rssi": [(0, -61.0, 0.0), (1, -63.5, 0.0), (3, -60.2, 0.0)],
    "rssi_power": [(0, 1.5, 0.0), (1, 1.4, 0.0), (3, 0.9, 0.0)],
}


def log_likelihood(cloud, measurement, node, value):
    distance = np.maximum(np.linalg.norm(cloud[:, ::2] - NODES[node], axis=1), 1.0)
    if measurement == "position":
        return -((cloud[:, ::2] - value) ** 2).sum(axis=1) / (2 * 2.0**2)
    if measurement == "rssi":
        return -((value[0] - (-40 - 25 * np.log10(distance))) ** 2) / (2 * 3.0**2)
    return -((value[0] - 100 / distance**2) ** 2) / (2 * 0.2**2)


def moments(cloud, log_weights):
    w = np.exp(log_weights - log_weights.max())
    w /= w.sum()
    mean = w @ cloud
    return mean, (cloud - mean).T @ (w[:, None] * (cloud - mean)), 1 / (w**2).sum()


@pytest.mark.parametrize("fusion", ["joint", "pooled"])
@pytest.mark.parametrize("measurement", list(MEASUREMENTS))
@pytest.mark.parametrize("particles", [2, 37, 1000])
def test_a_step_equals_plain_numpy(measurement, fusion, particles):
    """Without process noise the prediction is F x; nothing is resampled, so that the second period's weights go on."""
    filter = Filter(
        particles=particles, measurement=measurement, fusion=fusion, filter_q=0.0, resample_below=0, cov=4 * P0
    )
    cloud = filter.belief.particles[0].T.astype(float)
    log_weights = np.zeros(particles)
    for period in (MEASUREMENTS[measurement], MEASUREMENTS[measurement][:2], []):
        assert not filter.step(period).any()
        cloud = cloud @ F.T
        for j, (node, *value) in enumerate(period):
            own = log_likelihood(cloud, measurement, node, np.array(value))
            log_weights += own if fusion == "joint" else np.where(np.arange(particles) % len(period) == j, own, 0)
        mean, cov, n_eff = moments(cloud, log_weights)
        np.testing.assert_allclose(filter.belief.mean[0], mean, atol=2e-4)
        np.testing.assert_allclose(filter.belief.cov[0], cov, atol=2e-4 * cov.max() + 1e-6)  # float32 sums
        np.testing.assert_allclose(filter.belief.n_eff[0], n_eff, rtol=1e-3)
        points, weights = weighted_cloud(filter.belief)
        np.testing.assert_allclose(points, cloud, atol=1e-4)
        np.testing.assert_allclose(weights @ points, mean, atol=2e-4)


def test_the_floor_holds_for_particles_on_top_of_a_node():
    for measurement, value in (("rssi", -40.0), ("rssi_power", 100.0)):
        filter = Filter(
            particles=500,
            measurement=measurement,
            filter_q=0.0,
            resample_below=0,
            start=np.array([40.0, 0, 50.0, 0]),
            cov=0.01 * P0,
        )
        filter.step([(0, value, 0)])
        assert filter.belief.n_eff[0] == pytest.approx(500, rel=1e-5)  # all within a metre: all alike


@pytest.mark.parametrize("unit", [1e-28, 1e-9, 1e9])
def test_power_may_be_measured_in_any_unit(unit):
    """Amplitude, noise and reports in another unit give the same posterior."""
    usual, other = (
        Filter(measurement="rssi_power", particles=300, resample_below=0, amplitude=100 * u, noise=0.2 * u)
        for u in (1, unit)
    )
    usual.step(MEASUREMENTS["rssi_power"])
    other.step([(node, value * unit, 0) for node, value, _ in MEASUREMENTS["rssi_power"]])
    np.testing.assert_allclose(other.belief.mean, usual.belief.mean, rtol=1e-5)
    np.testing.assert_allclose(other.belief.n_eff, usual.belief.n_eff, rtol=1e-4)
    assert usual.belief.n_eff[0] < 250  # the reports did say something


@pytest.mark.parametrize("fusion", ["joint", "pooled"])
@pytest.mark.parametrize("measurement", list(MEASUREMENTS))
@pytest.mark.parametrize("particles", [2, 37, 5000])
def test_fast_kernels_agree_to_rounding(measurement, fusion, particles):
    """One period with process noise. float32 rounds positions of 50 m to 4e-6 m and log weights of -100 to 8e-6."""
    chosen = dict(particles=particles, measurement=measurement, fusion=fusion, resample_below=0)
    strict, quick = Filter(**chosen), Filter(fast=True, **chosen)
    strict.step(MEASUREMENTS[measurement])
    quick.step(MEASUREMENTS[measurement])
    np.testing.assert_allclose(quick.belief.particles, strict.belief.particles, atol=2e-5)
    np.testing.assert_allclose(quick.belief.log_weights, strict.belief.log_weights, atol=1e-4, rtol=1e-5)
    np.testing.assert_allclose(quick.belief.mean, strict.belief.mean, atol=5e-5)
    np.testing.assert_allclose(quick.belief.cov, strict.belief.cov, atol=5e-5)
    np.testing.assert_allclose(quick.belief.n_eff, strict.belief.n_eff, rtol=1e-4)


def test_fast_and_strict_kernels_have_caches_of_their_own():
    strict, quick = kernels.filter_rows, fast(kernels.filter_rows)
    assert quick is fast(kernels.filter_rows) and quick is not strict
    assert type(quick) is type(strict)
    assert quick.py_func.__qualname__ != strict.py_func.__qualname__  # the folder's name


# --- what detection and silence tell --------------------------------------------------------------------------


def teller(weigh_detection, weigh_silence):
    @numba.njit
    def tell(x, log_weights, positions, delivery, constants):
        """Weigh by a detection, or where `delivery` is not negative by silence."""
        c, node = constants[0], node_at(positions, 0)
        if delivery < 0:
            weigh_detection(c.detection, c.measurement, x, log_weights, node)
        else:
            weigh_silence(c.detection, c.measurement, x, log_weights, node, delivery)
        return log_weights

    return tell


TELLERS = {
    "strict": teller(weigh_detection, weigh_silence),
    "fast": teller(weigh_detection.fast_twin, weigh_silence.fast_twin),
}


@pytest.mark.parametrize("mode", TELLERS)
@pytest.mark.parametrize(
    "detection",
    [
        {},
        {"ceiling": 1.0},
        {"decay": 5.0, "decay_power": 0.5},
        {"decay": 0.0},
        {"decay": 1e-3, "edge_power": 0.1},
        {"radius_m": 300.0, "softness": 1.0},
    ],
)
def test_detection_and_silence_weigh_like_plain_numpy(detection, mode):
    """Distances are off by half an ulp, 2e-5 m at 300 m; p may change by a factor e within a decimetre."""
    scenario = Scenario.named("PreDC-v0", **detection)
    record, told = constants(scenario), TELLERS[mode]
    inner, reach = record["detection"]["inner_m"][0], record["detection"]["reach_m"][0]
    edges = np.array([0, inner, reach, 2 * reach, 1e6], np.float32)
    neighbours = np.nextafter(edges[1:3], np.float32(0)), np.nextafter(edges[1:3], np.float32(1e9))
    distances = np.concatenate([edges, *neighbours, np.linspace(0, 1.2 * reach, 10_000)]).astype(np.float32)
    x = np.zeros((4, len(distances)), np.float32)
    x[2] = distances
    p = np.clip(detection_probability(distances.astype(float), scenario), 1e-6, 1 - 1e-6)
    for delivery in (-1.0, 0.0, 0.8, 1.0):
        weights = told(x, np.zeros(len(distances), np.float32), np.zeros((1, 2)), delivery, record)
        exact = np.log(p) if delivery < 0 else np.log1p(-delivery * p)
        assert (weights <= 0).all()
        np.testing.assert_allclose(weights, exact, atol=1e-4)
    again = told(x, weights.copy(), np.zeros((1, 2)), 1.0, record)
    np.testing.assert_allclose(again, 2 * weights, rtol=1e-6)  # added, not set


@pytest.mark.parametrize("receiver", ["head", "sink"])
@pytest.mark.parametrize("nodes", [[], [0], [2, 3], [0, 2, 3]])
def test_every_awake_node_weighs_by_its_report_or_by_its_silence(nodes, receiver):
    """The head is node 2, the members are 0, 1 and 3, of which 1 has no energy; measurements that tell nothing.

    What the head has to say it hears itself; a sink may not.
    """
    sensing = dict(radius_m=10.0, packet_success=0.7, retries=0, noise_m=1e9, receiver=receiver)
    filter = Filter(particles=300, silent_information=True, resample_below=0, **sensing)
    network = filter.state.network
    network.battery[:] = [1.0, 0.0, 1.0, 1.0]
    network.head[:], network.n_members[:], network.members[0, :3] = 2, 3, [0, 1, 3]
    filter.step([(node, 0.0, 0.0) for node in nodes])
    x, weights = filter.belief.particles[0], filter.belief.log_weights[0]
    exact = np.zeros(300)
    for node in (2, 0, 3):
        p = detection_probability(np.hypot(*(x[::2].T - NODES[node]).T), filter.scenario)
        p = np.clip(p, 1e-6, 1 - 1e-6)
        exact += np.log(p) if node in nodes else np.log1p(-p * (1 if (node, receiver) == (2, "head") else 0.7))
    np.testing.assert_allclose(weights, exact - exact.max(), atol=1e-4)


def test_silence_tells_nothing_without_a_head():
    filter = Filter(particles=300, silent_information=True, resample_below=0)
    filter.state.network.head[:] = -1
    filter.step([])
    assert (filter.belief.log_weights == 0).all()


def test_silence_tells_enough_to_lower_the_error():
    """On the same 96 episodes; the paired difference lies 3 standard errors above 0."""
    rms = {}
    for silent in (False, True):
        scenario = Scenario.named("Rssi-v0", particles=500, silent_information=silent)
        world, policy = World(scenario, threads=1), make_policy("nearest3", scenario)
        squares = [outcome.error_m**2 for _, outcome in episodes(policy, world, range(96))]
        rms[silent] = np.mean(squares, axis=0) ** 0.5
    gain = rms[False] - rms[True]
    assert gain.mean() > 3 * gain.std(ddof=1) / len(gain) ** 0.5


# --- resampling -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("particles", [2, 3, 50, 5000])
def test_resampling_is_systematic(particles):
    seen = 0
    for key in range(40 if particles < 100 else 4):
        filter = Filter(particles=particles, filter_q=0.0, key=key, resample_below=1)
        before = filter.belief.particles[0].copy()
        if not filter.step([(0, 49.5, 49.0)])[0]:
            continue
        seen += 1
        moved = before.copy()
        moved[0] += before[1]
        moved[2] += before[3]
        w = log_likelihood(moved.T.astype(float), "position", 0, np.array([49.5, 49.0]))
        w = np.exp(w - w.max())
        w /= w.sum()
        after = filter.belief.particles[0]
        names = {tuple(column): i for i, column in enumerate(moved.T)}
        ancestors = np.array([names[tuple(column)] for column in after.T])
        assert (np.diff(ancestors) >= 0).all()
        counts = np.bincount(ancestors, minlength=particles)
        assert (np.abs(counts - particles * w) < 1 + 1e-4 * particles * w).all()
        assert (filter.belief.log_weights == 0).all()
    assert seen > 0


def test_resampling_is_unbiased():
    """The mean of the counts over many offsets is P w."""
    rows, particles = 3000, 4
    filter = Filter(rows=rows, particles=particles, filter_q=0.0, resample_below=1)
    filter.belief.particles[:] = filter.belief.particles[0]
    before = filter.belief.particles[0].copy()
    assert filter.step([(0, 50.0, 49.0)]).all()
    before[0] += before[1]
    before[2] += before[3]
    w = np.exp(log_likelihood(before.T.astype(float), "position", 0, np.array([50.0, 49.0])))
    expected = particles * w / w.sum()
    counts = (filter.belief.particles[:, 0, :, None] == before[0]).sum(axis=1)
    se = np.maximum(counts.std(axis=0), 1e-3) / rows**0.5
    assert (np.abs(counts.mean(axis=0) - expected) < 4 * se + 1e-4).all()


def test_resampling_is_triggered_below_two_thirds():
    happened = []
    for key in range(30):
        filter = Filter(particles=200, key=key, cov=P0 * (0.2 + 0.1 * key))
        resampled = filter.step([(0, 49.0, 50.0), (1, 48.0, 50.0)])[0]
        assert resampled == (filter.belief.n_eff[0] < 2 / 3 * 200)
        happened.append(resampled)
    assert 0 < sum(happened) < 30


# --- degenerate cases -----------------------------------------------------------------------------------------


def assert_sane(belief):
    for _, array in leaves(belief):
        assert np.isfinite(array).all()
    assert (belief.log_weights <= 0).all() and (belief.n_eff >= 1 - 1e-6).all()
    assert (np.diagonal(belief.cov, axis1=1, axis2=2) >= 0).all()
    np.testing.assert_array_equal(belief.cov, belief.cov.transpose(0, 2, 1))
    assert (np.diagonal(belief.predicted_cov, axis1=1, axis2=2) >= 0).all()
    variance = np.diagonal(belief.cov, axis1=1, axis2=2)
    most = variance[:, :, None] * variance[:, None, :]
    assert (belief.cov**2 <= most * (1 + 1e-12)).all()  # no correlation beyond 1


@pytest.mark.parametrize("particles", [2, 3, 16, 17, 300])
@pytest.mark.parametrize("fusion", ["joint", "pooled"])
@pytest.mark.parametrize(
    ("measurement", "reports"),
    [
        ("position", [(0, 1e5, -1e5), (1, -1e5, 1e5)]),
        ("position", [(0, 0.0, 0.0), (1, 100.0, 100.0), (2, 0.0, 100.0)]),
        ("rssi", [(0, 500.0, 0), (1, -5000.0, 0)]),
        ("rssi_power", [(0, 1e6, 0), (3, -1e6, 0)]),
        ("position", []),
    ],
)
def test_far_reports_leave_a_finite_belief(measurement, reports, fusion, particles):
    filter = Filter(rows=3, particles=particles, measurement=measurement, fusion=fusion)
    for k in range(6):
        filter.step(reports if k % 2 == 0 else [])
        assert_sane(filter.belief)


@pytest.mark.parametrize("noise_m", [1e-3, 1e-2, 1e6, 1e9])
def test_any_noise_leaves_a_finite_belief(noise_m):
    filter = Filter(rows=3, particles=50, noise_m=noise_m)
    for _ in range(4):
        filter.step([(0, 49.0, 50.0), (1, 49.0, 50.0)])
        assert_sane(filter.belief)


def test_log_weights_that_are_never_resampled_stay_finite():
    filter = Filter(rows=2, particles=50, resample_below=0, noise_m=1e-3)
    for _ in range(100):
        filter.step([(i, 1e5, 1e5) for i in range(4)])
    assert_sane(filter.belief)


def test_more_members_than_particles():
    filter = Filter(particles=2, fusion="pooled", filter_q=0.0, resample_below=0)
    cloud = filter.belief.particles[0].T.astype(float) @ F.T
    reports = [(0, 49.0, 50.0), (1, 47.0, 50.0), (2, 90.0, 90.0)]
    filter.step(reports)
    own = [log_likelihood(cloud[i : i + 1], "position", i, np.array(reports[i][1:]))[0] for i in range(2)]
    np.testing.assert_allclose(filter.belief.mean[0], moments(cloud, np.array(own))[0], atol=1e-4)


def test_a_collapsed_start_is_a_point():
    filter = Filter(particles=20, cov=np.zeros((4, 4)), filter_q=0.0)
    np.testing.assert_array_equal(filter.belief.particles[0], np.tile(START[:, None], 20).astype(np.float32))
    filter.step([(0, 49.0, 50.0)])
    assert_sane(filter.belief)


def test_relocation_keeps_velocities_and_weights():
    filter = Filter(rows=2, particles=5000, resample_below=0)
    filter.step([(0, 49.0, 50.0)])
    before = filter.belief.copy()
    belief = filter.belief
    belief.mean[:, ::2], belief.cov[:] = [20.0, 70.0], np.diag([25.0, 0.01, 9.0, 0.01])
    filter.tracker.relocate(filter.keys, np.ones(2, int), np.array([False, True]), belief)
    np.testing.assert_array_equal(belief.particles[0], before.particles[0])
    np.testing.assert_array_equal(belief.particles[:, 1::2], before.particles[:, 1::2])
    np.testing.assert_array_equal(belief.log_weights, before.log_weights)
    x, y = belief.particles[1, 0].astype(float), belief.particles[1, 2].astype(float)
    for z, mean, sd in ((x, 20, 5), (y, 70, 3)):
        assert abs(z.mean() - mean) < 4 * sd / 5000**0.5
        assert abs(z.std() / sd - 1) < 4 / 10_000**0.5
    assert abs(np.corrcoef(x, y)[0, 1]) < 5 / 5000**0.5


@pytest.mark.parametrize("particles", [2, 3, 20])
def test_rounding_does_not_make_a_collapsed_cloud_impossible(particles):
    """Copies of one particle: the sums' rounding is all that is left of the covariance."""
    for key in range(100):
        filter = Filter(rows=1, particles=particles, key=key, cov=1e-12 * P0, filter_q=0.0)
        filter.belief.particles[0, 1::2] += np.float32(0.1 + 0.01 * key)
        for _ in range(5):
            filter.step([(0, 49.0, 50.0)])
            assert_sane(filter.belief)
