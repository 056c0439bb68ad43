"""Scenarios refuse what makes no sense, and say what does."""

import dataclasses
import json
import math

import numpy as np
import pytest

from wsn_env import Scenario, ScenarioError, World
from wsn_env.models.detection.radius import Detection
from wsn_env.models.field import Field
from wsn_env.models.kinds import constants_type
from wsn_env.models.measurement.position import Position
from wsn_env.models.measurement.rssi import Rssi
from wsn_env.models.motion.base import Motion
from wsn_env.models.motion.sine import Sine
from wsn_env.models.motion.straight import Straight
from wsn_env.models.radio.radio import Radio
from wsn_env.scenario.constants import constants
from wsn_env.scenario.tracking import Tracking


@pytest.mark.parametrize(
    ("overrides", "says"),
    [
        (dict(radius_m=-1), ["Detection.radius_m = -1", "above 0"]),
        (dict(radius_m=0), ["Detection.radius_m = 0", "above 0"]),
        (dict(ceiling=1.2), ["Detection.ceiling = 1.2", "above 0 and at most 1"]),
        (dict(softness=2), ["Detection.softness = 2", "at most 1"]),
        (dict(nodes=0), ["Field.nodes = 0", "a whole number at least 1"]),
        (dict(nodes=2.5), ["Field.nodes = 2.5", "a whole number"]),
        (dict(nodes="many"), ["Field.nodes = 'many'", "a whole number"]),
        (dict(nodes=True), ["Field.nodes = True", "a whole number"]),
        (dict(nodes=None), ["Field.nodes = None", "a whole number"]),
        (dict(nodes=math.nan), ["Field.nodes = nan"]),
        (dict(side_m=math.nan), ["Field.side_m = nan", "a finite number"]),
        (dict(side_m=math.inf), ["Field.side_m = inf", "a finite number"]),
        (dict(side_m=1e30), ["Field.side_m = 1e+30", "at most"]),
        (dict(side_m="100"), ["Field.side_m = '100'"]),
        (dict(side_m=[100]), ["Field.side_m = [100]"]),
        (dict(field_seed=-1), ["Field.field_seed = -1", "at least 0"]),
        (dict(positions="here"), ["Field.positions", "pairs (x, y)"]),
        (dict(positions=()), ["Field.positions", "pairs (x, y)"]),
        (dict(positions=((1, 2), (3,))), ["Field.positions", "pairs (x, y)"]),
        (dict(positions=((1, 2, 3),)), ["Field.positions", "pairs (x, y)"]),
        (dict(positions=((1, math.nan),)), ["Field.positions", "finite"]),
        (dict(positions=((1, 101),)), ["Field.positions", "must lie in 0..100"]),
        (dict(positions=((1, 2),), nodes=7), ["Field.nodes = 7", "must be 1"]),
        (dict(positions=((1, 2),), side_m="x"), ["Field.side_m = 'x'"]),
        (dict(periods=0), ["Scenario.periods = 0", "at least 1"]),
        (dict(period_s=0), ["Scenario.period_s = 0", "at least 1e-06"]),
        (dict(lam=-1), ["Scenario.lam = -1", "at least 0"]),
        (dict(lam=math.nan), ["Scenario.lam = nan"]),
        (dict(lam=math.inf), ["Scenario.lam = inf"]),
        (dict(lam="4"), ["Scenario.lam = '4'", "a finite number"]),
        (dict(lam=True), ["Scenario.lam = True", "a finite number"]),
        (dict(lam=None), ["Scenario.lam = None", "a finite number"]),
        (dict(lam=(0, 4)), ["Scenario.lam = (0, 4)", "0 < low <= high"]),
        (dict(lam=(4, 1)), ["Scenario.lam = (4, 1)", "0 < low <= high"]),
        (dict(lam=(1, 2, 3)), ["Scenario.lam = (1, 2, 3)", "pair"]),
        (dict(lam=(1, "2")), ["Scenario.lam = (1, '2')", "pair"]),
        (dict(noise_m=-2), ["Position.noise_m = -2", "at least 0.001"]),
        (dict(measurement="rssi", noise_db=0), ["Rssi.noise_db = 0", "at least 1e-06"]),
        (dict(measurement="rssi_power", exponent=5), ["RssiPower.exponent = 5", "at least 2 and at most 4"]),
        (dict(packet_success=1.1), ["Radio.packet_success = 1.1", "at most 1"]),
        (dict(retries=16), ["Radio.retries = 16", "at most 15"]),
        (dict(battery_j=0), ["Radio.battery_j = 0", "above 0"]),
        (dict(handover="all"), ["Radio.handover = 'all'", "estimate, particles"]),
        (dict(tracker="kalman"), ["Tracking.tracker = 'kalman'", "particle, ekf, snapshot"]),
        (dict(fusion=1), ["Tracking.fusion = 1", "joint, pooled"]),
        (dict(start="lost"), ["Tracking.start = 'lost'", "known, search"]),
        (dict(particles=1), ["Tracking.particles = 1", "at least 2"]),
        (dict(search="no"), ["Tracking.search = 'no'", "True, False"]),
        (dict(filter_q=-0.1), ["Tracking.filter_q = -0.1", "at least 0"]),
        (dict(search_miss=0), ["Tracking.search_miss = 0", "above 0"]),
        (dict(speed_ms=-1, motion="turns"), ["Turns.speed_ms = -1", "above 0"]),
        (dict(motion="sinus"), ["Scenario.motion = 'sinus'", "did you mean sine"]),
        (dict(motion=3), ["Scenario.motion = 3", "must be a Circle or Crossing or"]),
        (dict(motion=Motion()), ["Motion has no draw(...)", "a motion must have draw"]),
        (dict(motion=Sine), ["Scenario.motion", "must be a Circle or Crossing or"]),
        (dict(measurement="rsi"), ["Scenario.measurement = 'rsi'", "did you mean rssi"]),
        (dict(field=Radio()), ["Scenario.field", "must be a Field"]),
        (dict(nods=5), ["'nods'", "did you mean nodes"]),
        (dict(xyzzy=5), ["'xyzzy'", "known are"]),
        (dict(layout="hexagons"), ["Field.layout = 'hexagons'", "uniform, grid"]),
        (dict(jitter=0.6), ["Field.jitter = 0.6", "at most 0.5"]),
        (dict(resampling="residual"), ["Tracking.resampling = 'residual'", "systematic, spread"]),
        (dict(spread_scale=-1), ["Tracking.spread_scale = -1", "at least 0"]),
        (dict(resampling="spread", tracker="ekf"), ["Tracking.resampling = 'spread'", "'systematic'", "'ekf'"]),
        (dict(redraw_on_handover=True, tracker="snapshot"), ["Tracking.redraw_on_handover = True", "allowed is False"]),
        (dict(amplitude_m=5), ["'amplitude_m'"]),  # not of this motion
    ],
)
def test_bad_quantities_are_refused_with_name_value_and_what_is_allowed(overrides, says):
    with pytest.raises(ScenarioError) as problem:
        Scenario.named("PreDC-v0", **overrides)
    for words in says:
        assert words in str(problem.value)


def test_sections_refuse_by_themselves_too():
    for make in (lambda: Detection(radius_m=-1), lambda: Radio(retries=-1), lambda: Scenario(periods=0)):
        with pytest.raises(ScenarioError):
            make()
    with pytest.raises(TypeError):
        Field(node=3)


def test_unknown_scenarios_are_suggested():
    with pytest.raises(ScenarioError, match="'PreDC' is unknown: did you mean PreDC-v0"):
        Scenario.named("PreDC")
    with pytest.raises(ScenarioError, match="'nothing' is unknown: known are"):
        Scenario.named("nothing")
    assert Scenario.named("wsn_env/Rssi-v0") == Scenario.named("Rssi-v0")
    assert issubclass(ScenarioError, ValueError)


def test_overrides_reach_every_section():
    scenario = Scenario.named(
        "PreDC-v0",
        periods=7,
        lam=(1, 9),
        nodes=12,
        side_m=50,
        motion="sine",
        amplitude_m=11,
        radius_m=3,
        measurement="rssi",
        noise_db=5,
        report_bits=64,
        particles=99,
        tracker="ekf",
        filter_q=0.7,
    )
    assert (scenario.periods, scenario.lam_range) == (7, (1.0, 9.0))
    assert (scenario.field.nodes, scenario.field.side_m) == (12, 50)
    assert scenario.motion == Sine(amplitude_m=11)
    assert scenario.detection == Detection(radius_m=3)
    assert scenario.measurement == Rssi(noise_db=5)
    assert scenario.radio == Radio(report_bits=64)
    assert scenario.tracking == Tracking(particles=99, tracker="ekf", filter_q=0.7)
    assert scenario.filter_q == 0.7 and scenario.override(filter_q=None).filter_q == Sine.fitting_q


@pytest.mark.parametrize("section", ["field", "motion", "detection", "measurement", "radio", "tracking"])
def test_every_quantity_can_be_overridden(section):
    preset = Scenario.named("PreDC-v0")
    for item in dataclasses.fields(getattr(preset, section)):
        default = getattr(getattr(preset, section), item.name)
        if isinstance(default, bool):
            value = not default
        elif isinstance(default, (int, float)):
            value = 0.5 * default if isinstance(default, float) else default + 1
        else:
            continue
        assert getattr(getattr(preset.override(**{item.name: value}), section), item.name) == value


def test_sections_may_be_given_whole_and_changed_at_once():
    scenario = Scenario.named("PreDC-v0", motion=Straight(from_m=1), velocity_ms=0.5, measurement=Position(noise_m=1))
    assert scenario.motion == Straight(from_m=1, velocity_ms=0.5)
    assert scenario.measurement.noise_m == 1


def test_scenarios_are_frozen_values():
    scenario = Scenario.named("PreDC-v0")
    with pytest.raises(dataclasses.FrozenInstanceError):
        scenario.periods = 3
    with pytest.raises(dataclasses.FrozenInstanceError):
        scenario.field.nodes = 3
    assert scenario.override(nodes=3) != scenario == Scenario.named("PreDC-v0") == Scenario()
    assert hash(scenario) == hash(Scenario())


def test_table_1_is_the_default():
    s = Scenario.named("PreDC-v0")
    assert (s.field.nodes, s.field.side_m, s.period_s, s.periods, s.tracking.particles) == (225, 100, 1, 100, 5000)
    d, r = s.detection, s.radio
    assert (d.radius_m, d.softness, d.decay_power, d.edge_power, d.decay, d.ceiling) == (10, 0.2, 3, 2, 1, 0.6)
    assert (r.tx_nj_per_bit, r.amplifier_pj_per_bit_m2, r.rx_nj_per_bit) == (50, 150, 100)
    assert (r.report_bits, r.invitation_bits, r.handover_bits, r.wakeup_bits, r.broadcast_bits) == (
        512,
        128,
        448,
        128,
        32,
    )
    assert (s.filter_q, s.measurement.noise_m, s.reach_m, s.handover_bits) == (0.05, 2, 12, 448)
    assert s.override(handover="particles").handover_bits == 800_000


def test_the_underwater_preset():
    s = Scenario.named("Underwater-v0")
    assert (s.field.nodes, s.field.side_m, s.field.layout, s.field.jitter) == (64, 1000, "grid", 0.25)
    assert (s.period_s, s.periods, s.tracking.particles, s.tracking.resampling) == (5, 100, 1000, "spread")
    m, r = s.measurement, s.radio
    assert (m.source_db, m.spreading, m.frequency_khz, m.noise_db) == (120, 1.5, 10, 3)
    assert (r.transmit_w, r.receive_w, r.listen_w, r.sleep_w) == (1.5, 0.025, 0.0125, 2e-4)
    assert (r.bit_rate, r.hop_m) == (640, 250)
    assert (r.report_bits, r.handover_bits, r.invitation_bits, r.wakeup_bits) == (64, 256, 32, 32)
    assert (s.detection.threshold_db, s.tracking.silent_information, s.filter_q) == (85, True, 0.01)
    assert (s.tracking.start_sd_m, s.tracking.start_sd_ms) == (20, 1)


def test_whole_numbers_become_integers():
    scenario = Scenario.named("PreDC-v0", nodes=10.0, particles=np.int64(30), periods=np.float64(5))
    assert [type(x) for x in (scenario.field.nodes, scenario.tracking.particles, scenario.periods)] == [int] * 3
    assert World(scenario, threads=1).reset([1]).network.battery.shape == (1, 10)


@pytest.mark.parametrize(
    "whole",
    [
        dict(radius_m=10, ceiling=1, softness=1, decay=0),
        dict(noise_m=2),
        dict(filter_q=0, resample_below=1, search_miss=1),
        dict(measurement="binary", flip=0, edge_m=1),
        dict(measurement="rssi", floor_m=1),
        dict(detection="unequal", radius_spread=0),
        dict(motion="turns", speed_ms=1, turn_probability=1),
        dict(radio="modem", hop_m=100, battery_j=1),
    ],
    ids=str,
)
def test_whole_numbers_need_no_kernels_of_their_own(whole):
    """Kernels are compiled for the types of constants, a minute each time: of 10 those of 10.0."""
    words = {name: value for name, value in whole.items() if isinstance(value, str)}
    given, usual = Scenario.named("PreDC-v0", **whole), Scenario.named("PreDC-v0", **words)
    assert constants(given).dtype == constants(usual).dtype
    assert constants_type(given.motion, given) == constants_type(usual.motion, usual)
    assert all(type(given.quantities()[name]) is float for name in whole.keys() - words.keys())


def test_given_positions_fix_the_field():
    places = ((1.0, 2.0), (3.0, 4.0), (90.0, 5.0))
    scenario = Scenario.named("PreDC-v0", positions=np.array(places), particles=2)
    assert scenario.field.positions == places and scenario.field.nodes == 3
    state = World(scenario, threads=1).reset([1, 2])
    np.testing.assert_array_equal(state.network.positions, [places, places])


def test_a_field_seed_fixes_the_field_but_not_the_track():
    fixed = World(Scenario.named("PreDC-v0", field_seed=3, nodes=5, particles=2), threads=1).reset([1, 2])
    np.testing.assert_array_equal(*fixed.network.positions)
    assert fixed.track[0, 0, 0] != fixed.track[1, 0, 0]
    drawn = World(Scenario.named("PreDC-v0", nodes=5, particles=2), threads=1).reset([1, 2])
    assert (drawn.network.positions[0] != drawn.network.positions[1]).all()


def test_fields_are_uniform():
    world = World(Scenario.named("PreDC-v0", nodes=200, particles=2, side_m=70, crossing_m=20), threads=1)
    x = world.reset(np.arange(200)).network.positions / 70
    assert x.min() >= 0 and x.max() < 1
    n = x.size
    assert abs(x.mean() - 0.5) < 4 / (12 * n) ** 0.5
    assert abs(x.var() - 1 / 12) < 4 / (180 * n) ** 0.5


def test_lam_is_drawn_log_uniformly():
    world = World(Scenario.named("PreDC-v0", lam=(0.3, 30), nodes=1, particles=2), threads=1)
    z = np.log(world.reset(np.arange(4000)).row["lam"] / 0.3) / np.log(100)
    assert z.min() >= -1e-12 and z.max() <= 1 + 1e-12
    assert abs(z.mean() - 0.5) < 4 / (12 * 4000) ** 0.5
    assert abs(z.var() - 1 / 12) < 4 / (180 * 4000) ** 0.5
    assert (World(Scenario(lam=0), threads=1).reset([5]).row["lam"] == 0).all()


def test_as_dict_goes_into_json():
    scenario = Scenario.named("Rssi-v0", nodes=np.int64(7), lam=(1, 2))
    plain = json.loads(json.dumps(scenario.as_dict()))
    assert plain["measurement"] == {"kind": "Rssi"} | dataclasses.asdict(scenario.measurement)
    assert plain["field"]["nodes"] == 7


def test_positions_can_be_changed_again():
    two = Scenario.named("PreDC-v0", positions=((1, 1), (2, 2)))
    assert two.override(positions=((1, 1), (2, 2), (3, 3))).field.nodes == 3


def test_energies_of_the_papers_constants():
    """512 bits over 10 m: 512 (50 nJ + 150 pJ 100) to send, 512 x 100 nJ to receive."""
    radio = Scenario().radio
    assert radio.sending_j(512, 10.0) == pytest.approx(33.28e-6, rel=1e-12)
    assert radio.receiving_j(512) == pytest.approx(51.2e-6, rel=1e-12)
