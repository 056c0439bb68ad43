"""Sound in the sea, and the levels that sonar measures."""

import math

import numpy as np
import pytest

from tests.test_particle import NODES, Filter, moments
from tests.test_sensing import assert_normal, measured
from tests.worlds import expected, expected_gain
from wsn_env import Scenario
from wsn_env.filters.linear import LinearModel
from wsn_env.models.acoustics import absorption_db_per_km, ambient_noise_db
from wsn_env.models.measurement.sonar import Sonar
from wsn_env.scenario.constants import constants

ALPHA = 1.18703e-3  # dB/m at 10 kHz


@pytest.mark.parametrize(("khz", "alpha"), [(1, 0.069), (10, 1.187), (20, 4.134), (50, 17.47)])
def test_thorps_absorption(khz, alpha):
    assert absorption_db_per_km(khz) == pytest.approx(alpha, abs=0.01)


def test_wenzs_noise_at_points_computed_by_hand():
    """At 10 kHz the terms are -13, 5.9 (ships), 46.1 (waves), 5; at 300 kHz thermal noise rules, at 1 Hz turbulence."""
    waves = 50 + 7.5 * 5**0.5 + 20 - 40 * math.log10(10.4)
    assert ambient_noise_db(10) == pytest.approx(waves, abs=0.01)
    assert waves == pytest.approx(46.09, abs=0.01)
    assert ambient_noise_db(300) == pytest.approx(-15 + 20 * math.log10(300), abs=0.6)
    assert ambient_noise_db(0.001) == pytest.approx(17 + 90, abs=0.01)


def test_wind_and_ships_are_heard_in_their_bands():
    assert ambient_noise_db(10, wind_ms=15) - ambient_noise_db(10) == pytest.approx(7.5 * (15**0.5 - 5**0.5), abs=0.01)
    assert ambient_noise_db(0.1, shipping=1.0) - ambient_noise_db(0.1, shipping=0.0) > 15
    assert ambient_noise_db(10, shipping=1.0) - ambient_noise_db(10, shipping=0.0) < 0.01


def level(distance, **changes):
    """By the sonar equation."""
    d = np.maximum(distance, 1.0)
    return 120 - 15 * np.log10(d) - ALPHA * d


@pytest.mark.parametrize("distance", [0.0, 0.5, 1.0, 10.0, 207.0, 1000.0])
def test_measured_levels(distance):
    cs = constants(Scenario.named("Underwater-v0"))
    z = measured(cs, np.array([20.0 + distance, 1, 30, 1]), np.array([[20.0, 30.0]]), 50_000)
    assert_normal(z[:, 0], level(distance), 3)
    assert (z[:, 1] == 0).all()


def test_another_frequency_and_spreading():
    sonar = Sonar(spreading=2.0, frequency_khz=50.0, source_db=150)
    assert sonar.mean_db(500.0) == pytest.approx(150 - 20 * math.log10(500) - 0.5 * 17.467, abs=1e-3)
    assert sonar.mean_db(sonar.distance_m(80.0)) == pytest.approx(80.0, abs=1e-9)
    assert sonar.distance_m(200.0) == 0


@pytest.mark.parametrize("particles", [2, 37, 1000])
def test_levels_weigh_like_plain_numpy(particles):
    """Absorption is made large, so that it matters within the field."""
    chosen = dict(measurement="sonar", frequency_khz=1000.0, source_db=130.0)
    filter = Filter(particles=particles, filter_q=0.0, resample_below=0, cov=np.diag([4, 0.04, 4, 0.04]), **chosen)
    cloud = filter.belief.particles[0].T.astype(float)
    reports = [(0, 112.0, 0.0), (1, 110.0, 0.0), (3, 111.5, 0.0)]
    filter.step(reports)
    cloud[:, ::2] += cloud[:, 1::2]
    absorption = absorption_db_per_km(1000.0) / 1000
    assert absorption > 0.3
    log_weights = np.zeros(particles)
    for node, z, _ in reports:
        d = np.maximum(np.linalg.norm(cloud[:, ::2] - NODES[node], axis=1), 1.0)
        log_weights -= (z - (130 - 15 * np.log10(d) - absorption * d)) ** 2 / 18
    mean, cov, n_eff = moments(cloud, log_weights)
    np.testing.assert_allclose(filter.belief.mean[0], mean, atol=2e-4)
    np.testing.assert_allclose(filter.belief.n_eff[0], n_eff, rtol=1e-3)


def test_the_slope_of_the_level():
    scenario = Scenario.named("PreDC-v0", measurement="sonar", frequency_khz=500.0)
    nodes, point, step = np.array([[40.0, 50.0]]), np.array([52.0, 61.0]), 1e-5
    model = LinearModel(scenario)
    levels, slopes = model.expected([point], nodes)[0], model.slopes([point], nodes)[0]
    assert levels[0] == pytest.approx(scenario.measurement.mean_db(math.hypot(12.0, 11.0)), rel=1e-12)
    for axis in (0, 1):
        shift = step * np.eye(2)[axis]
        ahead, behind = model.expected([point + shift, point - shift], nodes)[:, 0]
        assert slopes[0, axis] == pytest.approx((ahead - behind) / (2 * step), rel=1e-6)


def test_information_gain_knows_the_slope():
    """Of a sure detection at a sharp belief: the Kalman update with the level's slope along the line of sight."""
    scenario = Scenario.named("PreDC-v0", measurement="sonar", frequency_khz=500.0)
    positions, mean, cov = np.array([[40.0, 50.0]]), np.array([60.0, 0, 50.0, 0]), 1e-9 * np.eye(4)
    (node,) = expected(scenario, positions, mean, cov)
    drop, *after = expected_gain(node, 1.0, 4.0 * np.eye(4))
    slope = 15 / math.log(10) / 20 + absorption_db_per_km(500.0) / 1000
    left = 4 - 16 * slope**2 / (4 * slope**2 + 9)
    np.testing.assert_allclose([drop, *after], [4 - left, left, 0, 4], rtol=1e-6, atol=1e-9)
