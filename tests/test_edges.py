"""Quantities at the edge of what is allowed: numbers with every tracker; beyond it: refused by name."""

import numpy as np
import pytest

from wsn_env import Scenario, evaluate
from wsn_env.models.quantity import ScenarioError

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
        ("PreDC-v0", dict(lam=1e300), r"Scenario.lam = 1e\+300: must be at least 0 m/mJ.* up to 1e\+09"),
        ("Ble-v0", dict(drift_db=1e200), r"Beacon.drift_db = 1e\+200: .* at most 1000"),
        ("Ble-v0", dict(field_m=1e-300), "Beacon.field_m"),
        ("Binary-v0", dict(edge_m=1e-12), "Binary.edge_m"),
    ],
)
def test_quantities_beyond_it_are_refused_by_name(name, beyond, words):
    with pytest.raises(ScenarioError, match=words) as refused:
        Scenario.named(name, **beyond)
    assert "\n" not in str(refused.value)
