"""Detection by a threshold on the measured level."""

import numba
import numpy as np
import pytest
from scipy.stats import norm

from tests.test_particle import NODES, Filter
from wsn_env import Cluster, Scenario, ScenarioError, World
from wsn_env.models.detection.base import weigh_silence
from wsn_env.models.detection.radius import Detection
from wsn_env.models.detection.threshold import Threshold
from wsn_env.models.measurement.base import node_at
from wsn_env.models.measurement.position import Position
from wsn_env.models.measurement.rssi import Rssi
from wsn_env.models.measurement.sonar import Sonar
from wsn_env.scenario.constants import constants
from wsn_env.scenario.sensing import detection_probability

UNDERWATER = Scenario.named("Underwater-v0")
ALPHA = 1.18703e-3


def level(distance):
    """Of Underwater-v0."""
    d = np.maximum(distance, 1.0)
    return 120 - 15 * np.log10(d) - ALPHA * d


@pytest.mark.parametrize(("threshold_db", "metres"), [(80, 429), (85, 207), (88, 132), (92, 72)])
def test_the_radius_is_where_the_mean_level_is_at_the_threshold(threshold_db, metres):
    scenario = UNDERWATER.override(threshold_db=threshold_db)
    assert 0 <= scenario.radius_m - metres < 1
    assert level(scenario.radius_m) == pytest.approx(threshold_db, abs=1e-6)
    assert constants(scenario)["radius_m"] == scenario.radius_m
    assert norm.cdf((level(scenario.reach_m) - threshold_db) / 3) == pytest.approx(1e-6, rel=1e-3)


@pytest.mark.interpreted
@pytest.mark.parametrize("measurement", [Sonar(), Rssi(), Sonar(noise_db=0.01), Rssi(exponent=4, floor_m=5)])
def test_detection_probability_is_the_normal_distributions(measurement):
    threshold = Threshold(measurement.mean_db(40.0))
    d = np.concatenate([[0.0, measurement.floor_m, 40.0], np.linspace(0.0, 400.0, 3001)])
    mean = np.array([measurement.mean_db(x) for x in d])
    p = detection_probability(d, Scenario(detection=threshold, measurement=measurement))
    exact = norm.cdf((mean - threshold.threshold_db) / measurement.noise_db)
    np.testing.assert_allclose(p, np.where(exact < 1e-6, 0, exact), rtol=1e-9, atol=2e-6 * (exact < 1.1e-6).max())
    assert p[2] == pytest.approx(0.5, abs=1e-9)


def test_what_is_reported_is_what_exceeds_the_threshold():
    """Beside a twin of the world in which every node always reports: the same draws, so the same levels."""
    threshold_db = 85.0
    hears_all = UNDERWATER.override(detection=Detection(radius_m=3000.0, ceiling=1.0), hop_m=3000.0, search=False)
    worlds = [World(s, threads=1) for s in (UNDERWATER.override(hop_m=3000.0, search=False), hears_all)]
    states = [world.reset(np.arange(20)) for world in worlds]
    everybody = Cluster(np.zeros(20, int), np.tile(np.arange(64), (20, 1)))
    spoke = 0
    for _ in range(10):
        states = [world.step(state, everybody)[0] for world, state in zip(worlds, states, strict=True)]
        for row in range(20):
            mine, all_of_them = (
                {int(i): float(z[0]) for i, z in zip(s.reports.node[row, :n], s.reports.value[row, :n], strict=True)}
                for s, n in ((state, state.reports.count[row]) for state in states)
            )
            assert len(all_of_them) == 64
            assert mine == {node: z for node, z in all_of_them.items() if z > threshold_db}
            spoke += len(mine)
    assert 500 < spoke < 20 * 10 * 64


def test_nodes_report_as_often_as_their_probability_says():
    rows, periods = 400, 25
    places = ((500, 500), (650, 500), (750, 500))
    chosen = dict(positions=places, motion="straight", from_m=500, velocity_ms=0.0, periods=periods, search=False)
    scenario = UNDERWATER.override(**chosen, particles=2, hop_m=1000.0)
    world, cluster = World(scenario, threads=1), Cluster(np.zeros(rows, int), np.tile([1, 2], (rows, 1)))
    state, heard = world.reset(np.arange(rows)), np.zeros(3)
    for _ in range(periods):
        state, _ = world.step(state, cluster, donate=True)
        for node in range(3):
            slots = np.arange(3) < state.reports.count[:, None]
            heard[node] += ((state.reports.node == node) & slots).sum()
    n = rows * periods
    for node, distance in enumerate((0.0, 150.0, 250.0)):
        p = norm.cdf((level(distance) - 85) / 3)
        assert abs(heard[node] / n - p) <= 4 * (p * (1 - p) / n) ** 0.5


def quiet(weigh_silence):
    @numba.njit
    def tell(x, log_weights, positions, delivery, constants):
        c = constants[0]
        weigh_silence(c.detection, c.measurement, x, log_weights, node_at(positions, 0), delivery)
        return log_weights

    return tell


@pytest.mark.parametrize("weigh", [weigh_silence, weigh_silence.fast_twin], ids=["strict", "fast"])
@pytest.mark.parametrize("changes", [{}, {"noise_db": 0.2}, {"measurement": Rssi(), "threshold_db": -70.0}])
def test_silence_weighs_like_plain_numpy(changes, weigh):
    scenario = UNDERWATER.override(**changes)
    m, threshold_db = scenario.measurement, scenario.detection.threshold_db
    distances = np.concatenate([[0, 1, 1e6], np.geomspace(0.1, 3000, 5000)]).astype(np.float32)
    x = np.zeros((4, len(distances)), np.float32)
    x[2] = distances
    z = (threshold_db - np.array([m.mean_db(float(d)) for d in distances])) / m.noise_db
    for delivery in (1.0, 0.8, 0.0):
        exact = norm.logcdf(z) if delivery == 1 else np.log1p(-delivery * norm.sf(z))
        weights = quiet(weigh)(x, np.zeros(len(distances), np.float32), np.zeros((1, 2)), delivery, constants(scenario))
        assert (weights <= 0).all() and np.isfinite(weights).all()
        slack = 2e-5 / m.noise_db * np.maximum(1, np.abs(z)) * (z < 8)  # levels of 120 dB are off by half an ulp
        assert (np.abs(weights - exact) <= 1e-6 + 1e-6 * np.abs(exact) + slack).all()
        again = quiet(weigh)(x, weights.copy(), np.zeros((1, 2)), delivery, constants(scenario))
        np.testing.assert_allclose(again, 2 * weights, rtol=1e-6)  # added, not set


@pytest.mark.interpreted
@pytest.mark.parametrize("nodes", [[], [0], [2, 3]])
def test_a_report_tells_by_its_value_and_silence_by_itself(nodes):
    """The head is node 2, the members are 0, 1 and 3, of which 1 has no energy."""
    chosen = dict(measurement="sonar", detection="threshold", threshold_db=106.0, packet_success=0.7, retries=0)
    filter = Filter(particles=300, filter_q=0.0, resample_below=0, silent_information=True, **chosen)
    network = filter.state.network
    network.battery[:] = [1.0, 0.0, 1.0, 1.0]
    network.head[:], network.n_members[:], network.members[0, :3] = 2, 3, [0, 1, 3]
    filter.step([(node, 107.0, 0.0) for node in nodes])
    x, weights = filter.belief.particles[0], filter.belief.log_weights[0]
    exact = np.zeros(300)
    for node in (2, 0, 3):
        mean = level(np.hypot(*(x[::2].T - NODES[node]).T))
        p = norm.sf((106.0 - mean) / 3) * (1.0 if node == 2 else 0.7)
        exact += -((107.0 - mean) ** 2) / 18 if node in nodes else np.log1p(-p)
    np.testing.assert_allclose(weights, exact - exact.max(), atol=2e-4)


def test_the_strongest_leads_after_a_search():
    world = World(UNDERWATER.override(start="search"), threads=1)
    keys = np.arange(50)
    state, outcome = world.restart(world.reset(keys), np.ones(50, bool), keys)
    assert (outcome.searched == 1).all() and (outcome.delivered > 0).all()
    for row in range(50):
        n = state.reports.count[row]
        assert state.network.head[row] == state.reports.node[row, :n][state.reports.value[row, :n, 0].argmax()]
        # Whom the new head cannot hear in one hop stays out.
        head = state.network.positions[row, state.network.head[row]]
        apart = np.linalg.norm(state.network.positions[row, state.reports.node[row, :n]] - head, axis=1)
        assert apart.max() <= 250
    assert (outcome.detections >= outcome.delivered).all() and (outcome.detections > outcome.delivered).any()
    assert np.median(outcome.error_m) < 120


@pytest.mark.parametrize(
    ("overrides", "says"),
    [
        (dict(detection="threshold"), ["Scenario.detection", "Rssi or Sonar", "Position"]),
        (dict(detection="threshold", measurement="rssi_power"), ["needs a measured level in dB", "RssiPower"]),
        (dict(detection="threshold", measurement="rssi"), ["Threshold.threshold_db = 85", "between the mean levels"]),
        (dict(detection="threshold", measurement="rssi", threshold_db=-900), ["Threshold.threshold_db = -900", "-215"]),
        (dict(detection="treshold"), ["Scenario.detection = 'treshold'", "did you mean threshold"]),
        (dict(measurement="sonar", frequency_khz=0.1), ["Sonar.frequency_khz = 0.1", "at least 0.4"]),
        (dict(measurement="sonar", spreading=0), ["Sonar.spreading = 0", "above 0"]),
    ],
)
def test_bad_thresholds_are_refused(overrides, says):
    with pytest.raises(ScenarioError) as problem:
        Scenario.named("PreDC-v0", **overrides)
    for words in says:
        assert words in str(problem.value)


def test_a_threshold_without_a_level_has_no_probability():
    with pytest.raises(ScenarioError, match="needs a measured level"):
        Threshold().distances_m(Position())


def test_sections_that_only_fit_together_change_together():
    loud = UNDERWATER.override(threshold_db=150.0, source_db=200.0)
    assert loud.detection == Threshold(150.0) and loud.measurement == Sonar(source_db=200.0)
    assert loud.override(threshold_db=85.0, source_db=120.0).override(lam=0.006) == UNDERWATER
