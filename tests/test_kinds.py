"""Every registered kind does what its role promises; kinds are found by themselves."""

import math
from dataclasses import dataclass

import gymnasium as gym
import numpy as np
import pytest
from numba import njit

from tests.worlds import expected, expected_gain
from wsn_env import Scenario, World, make_policy
from wsn_env.compiled import draws
from wsn_env.compiled.arrays import record
from wsn_env.filters.linear import LinearModel
from wsn_env.models import Line, Measurement, Node, ScenarioError
from wsn_env.models.detection.base import detects, mean_probability, probability, stream_of
from wsn_env.models.field import squared_distance
from wsn_env.models.kinds import constants_type, fill_constants
from wsn_env.models.library import DETECTIONS, MEASUREMENTS, MOTIONS, RADIOS
from wsn_env.models.measurement.base import node_at, sample, weigh
from wsn_env.models.radio.base import reception, relayed, transmission
from wsn_env.scenario.constants import constants
from wsn_env.scenario.tracks import Tracks

PLAIN = {name: kind for name, kind in MEASUREMENTS.kinds.items() if kind().independent}
NODE, TARGET = np.array([[40.0, 50.0]]), (46.0, 53.0)
SAMPLES = 4000


def scenario_of(name: str) -> Scenario:
    """A scenario whose nodes measure so, and that plays with it."""
    lasting = MEASUREMENTS.kinds[name].lasting_errors
    more = dict(search=False, radio="bluetooth", start="field") if lasting else {}
    return Scenario.named("PreDC-v0", measurement=name, particles=300, periods=8, nodes=60, **more)


@njit
def numbered(number, places):
    """A node where the first of some stands, whose random numbers are those of another."""
    node = node_at(places, 0)
    return Node(number, node.x, node.y, node.learnt)


@njit
def _samples(cs, places, x, y, out):
    for i in range(len(out)):
        node = numbered(i, places)
        out[i, 0], out[i, 1] = sample(cs[0].measurement, draws.stream(np.uint64(5), 1, 5), node, x, y)


@njit
def _log_likelihoods(cs, places, values, x, y, out):
    node, px, py = node_at(places, 0), np.array([x], np.float32), np.array([y], np.float32)
    for i in range(len(values)):
        weight = np.zeros(1, np.float32)
        weigh(cs[0].measurement, px, py, weight, node, values[i])
        out[i] = weight[0]


def drawn(name: str) -> tuple[Scenario, np.ndarray]:
    scenario, out = scenario_of(name), np.empty((SAMPLES, 2))
    _samples(constants(scenario), NODE, *TARGET, out)
    return scenario, out


@pytest.mark.parametrize("name", PLAIN)
def test_what_is_sampled_has_the_mean_and_the_spread_that_linearise_says(name):
    scenario, values = drawn(name)
    lines = LinearModel(scenario).lines(*TARGET, NODE, values[:1])
    for k in range(scenario.measurement.values):
        off, sd = values[:, k] - lines.expected[0, k], lines.variance[0, k] ** 0.5
        assert abs(off.mean()) < 4 * sd / SAMPLES**0.5  # four standard errors
        assert off.std() == pytest.approx(sd, rel=4 / (2 * SAMPLES) ** 0.5)


@pytest.mark.parametrize("name", PLAIN)
def test_the_likelihood_is_of_what_is_sampled(name):
    """Of Gaussian noise the mean log density at the truth is -1/2 a number, and it is lower anywhere else."""
    scenario, values = drawn(name)
    cs, k = constants(scenario), scenario.measurement.values
    at = {}
    for dx, dy in ((0, 0), (2, 0), (-2, 0), (0, 2), (0, -2)):
        out = np.empty(SAMPLES)
        _log_likelihoods(cs, NODE, values, TARGET[0] + dx, TARGET[1] + dy, out)
        at[dx, dy] = out
    assert at[0, 0].mean() == pytest.approx(-k / 2, abs=4 * (k / 2) ** 0.5 / SAMPLES**0.5 + 1e-3)
    best = at.pop((0, 0)).mean()
    assert sum(out.mean() < best - 1e-4 for out in at.values()) == 4


@pytest.mark.parametrize("name", PLAIN)
def test_the_gradient_is_that_of_finite_differences(name):
    model, h = LinearModel(scenario_of(name)), 1e-4
    for point in ((46.0, 53.0), (41.5, 44.0), (30.0, 50.5)):
        x, y = point
        ahead, behind = (model.expected([(x + s * h, y)], NODE)[0, 0] for s in (1, -1))
        above, below = (model.expected([(x, y + s * h)], NODE)[0, 0] for s in (1, -1))
        slope = model.slopes([point], NODE)[0, 0]
        scale = max(abs(slope).max(), 1e-12)
        assert slope == pytest.approx([(ahead - behind) / 2 / h, (above - below) / 2 / h], abs=1e-5 * scale)


@pytest.mark.parametrize("name", MEASUREMENTS.kinds)
def test_every_measurement_informs_and_moves_the_filter(name):
    """A report's expected gain is above nothing, and after some periods the particles' weights differ."""
    scenario = scenario_of(name)
    world, policy = World(scenario, threads=1), make_policy("all", scenario)
    from wsn_env import View

    state, least, most = world.reset([3]), np.inf, 0.0
    for _ in range(scenario.periods):
        state, outcome = world.step(state, policy.act(View.of(state)))
        least = min(least, outcome.n_eff[0])
        mean, cov = state.belief.predicted_mean[0], state.belief.predicted_cov[0]
        place = np.array([[mean[0] + scenario.ring_m + 3.0, mean[2] + 2.0]])
        receivers = state.belief.receivers[0, :1] if scenario.measurement.lasting_errors else None
        drop, *after = expected_gain(expected(scenario, place, mean, cov, receivers)[0], 0.6, cov)
        most = max(most, drop)
        assert after[0] > 0 and after[2] > 0 and after[0] + after[2] <= cov[0, 0] + cov[2, 2] + 1e-9
    assert least < 0.9 * scenario.tracking.particles and most > 1e-4


@njit
def _detection(cs, distances, places, out):
    d, m = cs[0].detection, cs[0].measurement
    for i in range(len(distances)):
        out[0, i] = probability(d, m, distances[i])
        count, stream = 0, stream_of(d, np.uint64(9), 2 + i)
        for number in range(2000):
            count += detects(d, m, stream, numbered(number, places), places[0, 0] + distances[i], places[0, 1])
        out[1, i] = count / 2000
        out[2, i] = mean_probability(d, m, distances[i], 0.0, 1e-10, 0.0, 1e-10)


@pytest.mark.parametrize("name", DETECTIONS.kinds)
def test_every_detection_rule_detects_as_often_as_it_says(name):
    more = dict(measurement="sonar", threshold_db=95.0) if name == "threshold" else {}
    scenario = Scenario.named("PreDC-v0", detection=name, **more)
    distances = np.linspace(0.05, 1.1, 12) * scenario.reach_m
    out = np.empty((3, len(distances)))
    _detection(constants(scenario), distances, NODE, out)
    stated, counted, mean = out
    assert (np.diff(stated) <= 1e-12).all() and stated[0] > 0.3 and stated[-1] == 0
    assert abs(counted - stated).max() < 4 * (0.25 / 2000) ** 0.5
    assert abs(mean - stated)[distances < scenario.reach_m].max() < 0.06  # of a sharp belief; closed forms are rough


def settings_of(name: str, tmp_path) -> dict:
    """What a motion needs beside its defaults; None: recorded radio, which has tests of its own."""
    if name == "recorded":
        path = tmp_path / "track.csv"
        path.write_text("t,x,y\n0,10,10\n5,20,10\n9,25,30\n")
        return {"tracks": (str(path),)}
    return {"cruise": {"inset_m": 20.0, "margin_m": 5.0, "speed_ms": 0.2}}.get(name, {})


@pytest.mark.parametrize("name", [name for name in MOTIONS.kinds if name != "replay"])
def test_every_motion_draws_tracks_in_the_field_by_key(name, tmp_path):
    scenario = Scenario.named("PreDC-v0", motion=name, **settings_of(name, tmp_path))
    keys, rows = np.array([1, 2, 1], np.uint64), np.ones(3, bool)
    tracks = np.full((3, scenario.periods + 1, 4), np.nan)
    Tracks(scenario).draw(rows, keys, tracks, 1)
    places = tracks[:, :, ::2]
    assert np.isfinite(tracks).all()
    assert not scenario.motion.bounded or ((places >= 0) & (places <= 100)).all()
    assert (tracks[0] == tracks[2]).all()
    steps = np.linalg.norm(np.diff(places, axis=1), axis=2)
    speeds = np.linalg.norm(tracks[:, :, 1::2], axis=2)
    assert steps.max() > 0.05 and steps.max() < 1.5 * speeds.max() * scenario.period_s + 1e-9
    assert scenario.motion.fitting_q > 0


@njit
def _prices(rs, squared):
    r = rs[0]
    return transmission(r, 512.0, squared), relayed(r, 512.0, squared), reception(r, 512.0)


@pytest.mark.interpreted
@pytest.mark.parametrize("name", RADIOS.kinds)
def test_every_radio_has_prices_and_pays_them(name):
    scenario = Scenario.named("PreDC-v0", radio=name)
    rs = np.zeros(1, constants_type(scenario.radio, scenario))
    fill_constants(rs, scenario.radio, scenario)
    near, far = _prices(rs, 4.0), _prices(rs, 1e6)
    assert 0 < near[0] <= far[0] and near[0] <= near[1] <= far[1] and near[2] > 0
    assert near[0] == pytest.approx(scenario.radio.sending_j(512, 2.0))
    assert near[2] == pytest.approx(scenario.radio.receiving_j(512))
    env = gym.make("wsn_env/PreDC-v0", radio=name, particles=50)
    env.reset(seed=0)
    assert sum(env.step(12)[4]["energy_mj"] for _ in range(5)) > 0


@dataclass(frozen=True)
class Halfway(Measurement):
    """It has no linearise."""

    @staticmethod
    def sample(m, stream, node, x, y):
        return x, 0.0

    @staticmethod
    def log_likelihood(m, value, second, node, x, y):
        return -((value - x) ** 2)


def test_a_kind_that_lacks_a_function_is_refused_when_the_environment_is_made():
    with pytest.raises(ScenarioError, match=r"Halfway has no linearise\(\.\.\.\): a measurement must have"):
        gym.make("wsn_env/PreDC-v0", measurement=Halfway())

    class Silent(Halfway):
        log_likelihood = None

        @staticmethod
        def linearise(m, node, belief):
            return (Line(belief.x, 1.0, 0.0, 1.0),)

    with pytest.raises(ScenarioError, match=r"Silent has no log_likelihood"):
        gym.make("wsn_env/PreDC-v0", measurement=Silent())
    with pytest.raises(ScenarioError, match="must be a Beacon or .* or Sonar"):
        gym.make("wsn_env/PreDC-v0", measurement=object())


def test_constants_of_two_kinds_are_of_two_types():
    """Kernels tell kinds by the type of their constants, which hangs on the kind's code."""
    scenario = Scenario.named("PreDC-v0")
    types = {name: constants(scenario_of(name)).dtype["measurement"] for name in MEASUREMENTS.kinds}
    assert len(set(types.values())) == len(types)
    assert constants(scenario).dtype == constants(scenario.override(noise_m=1.0, radius_m=20.0)).dtype
    assert record([("a", "f8")]) != types["position"] and math.isfinite(squared_distance.py_func(NODE, 0, 1.0, 2.0))
