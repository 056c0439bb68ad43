"""A beacon's levels: what is simulated, and what the tracker makes of it."""

import json

import numpy as np
import pytest

from tests.worlds import keys_of
from wsn_env import Cluster, Scenario, View, World, make_policy
from wsn_env.envs.env import ClusterEnv
from wsn_env.models.measurement.beacon import Beacon
from wsn_env.models.measurement.beacon_levels import SILENT_DB
from wsn_env.models.quantity import ScenarioError
from wsn_env.models.state import NOBODY

QUIET = dict(field_db=0.0, drift_db=0.0, main_db=0.0, main_sd_db=0.0, fade_share=0.0, loss=0.0, loss_after_loss=0.0)
STILL = dict(motion="legs", start_m=(9.0, 8.0), legs=((1.0, 1e-9, 1e-9),))
BLE = Scenario.named("Ble-v0", particles=300)


def levels(scenario, rows=400, seed=0):
    """Mean levels and numbers of packets (rows, periods, S), and the mean level that distance alone would give."""
    state = World(scenario).reset(keys_of(seed, rows))
    packets = state.packets[:, 1:].astype(float)
    p0, n, squared_height = scenario.measurement.of_nodes(scenario.field.nodes).T
    offset = state.track[:, 1:, None, ::2] - np.array(scenario.field.positions)
    mean = p0 - 5 * n * np.log10((offset**2).sum(axis=-1) + squared_height)
    return packets[..., 0], packets[..., 1], mean


# --- what is simulated ----------------------------------------------------------------------------------------


def test_without_noise_a_level_is_that_of_its_distance_rounded():
    level, count, mean = levels(BLE.override(**QUIET, **STILL), rows=5)
    assert set(np.unique(count)) <= {2.0, 3.0}
    np.testing.assert_array_equal(level, np.floor(mean + 0.5))


def test_packets_come_and_are_lost_as_often_as_said():
    scenario = BLE.override(periods=50)
    _, count, _ = levels(scenario)
    expected = scenario.measurement.packets(1.0)
    assert expected == pytest.approx((1 - 0.146) / 0.4525)
    # Each packet is lost or not, a little alike for neighbours: se of the mean below .001.
    assert count.mean() == pytest.approx(expected, abs=0.005)
    assert (count > 0).mean() == pytest.approx(scenario.measurement.heard(1.0), abs=0.005)


@pytest.mark.parametrize("loss,after", [(0.5, 0.9), (0.5, 0.5), (0.146, 0.0)])
def test_losses_come_in_bursts(loss, after):
    """One packet a period: the chain of losses shows."""
    scenario = BLE.override(periods=100, interval_s=1.0, loss=loss, loss_after_loss=after)
    lost = levels(scenario, rows=100)[1] == 0
    again = lost[:, 1:][lost[:, :-1]].mean()
    assert lost.mean() == pytest.approx(loss, abs=0.02)
    assert again == pytest.approx(after, abs=0.02)


def test_the_white_part_is_the_mixture():
    changes = dict(field_db=0.0, drift_db=0.0, interval_s=1.0, loss=0.0, loss_after_loss=0.0)
    level, _, mean = levels(BLE.override(**changes, **STILL), rows=200)
    noise = (level - mean).ravel()
    beacon = BLE.measurement
    assert noise.mean() == pytest.approx(0.6 * 1.8 - 0.4 * 2.7, abs=0.05)
    assert noise.var() == pytest.approx(beacon.white_db**2 + 1 / 12, rel=0.02)  # rounding adds a twelfth
    assert beacon.white_db**2 == pytest.approx(18.0, abs=0.1)
    skew = ((noise - noise.mean()) ** 3).mean() / noise.std() ** 3
    assert -1.0 < skew < -0.4  # fading pulls down


def test_the_drift_forgets_and_the_field_stays():
    calm = dict(main_db=0.0, main_sd_db=0.0, fade_share=0.0, loss=0.0, loss_after_loss=0.0, interval_s=1.0, **STILL)
    level, _, mean = levels(BLE.override(**calm, field_db=0.0, drift_db=3.0, drift_s=7.0, periods=60))
    rest = level - mean
    for lag in (1, 5, 15):
        together = (rest[:, lag:] * rest[:, :-lag]).mean()
        assert together == pytest.approx(9.0 * np.exp(-lag / 7.0), abs=0.25)
    level, _, mean = levels(BLE.override(**calm, field_db=3.0, drift_db=0.0))
    rest = level - mean
    assert np.ptp(rest, axis=1).max() == 0.0  # the beacon stands still
    assert rest[:, 0].var() == pytest.approx(9.0, rel=0.1)
    assert abs(np.corrcoef(rest[:, 0].T) - np.eye(12)).max() < 0.2  # each receiver has a field of its own


def test_the_field_has_the_covariance_that_it_says():
    """Along a straight line at 0.4 m a period; exp(-d / .8 m)."""
    calm = dict(main_db=0.0, main_sd_db=0.0, fade_share=0.0, loss=0.0, loss_after_loss=0.0, interval_s=1.0)
    walk = dict(motion="legs", start_m=(2.0, 8.0), legs=((40.0, 0.4, 0.0),), periods=39)
    level, _, mean = levels(BLE.override(**calm, **walk, field_db=3.0, field_m=0.8, drift_db=0.0), rows=300)
    rest = level - mean
    for steps in (1, 2, 5):
        together = (rest[:, steps:] * rest[:, :-steps]).mean()
        assert together == pytest.approx(9.0 * np.exp(-0.4 * steps / 0.8), abs=0.35)


def test_walks_stay_in_the_room_at_the_speeds_of_a_walk():
    scenario = BLE.override(periods=200)
    track = World(scenario).reset(keys_of(0, 100)).track
    assert track[..., 0].min() >= 1.0 - 1e-9 and track[..., 0].max() <= 20.66 - 1.0 + 1e-9
    assert track[..., 2].min() >= 1.0 - 1e-9 and track[..., 2].max() <= 17.641 - 1.0 + 1e-9
    speed = np.hypot(track[..., 1], track[..., 3])
    assert 0.14 <= speed.min() and speed.max() <= 0.73
    steps = np.hypot(np.diff(track[..., 0]), np.diff(track[..., 2]))
    assert steps.max() <= 0.73 + 1e-9
    assert np.ptp(speed, axis=1).min() > 0.0 or speed.std() > 0.1


# --- what the tracker makes of it -----------------------------------------------------------------------------


def test_a_bias_is_filtered_as_kalman_would_where_the_position_is_known():
    """With the target nailed down every particle's bias is the scalar Kalman filter's."""
    scenario = BLE.override(**STILL, start="known", start_sd_m=1e-6, velocity_s=None, filter_q=0.0, particles=2)
    scenario = scenario.override(start_sd_ms=1e-6, periods=20)
    world, beacon = World(scenario), scenario.measurement
    state = world.reset(keys_of(3, 1))
    p0, n, squared_height = beacon.of_nodes(12).T
    mean, variance = np.zeros(12), np.full(12, beacon.bias_db**2)
    kept = np.exp(-1.0 / beacon.bias_s)
    for period in range(20):
        listening = np.arange(period % 3, 12, 2)
        state, _ = world.step(state, Cluster(np.array([listening[0]]), listening[None]))
        mean, variance = kept * mean, kept**2 * variance + (1 - kept**2) * beacon.bias_db**2
        offset = state.track[0, period + 1, ::2] - np.array(scenario.field.positions)
        expected = p0 - 5 * n * np.log10((offset**2).sum(axis=1) + squared_height)
        for j in listening:
            level, count = state.packets[0, period + 1, j].astype(float)
            if count:
                gain = variance[j] / (variance[j] + beacon.white_db**2 / count)
                mean[j] += gain * (level - expected[j] - mean[j])
                variance[j] *= 1 - gain
    np.testing.assert_allclose(state.belief.receivers["bias_variance"][0], variance, rtol=1e-12)
    np.testing.assert_allclose(state.belief.biases[0, :, 0], mean, atol=2e-3)  # float32, and a start off by 1e-6 m


def test_what_is_foretold_is_the_regression_over_the_particles():
    state = playing(BLE, "quadrants", 12)
    scenario, beacon = BLE, BLE.measurement
    kept, turn = np.exp(-1.0 / beacon.bias_s), np.exp(-1.0 / scenario.tracking.velocity_s)
    p0, n, squared_height = beacon.of_nodes(12).T
    for row in range(4):
        x = state.belief.particles[row].astype(float)
        weights = np.exp(state.belief.log_weights[row].astype(float))
        weights /= weights.sum()
        there = np.stack([x[0] + 0.5 * (1 + turn) * x[1], x[2] + 0.5 * (1 + turn) * x[3]])
        centred = there - (there @ weights)[:, None]
        for j in range(12):
            offset = there - np.array(scenario.field.positions[j])[:, None]
            level = p0[j] - 5 * n[j] * np.log10((offset**2).sum(axis=0) + squared_height[j])
            level = level + kept * state.belief.biases[row, j]
            gradient = np.linalg.solve((weights * centred) @ centred.T, (weights * centred) @ level)
            rest = level - weights @ level - gradient @ centred
            told = state.belief.receivers[row, j]
            own = kept**2 * told["bias_variance"] + (1 - kept**2) * beacon.bias_db**2
            heard = beacon.packets(1.0) / beacon.heard(1.0)
            expected = weights @ rest**2 + own + beacon.white_db**2 / heard
            np.testing.assert_allclose(told["gradient"], gradient, atol=2e-3)
            assert told["variance"] == pytest.approx(expected, rel=2e-3)


def playing(scenario, policy, periods, rows=4):
    world = World(scenario)
    state, chooser = world.reset(keys_of(1, rows)), make_policy(policy, scenario)
    for _ in range(periods):
        state, _ = world.step(state, chooser.act(View.of(state)))
    return state


def test_a_lost_target_is_looked_for_all_over_the_room_and_only_there():
    state = World(BLE.override(particles=5000)).reset(keys_of(0, 3))
    x, y = state.belief.particles[:, 0], state.belief.particles[:, 2]
    assert 0 <= x.min() < 0.1 and 20.5 < x.max() <= 20.66 and 0 <= y.min() < 0.1 and 17.5 < y.max() <= 17.641
    assert x.mean() == pytest.approx(10.33, abs=0.3) and x.var() == pytest.approx(20.66**2 / 12, rel=0.05)
    state = playing(BLE, "quadrants:n=0", 40)
    x, y = state.belief.particles[:, 0], state.belief.particles[:, 2]
    assert x.min() >= 0 and x.max() <= np.float32(20.66) and y.min() >= 0 and y.max() <= np.float32(17.641)


def test_the_filter_is_honest_and_biases_make_it_so():
    """Over 300 walks the squared error is what the belief says, give or take; without biases it is far too sure."""
    honest, sure = (
        measure(BLE.override(field_db=2.24, drift_db=drift, temper=1.0), filter_drift)
        for drift, filter_drift in ((2.02, None), (2.02, 0.05))
    )
    assert 0.7 < honest < 1.5 < 2.0 < sure


def measure(scenario, bias_db):
    """ANEES of all receivers; a filter that believes in biases of another sd stands in the same world."""
    world = World(scenario)
    if bias_db is not None:
        for record in (world._constants, world.tracker._constants):
            record["measurement"]["bias_variance"] = bias_db**2
    state, chooser, ratios = world.reset(keys_of(7, 100)), make_policy("all", scenario), []
    for period in range(60):
        state, outcome = world.step(state, chooser.act(View.of(state)))
        if period >= 5:
            ratios.append(outcome.error_m**2 / outcome.posterior_rms_m**2)
    return np.mean(ratios)


# --- who listens ----------------------------------------------------------------------------------------------


def test_listening_is_what_costs_and_nobody_costs_nothing():
    world = World(BLE)
    state = world.reset(keys_of(0, 2))
    three = Cluster(np.array([4, 4]), np.array([[0, 11, 4], [0, 11, 4]]))
    state, outcome = world.step(state, three)
    packets = state.packets[:, 1, [0, 4, 11], 1].astype(float).sum(axis=1)
    np.testing.assert_allclose(outcome.energy_mj, 3 * 16.2 + packets * 128 * 15.9e-6, rtol=1e-9)  # batteries of 20 kJ
    assert (outcome.members == 3).all() and (outcome.delivered <= 3).all()
    state, outcome = world.step(state, Cluster(np.array([NOBODY, 7]), np.zeros((2, 0), int)))
    assert outcome.energy_mj[0] == 0 and outcome.members[0] == 0 and outcome.delivered[0] == 0
    assert outcome.members[1] == 1 and state.network.head[0] == -1
    with_head = World(BLE.override(receiver="head"))
    _, outcome = with_head.step(with_head.reset(keys_of(0, 1)), Cluster(np.array([NOBODY]), np.zeros((1, 0), int)))
    assert outcome.members[0] == 1 and outcome.dropped[0] == 1


def test_who_listens_in_vain_is_taken_for_weak_until_heard_again():
    scenario = BLE.override(loss=0.7, loss_after_loss=0.9, interval_s=1.0)
    world = World(scenario)
    state = world.reset(keys_of(0, 50))
    assert (View.of(state).receivers["latest_db"] == 0).all()
    for period in range(1, 6):
        state, _ = world.step(state, Cluster(np.full(50, 3), np.tile([3, 8], (50, 1))))
        latest, (level, count) = View.of(state).receivers["latest_db"], np.moveaxis(state.packets[:, period], -1, 0)
        assert (latest[:, [0, 1, 2, 4, 5, 6, 7, 9, 10, 11]] == 0).all()
        heard = count[:, [3, 8]] > 0
        assert (latest[:, [3, 8]][heard] == level[:, [3, 8]][heard]).all()
        assert (latest[:, [3, 8]][~heard] <= SILENT_DB).all()
    strongest = make_policy("strongest:n=9", scenario).act(View.of(state))
    assert not np.isin(strongest.members, [3, 8]).any()  # the others have never listened: they come first


def test_the_round_goes_from_quadrant_to_quadrant():
    state, seen = playing(BLE, "quadrants", 1), []
    for period in range(4):
        state.row["period"] = period
        nodes = make_policy("quadrants", BLE).act(View.of(state)).members[0]
        assert len(nodes) == 3
        seen.extend(nodes.tolist())
    assert sorted(seen) == list(range(12))  # everybody once in four periods
    quadrant = [(x > 10.33, y > 8.82) for x, y in BLE.field.positions]
    assert all(len({quadrant[node] for node in seen[k : k + 4]}) == 4 for k in range(0, 12, 4))
    assert all(quadrant[seen[k]] != quadrant[seen[k + 1]] for k in range(11))


def test_all_together_every_fourth_period():
    scenario = BLE.override(periods=12)
    world, state = World(scenario), World(scenario).reset(keys_of(0, 3))
    awake = []
    for _ in range(12):
        state, outcome = world.step(state, make_policy("every:n=4", scenario).act(View.of(state)))
        awake.append(outcome.members[0])
    assert awake == [12, 0, 0, 0] * 3


# --- what is asked for ----------------------------------------------------------------------------------------


def test_periods_of_acquisition_do_not_count_in_the_rms():
    env = ClusterEnv("Ble-v0", particles=100, periods=6, unscored=3)
    env.reset(seed=4)
    errors = [env.step(1)[4] for _ in range(6)]
    rms = np.sqrt(np.mean([info["error_m"] ** 2 for info in errors[3:]]))
    assert errors[-1]["episode_rms_m"] == pytest.approx(rms)


@pytest.mark.parametrize(
    "changes,message",
    [
        (dict(at_1m_db=(-60.0, -61.0)), "Beacon.at_1m_db has 2 entries: must have one for each of 12"),
        (dict(exponents="steep"), "Beacon.exponents = 'steep': must be a finite number, or one for each"),
        (dict(loss=0.9, loss_after_loss=0.1), "Beacon.loss_after_loss = 0.1: must be at least"),
        (dict(search=True), "Tracking.search = True: allowed is False with Beacon levels"),
        (dict(fusion="pooled"), "allowed are False and 'joint' with Beacon levels"),
        (dict(tracker="ekf", velocity_s=None), "cannot read Beacon reports"),
        (dict(depth_m=10.0), "Field.positions spans y = 0.27..17.64: must lie in 0..10.0 m"),
        (dict(unscored=100), "Scenario.unscored = 100: must be below periods = 100"),
        (dict(slowest_ms=2.0), "Walk.slowest_ms = 2.0: must be at most fastest_ms"),
        (dict(calibration="nowhere.json"), "calibration = 'nowhere.json': is no file of `wsn calibrate`"),
        (dict(motion="replay"), "Replay.recording = '': must name a file"),
        (dict(motion="replay", recording="nowhere.mbd"), "Replay.recording = 'nowhere.mbd': cannot be read"),
    ],
)
def test_bad_quantities_are_refused_by_name(changes, message):
    with pytest.raises(ScenarioError, match=message):
        BLE.override(**changes)


def test_only_a_beacon_can_be_replayed():
    with pytest.raises(ScenarioError, match="Scenario.measurement = Position: must be Beacon with the motion 'replay'"):
        Scenario.named("PreDC-v0", motion="replay", recording="x.mbd", periods=5)


def test_a_room_may_be_deeper_than_wide():
    turned = tuple((y, x) for x, y in BLE.field.positions)
    scenario = BLE.override(positions=turned, side_m=17.641, depth_m=20.66, periods=150)
    state = World(scenario).reset(keys_of(0, 50))
    assert 17.641 < state.track[..., 2].max() <= 20.66 - 1 + 1e-9 and state.track[..., 0].max() <= 17.641 - 1 + 1e-9
    for motion in ("waypoint", "turns"):
        track = World(BLE.override(motion=motion, depth_m=17.641, periods=150)).reset(keys_of(0, 50)).track
        assert 17.0 < track[..., 2].max() <= 17.641 and track[..., 0].max() > 17.641


def test_a_calibration_must_be_whole(tmp_path):
    part = {"kind": "wsn_env calibration", "version": 1, "tracks": ["a"], "left_out": None, "found": {}, "versions": {}}
    part["quantities"] = {"positions": [[1, 2]], "loss": 0.1}
    (tmp_path / "c.json").write_text(json.dumps(part))
    with pytest.raises(ScenarioError, match="calibration = '.*c.json': .* quantities.heights_m: is missing"):
        BLE.override(calibration=tmp_path / "c.json")


def test_one_number_serves_all_receivers():
    assert Beacon(at_1m_db=-55).of_nodes(3)[:, 0].tolist() == [-55.0] * 3
    random_field = Scenario.named("PreDC-v0", measurement="beacon", nodes=30, search=False, particles=50, periods=5)
    state = playing(random_field, "all", 5)
    assert np.isfinite(state.belief.mean).all()


def test_a_policy_takes_parameters_after_a_colon():
    assert make_policy("quadrants:n=5", BLE).n == 5
    with pytest.raises(ValueError, match="Quadrants.n = -1"):
        make_policy("quadrants:n=-1", BLE)
    with pytest.raises(ValueError, match="policy 'quadrants:m=5': .*unexpected keyword argument 'm'"):
        make_policy("quadrants:m=5", BLE)
