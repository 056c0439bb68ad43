"""A filter whose target switches between modes of motion."""

import numpy as np
import pytest
from numba import njit

from tests.worlds import assert_same, keys_of
from wsn_env import Cluster, Scenario, View, World, make_policy
from wsn_env.agents.imagined import draw_worlds, imagined_world, place_nodes
from wsn_env.compiled import draws
from wsn_env.envs.features import BELIEF_FEATURES, MOTION_FEATURES
from wsn_env.envs.observations import make_observation
from wsn_env.filters.modes import allot_modes, inherit_modes, predict_by_mode
from wsn_env.models.motion.modes import COUNT, DRAWS, LONG_RUN, MODES, next_mode, predict_mixture
from wsn_env.scenario.constants import constants

MANOEUVRE = 0.6
CLOUD = 400_000
LEAVES = np.array([mode.leaves for mode in MODES])
SHARES = np.array([mode.draws for mode in MODES]) / DRAWS


def scenario_of(motion="crossing", **changes):
    return Scenario.named("PreDC-v0", motion=motion, **dict(manoeuvre_q=MANOEUVRE, particles=1000) | changes)


@njit
def moved(cs, x, modes, seed):
    predict_by_mode(draws.stream(np.uint64(seed), 1, 7), x, modes, cs[0].tracking)


@njit
def mixture(cs, mean, cov, probabilities, predicted_mean, predicted_cov):
    predict_mixture(mean, cov, probabilities, cs[0].tracking, predicted_mean, predicted_cov)


def test_in_the_long_run_modes_are_as_often_as_said():
    """The Markov chain's own stationary distribution."""
    chain = np.diag(1 - LEAVES) + LEAVES[:, None] * SHARES
    np.testing.assert_allclose(LONG_RUN @ chain, LONG_RUN, atol=1e-12)
    assert LONG_RUN.sum() == pytest.approx(1)


def test_shares_of_the_modes_are_whole():
    assert sum(mode.draws for mode in MODES) == DRAWS and all(0 < mode.leaves < 1 for mode in MODES)


@pytest.mark.parametrize("mode", range(COUNT))
def test_the_predicted_moments_are_those_of_the_particles(mode):
    """All start in one mode, with velocities that vary a little: moments within four standard errors."""
    cs, rng = constants(scenario_of()), np.random.default_rng(mode)
    mean, cov = np.array([40.0, 1.2, 60.0, -0.7]), np.diag([4.0, 0.01, 4.0, 0.01])
    x = rng.multivariate_normal(mean, cov, CLOUD).T.astype(np.float32)
    modes = np.full(CLOUD, mode, np.int8)
    moved(cs, x, modes, 3 + mode)
    probabilities, predicted = np.zeros(COUNT), (np.empty(4), np.empty((4, 4)))
    probabilities[mode] = 1.0
    mixture(cs, mean, cov, probabilities, *predicted)
    sds = np.sqrt(np.diag(predicted[1]))
    assert (abs(x.mean(axis=1) - predicted[0]) < 4 * sds / CLOUD**0.5 + 1e-4).all()
    off = np.cov(x.astype(float)) - predicted[1]
    # Of a mixture's heavy tails: three times a normal's standard error; and the second order of a turn, left out.
    assert (abs(off) < 12 * np.outer(sds, sds) * (2 / CLOUD) ** 0.5 + 2e-3 * np.outer(sds, sds)).all()


@pytest.mark.parametrize("mode", range(COUNT))
def test_a_mode_ends_as_often_as_said_and_others_follow_in_their_shares(mode):
    modes, x = np.full(CLOUD, mode, np.int8), np.zeros((4, CLOUD), np.float32)
    moved(constants(scenario_of()), x, modes, 8)
    counts = np.bincount(modes, minlength=COUNT) / CLOUD
    expected = LEAVES[mode] * SHARES + (1 - LEAVES[mode]) * (np.arange(COUNT) == mode)
    assert abs(counts - expected).max() < 4 * (0.25 / CLOUD) ** 0.5 + 32 / 2**14  # probabilities are rounded so


def test_particles_begin_with_the_modes_shares_and_keep_their_ancestors():
    modes, probabilities = np.zeros(64 * DRAWS, np.int8), np.empty(COUNT)
    allot_modes(modes, probabilities)
    np.testing.assert_allclose(np.bincount(modes, minlength=COUNT) / len(modes), SHARES)
    np.testing.assert_allclose(probabilities, SHARES)
    ancestors = np.sort(np.random.default_rng(0).integers(len(modes), size=len(modes))).astype(np.int32)
    before = modes.copy()
    inherit_modes(modes, ancestors, np.empty(len(modes), np.int32))
    np.testing.assert_array_equal(modes, before[ancestors])


def play(scenario, rows=60, seed=4):
    """Root mean square error (rows,) and mean NEES of nearest4's episodes; the final state."""
    world, policy = World(scenario, threads=1), make_policy("nearest4", scenario)
    state, squares, nees = world.reset(keys_of(seed, rows)), 0, 0
    for _ in range(scenario.periods):
        state, outcome = world.step(state, policy.act(View.of(state)), donate=True)
        off = state.belief.mean[:, ::2] - outcome.target_m
        inverse = np.linalg.inv(state.belief.cov[:, ::2, ::2] + 1e-9 * np.eye(2))
        squares, nees = squares + outcome.error_m**2, nees + np.einsum("bi,bij,bj->b", off, inverse, off) / 2
    return np.sqrt(squares / scenario.periods), nees / scenario.periods, state


@pytest.mark.parametrize("motion", ["turns", "waypoint", "circle", "walk"])
def test_it_follows_as_well_as_the_noise_that_fits_though_nobody_tells(motion):
    """Paired with the best of fixed noises, q of each motion in hindsight: .1 for a walk, .2 for the others."""
    fitting, _, _ = play(scenario_of(motion, manoeuvre_q=None, filter_q=0.1 if motion == "walk" else 0.2))
    found, nees, _ = play(scenario_of(motion))
    worse = found - 1.03 * fitting
    assert worse.mean() < 2 * worse.std() / len(worse) ** 0.5
    assert 0.6 < np.median(nees) < 1.6


def mean_modes(scenario, rows=40):
    """(COUNT,) probabilities over the last periods of nearest4's episodes."""
    world, policy = World(scenario, threads=1), make_policy("nearest4", scenario)
    state, total = world.reset(keys_of(4, rows)), np.zeros(COUNT)
    for period in range(scenario.periods):
        state, _ = world.step(state, policy.act(View.of(state)), donate=True)
        total += state.belief.mode_probabilities.mean(axis=0) * (period >= 30)
    return total / (scenario.periods - 30)


def test_the_modes_are_those_of_the_motion():
    """Who flies a circle to the left turns left; who goes straight is quiet."""
    circling, straight = (mean_modes(scenario_of(motion, particles=3000)) for motion in ("circle", "straight"))
    quiet, left, right = 0, 2, 3
    assert circling[left] > 0.2 > 10 * circling[right] and circling[left] > 20 * straight[left]
    assert straight[quiet] > 0.85 > 2 * circling[quiet]


@pytest.mark.parametrize(("changes", "low", "high"), [({}, 0.9, 1.1), (dict(faults="biased,share=1,bias_m=9"), 2, 9)])
def test_reports_surprise_as_much_as_expected_where_the_model_holds(changes, low, high):
    """Filter and track have the same noise; sensors that are off by 9 m are another matter."""
    free = dict(motion="free", acceleration_ms2=0.05, filter_q=0.05, search=False, spread_m=10.0, speed_ms=0.2)
    world = World(Scenario.named("PreDC-v0", **free, **changes), threads=1)
    state, policy, seen = world.reset(keys_of(9, 80)), make_policy("nearest4", world.scenario), []
    for period in range(60):
        state, _ = world.step(state, policy.act(View.of(state)), donate=True)
        seen += [state.belief.surprise.mean()] if period > 20 else []
    assert low < np.mean(seen) < high


def test_observations_tell_of_the_motion():
    scenario = scenario_of("turns")
    world, policy = World(scenario, threads=1), make_policy("nearest2", scenario)
    state = world.reset(keys_of(2, 5))
    for _ in range(20):
        state, _ = world.step(state, policy.act(View.of(state)))
    view = View.of(state)
    for name in ("candidates", "menu"):
        told = make_observation(name, scenario, "nearest", 12).encode(view)
        first = len(BELIEF_FEATURES)
        features = told[:, first : first + len(MOTION_FEATURES)]
        np.testing.assert_allclose(features[:, 0], 0.5 * np.log(state.belief.surprise), atol=1e-6)
        np.testing.assert_allclose(features[:, 1:], state.belief.mode_probabilities, atol=1e-6)
        again = View.from_arrays(view.as_arrays())
        np.testing.assert_array_equal(make_observation(name, scenario, "nearest", 12).encode(again), told)


def test_a_policy_that_was_trained_with_modes_plays_with_a_filter_that_has_none():
    scenario = scenario_of("crossing", particles=200, filter_q=0.05)
    policy, world = make_policy("ppo", scenario), World(scenario, threads=1)
    state = world.reset(keys_of(1, 20))
    for _ in range(20):
        state, outcome = world.step(state, policy.act(View.of(state)))
    assert outcome.error_m.mean() < 5


def test_a_head_that_draws_its_particles_anew_draws_modes_too():
    """Of the mean and the covariance handed over nobody knows the modes."""
    scenario = scenario_of("circle", redraw_on_handover=True, particles=32 * 50, nodes=400)
    world = World(scenario, threads=1)
    state = world.reset(keys_of(1, 4))
    everybody = np.tile(np.arange(400), (4, 1))
    for _ in range(40):
        state, _ = world.step(state, Cluster(np.zeros(4, int), everybody))
    assert (np.bincount(state.belief.modes.ravel(), minlength=COUNT) / state.belief.modes.size)[2] > 0.3  # turning
    state, outcome = world.step(state, Cluster(np.full(4, 30), np.full((4, 0), -1)))  # the new head hears nothing
    assert outcome.handover.all() and (outcome.delivered <= 1).all()
    moved = (1 - LEAVES) * SHARES + (LEAVES * SHARES).sum() * SHARES
    for row in range(4):
        assert np.bincount(state.belief.modes[row], minlength=COUNT) / 1600 == pytest.approx(moved, abs=0.05)


def test_a_batch_has_the_bits_of_its_rows():
    scenario = scenario_of("turns", particles=50, periods=12)
    keys = keys_of(1, 9)
    batch, alone = (World(scenario, threads=2).reset(keys), World(scenario, threads=1).reset(keys[4:5]))
    policy = make_policy("nearest2", scenario)
    for _ in range(scenario.periods):
        batch, _ = World(scenario, threads=2).step(batch, policy.act(View.of(batch)))
        alone, _ = World(scenario, threads=1).step(alone, policy.act(View.of(alone)))
        assert_same(batch.belief, alone.belief, slice(4, 5))


def test_targets_that_the_planner_imagines_move_as_the_filter_supposes():
    """From the belief's modes: after a period their moments are the prediction's."""
    scenario = scenario_of("turns", particles=400, periods=20)
    world, policy = World(scenario, threads=1), make_policy("nearest3", scenario)
    state, rows = world.reset([draws.key_of_seed(3)]), 20_000
    for _ in range(10):
        state, _ = world.step(state, policy.act(View.of(state)))
    own = state.belief.row[0]
    own["mode_probabilities"] = 0.3, 0.1, 0.4, 0.0, 0.2
    mean, cov = own["predicted_mean"], own["predicted_cov"]
    mixture(constants(scenario), own["mean"], own["cov"], own["mode_probabilities"], mean, cov)
    imagined = imagined_world(scenario, 3, 100)
    assert imagined.scenario.tracking.switches
    drawn = imagined.allocate(rows)
    place_nodes(drawn, View.of(state))
    draw_worlds(drawn, View.of(state), imagined, 0, rows)
    ahead = drawn.track[:, 1]
    pairs = 0.5 * (ahead[::2] + ahead[1::2])  # opposite worlds
    assert (abs(pairs.mean(axis=0) - mean) < 4 * pairs.std(axis=0) / (rows / 2) ** 0.5 + 1e-9).all()
    sd = np.sqrt(np.diag(cov))  # tails are heavier than normal
    assert abs((np.cov(ahead.T) - cov) / np.outer(sd, sd)).max() < 4 * (3 / (rows / 2)) ** 0.5
    np.testing.assert_allclose(drawn.belief.mode_probabilities[5], own["mode_probabilities"])
    shares = np.bincount(drawn.belief.modes[:100].ravel(), minlength=COUNT) / 10_000
    assert shares == pytest.approx(own["mode_probabilities"], abs=0.02)  # 4 standard errors


def test_one_target_switches_as_a_particle_does():
    """Its next mode over all pairs of shares: kept but where it leaves, then drawn."""
    grid = (np.arange(512) + 0.5) / 512
    for mode in range(COUNT):
        following = np.bincount([next_mode(mode, a, b) for a in grid for b in grid[::16]], minlength=COUNT) / (512 * 32)
        wanted = LEAVES[mode] * SHARES + (1 - LEAVES[mode]) * (np.arange(COUNT) == mode)
        assert following == pytest.approx(wanted, abs=1.5 / 512)


@pytest.mark.parametrize(
    "more", [dict(tracker="ekf"), dict(velocity_s=5.0), dict(filter_q=0.1), dict(manoeuvre_q=None)]
)
def test_who_says_how_the_target_moves_has_no_modes(more):
    scenario = scenario_of(**more, particles=20)
    state = World(scenario, threads=1).reset([1])
    assert not scenario.tracking.switches and state.belief.modes.shape == (1, 0)
    np.testing.assert_allclose(state.belief.mode_probabilities, LONG_RUN[None])
