"""Quantities at the edge of what is allowed: numbers with every tracker; beyond it: refused by name."""

import numpy as np
import pytest

from wsn_env import Cluster, Scenario, World, evaluate
from wsn_env.models.quantity import ScenarioError
from wsn_env.simulation.reference import Reference

SMALL = dict(particles=50, periods=6, nodes=40)
GAUSSIAN = "particle ekf ukf ckf ickf".split()
WIDE = dict(side_m=1e5, radius_m=2e4, start="field")  # 100 km of which nothing is known
STRENGTHS = [
    dict(measurement="rssi", noise_db=1e-6),
    dict(measurement="rssi", noise_db=1e9),
    dict(measurement="rssi", exponent=1000),
    dict(measurement="rssi", exponent=1e-9),
    dict(measurement="rssi", floor_m=1e-6, noise_db=1e-6),
    dict(measurement="rssi", floor_m=1e6),
    dict(measurement="rssi_power", noise=1e-9),
    dict(measurement="rssi_power", noise=1e-30, amplitude=1e-30),
    dict(measurement="rssi_power", noise=1e-30, amplitude=1e-12),
    dict(measurement="rssi_power", noise=1e-9, amplitude=1e9, floor_m=1e-6),
    dict(measurement="rssi_power", noise=1e15, amplitude=1e-30),
]
EDGES = [
    *STRENGTHS,
    dict(measurement="sonar", noise_db=1e-6),
    dict(measurement="sonar", spreading=1000),
    dict(noise_m=1e-3),
    dict(noise_m=1e9),
    dict(noise_m=1e-3, start_sd_m=1e5, filter_q=0.0),
    dict(start_sd_m=1e-300, start_sd_ms=1e-300),
    dict(rest_sd_ms=1e-300, start="search"),
    dict(softness=1e-300),
    dict(radius_m=1e-300),
    dict(radius_m=1e5, decay_power=50, edge_power=50, softness=1.0),
    dict(acceleration_ms2=1000),
    dict(period_s=1e-6),
    dict(lam=1e9),
    WIDE | dict(noise_m=1e-3),
    WIDE | dict(measurement="rssi", noise_db=1e-6),
]
BINARY = [dict(edge_m=1e-6), dict(edge_m=1e6), dict(radius_m=1e-300), dict(start_sd_m=1e-300), dict(filter_q=0.0)]
BOUNDARY = "boundary_raw boundary boundary_mid boundary_ekf centroid centroid_rls particle".split()
CASES = [
    *(("PreDC-v0", dict(tracker=tracker) | edge) for tracker in GAUSSIAN for edge in EDGES),
    *(("PreDC-v0", dict(tracker="snapshot") | edge) for edge in EDGES if "measurement" not in edge),
    *(
        ("PreDC-v0", dict(tracker=tracker, field_seed=0) | edge)
        for tracker in ("trilateration", "nonlinear_ls", "grnn", "grnn_kf")
        for edge in STRENGTHS
    ),
    *(("Binary-v0", dict(tracker=tracker) | edge) for tracker in BOUNDARY for edge in BINARY),
    *(("Underwater-v0", edge) for edge in (dict(noise_db=1e-6), dict(noise_db=1e9), dict(sleep_w=0.0125))),
    *(
        ("Ble-v0", {name: value})
        for name in ("field_db", "drift_db", "main_sd_db", "fade_sd_db")
        for value in (0.0, 1000.0)
    ),
    *(("Ble-v0", {name: 1e-6}) for name in ("field_m", "drift_s", "bias_s", "floor_m")),
]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("name", "edge"), CASES, ids=lambda case: str(case))
def test_quantities_at_the_edge_of_what_is_allowed_give_numbers(name, edge):
    nodes = {} if name in ("Underwater-v0", "Ble-v0") else SMALL
    scenario = Scenario.named(name, **(dict(particles=50, periods=6) | nodes | edge))
    rows = evaluate(["nearest3"], scenario, [scenario.lam_range[0]], episodes=4, threads=1).rows
    assert all(np.isfinite(value) for row in rows for value in row.values() if isinstance(value, float))


@pytest.mark.parametrize(
    ("name", "beyond", "words"),
    [
        ("PreDC-v0", dict(noise_m=1e-8), "Position.noise_m = 1e-08: must be a finite number at least 0.001"),
        ("PreDC-v0", dict(noise_m=1.5e154), "Position.noise_m = .*at most 1e.09"),
        ("Rssi-v0", dict(noise_db=1e-150), "Rssi.noise_db = 1e-150: must be a finite number at least 1e-06"),
        ("Rssi-v0", dict(noise_db=8e18), "Rssi.noise_db"),
        ("Rssi-v0", dict(exponent=1e300), "Rssi.exponent"),
        ("Underwater-v0", dict(noise_db=2.5e-8), "Sonar.noise_db"),
        ("Underwater-v0", dict(sleep_w=0.02), "Modem.sleep_w = 0.02: must be at most listen_w = 0.0125"),
        ("PreDC-v0", dict(measurement="rssi_power", noise=1e-20), "RssiPower.noise = 1e-20: must be at least 1e-16"),
        ("PreDC-v0", dict(radius_m=1e110), r"Detection.radius_m = 1e\+110: .* at most 100000"),
        ("PreDC-v0", dict(decay_power=170), "Detection.decay_power = 170: .* at most 50"),
        ("PreDC-v0", dict(edge_power=1e4), "Detection.edge_power"),
        ("PreDC-v0", dict(acceleration_ms2=1e12), "Crossing.acceleration_ms2"),
        ("PreDC-v0", dict(period_s=1e-300), "Scenario.period_s = 1e-300: .* at least 1e-06"),
        ("PreDC-v0", dict(lam=1e300), r"Scenario.lam = 1e\+300: must be a finite number at least 0 and at most 1e\+09"),
        ("Ble-v0", dict(drift_db=1e200), r"Beacon.drift_db = 1e\+200: .* at most 1000"),
        ("Ble-v0", dict(field_m=1e-300), "Beacon.field_m"),
        ("Binary-v0", dict(edge_m=1e-12), "Binary.edge_m"),
        ("PreDC-v0", dict(motion="sine", speed_ms=1e300), r"Sine.speed_ms = 1e\+300: .* above 0 and at most 1e.06"),
        ("PreDC-v0", dict(motion="free", spread_m=1.43e180), r"Free.spread_m = 1.43e\+180: .* at most 1e.06"),
        ("PreDC-v0", dict(motion="straight", velocity_ms=-1e9), "Straight.velocity_ms .* at least -1e.06"),
        ("PreDC-v0", dict(motion="straight", from_m=1e30), "Straight.from_m"),
        ("PreDC-v0", dict(battery_j=1e12), "Radio.battery_j = 1000000000000.0: .* at most 1e.09"),
        ("PreDC-v0", dict(report_bits=10**12), "Radio.report_bits = 1000000000000: must be a whole number at least 0"),
        ("PreDC-v0", dict(sensing_nj=1e300), "Radio.sensing_nj"),
        ("PreDC-v0", dict(nodes=10**9), "Field.nodes = 1000000000: .* at most 10000000"),
        ("PreDC-v0", dict(periods=10**12), "Scenario.periods = 1000000000000: .* at most 10000000"),
        ("PreDC-v0", dict(typical_energy_mj=1e-300), "Scenario.typical_energy_mj = 1e-300: .* at least 1e-09"),
        ("PreDC-v0", dict(reference_error_m=1e300), "Scenario.reference_error_m"),
        ("Underwater-v0", dict(hop_m=1e-300), "Modem.hop_m = 1e-300: .* at least 0.001"),
        ("Underwater-v0", dict(bit_rate=1e-9), "Modem.bit_rate"),
        ("Ble-v0", dict(listen_w=1e300), "Bluetooth.listen_w"),
        ("Ble-v0", dict(at_1m_db=1e300), r"Beacon.at_1m_db = 1e\+300: .* at most 1e.06"),
        ("Ble-v0", dict(exponents=(1.7,) * 11 + (-1.0,)), "Beacon.exponents = -1.0: .* at least 0"),
        (
            "Ble-v0",
            dict(interval_s=0.01, period_s=3600, periods=100),
            "Beacon.interval_s = 0.01: must be at least 0.036 s",
        ),
    ],
)
def test_quantities_beyond_it_are_refused_by_name(name, beyond, words):
    with pytest.raises(ScenarioError, match=words) as refused:
        Scenario.named(name, **beyond)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("margin_m", [49.9999999999999, 49.999, 49.997])
def test_a_walk_whose_legs_have_no_length_is_refused_when_made(margin_m):
    walk = Scenario.named("PreDC-v0", motion="walk", margin_m=margin_m)
    with pytest.raises(ScenarioError, match=r"Walk.fastest_ms = 0.73: must be at most .* with a margin of 49.99"):
        World(walk, threads=1)


def test_a_walk_of_short_legs_ends():
    short = Scenario.named("PreDC-v0", motion="walk", margin_m=49.99, periods=100, particles=2, nodes=1)
    track = World(short, threads=1).reset([1]).track
    assert ((track[:, :, ::2] >= 49.99) & (track[:, :, ::2] <= 50.01)).all()


def test_the_reference_is_a_number_where_reports_know_more_than_doubles_hold():
    """Information of 1e26 / m^2: rounding left variances below 0."""
    sharp = dict(measurement="rssi_power", side_m=0.03, floor_m=3.7e-4, motion="turns", speed_ms=1e-4, radius_m=0.01)
    scenario = Scenario.named("PreDC-v0", periods=8, nodes=30, particles=50, start_sd_m=0.01, **sharp)
    world, reference = World(scenario, threads=1), Reference(scenario, 20)
    state = world.reset(np.arange(20))
    assert (reference.begin(state, np.ones(20, bool)) >= 0).all()
    everybody = Cluster(np.zeros(20, int), np.tile(np.arange(30), (20, 1)))
    for _ in range(8):
        state, outcome = world.step(state, everybody)
        assert (reference.advance(state, outcome) >= 0).all()
