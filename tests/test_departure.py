"""Episodes that end when the target leaves the field (`ends_outside`)."""

import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from tests.test_env import same
from wsn_env import ClusterEnv, ClusterVectorEnv, Scenario, ScenarioError, evaluate, make_policy
from wsn_env.compiled import draws
from wsn_env.evaluation.scoring import score
from wsn_env.simulation.world import World

SMALL = dict(nodes=36, particles=64, periods=40, speed_ms=3.0, lam=(0.003, 0.02))
QUANTITIES = SMALL | dict(ends_outside=True)
LEAVING = QUANTITIES | dict(scenario="Underwater-v0")


def play(env, seed=0, action=14):
    """(reward, terminated, truncated, info) of every period of an episode."""
    env.reset(seed=seed)
    steps = []
    while not steps or not (steps[-1][1] or steps[-1][2]):
        steps.append(env.step(action)[1:])
    return steps


@pytest.mark.parametrize("reward", ["error", "belief"])
def test_check_env_passes_without_a_warning(reward):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = gym.make("wsn_env/Underwater-v0", reward=reward, render_mode="rgb_array", **QUANTITIES)
        check_env(env.unwrapped)


@pytest.mark.parametrize("reward", ["error", "belief"])
@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_vector_equals_single_environments(mode, reward):
    """Rows that end at different times, over several episodes, to the bit."""
    rows = 32
    native = ClusterVectorEnv(rows, autoreset_mode=mode, reward=reward, **LEAVING)
    single = SyncVectorEnv([lambda: ClusterEnv(reward=reward, **LEAVING)] * rows, autoreset_mode=mode)
    native.action_space.seed(1)
    assert same(native.reset(seed=5), single.reset(seed=5))
    ends = np.zeros(2, int)
    for _ in range(100):
        action = native.action_space.sample()
        ours, theirs = native.step(action), single.step(action)
        assert same(ours, theirs)
        ends += [ours[2].sum(), ours[3].sum()]
        ended = ours[2] | ours[3]
        if mode == AutoresetMode.DISABLED and ended.any():
            assert same(*[envs.reset(options={"reset_mask": ended.copy()}) for envs in (native, single)])
    assert (ends > 0).all()


def test_a_vector_reward_is_charged_in_both_parts():
    env, plain = ClusterEnv(reward="vector", **LEAVING), ClusterEnv(**LEAVING)
    charged = 0
    for seed in range(5):
        for (reward, *_, info), (number, *_) in zip(play(env, seed), play(plain, seed), strict=True):
            assert reward.shape == (2,) and reward.dtype == np.float32
            lam = -info["reward_energy"] / info["energy_mj"]
            assert reward @ np.array([1, lam]) == pytest.approx(number, rel=1e-5)
        charged += info["reward_rest"] < 0
    assert charged > 0


def test_an_episode_terminates_in_the_first_period_outside():
    env = ClusterEnv(**LEAVING)
    side = env.scenario.field.side_m
    early = 0
    for seed in range(10):
        steps = play(env, seed)
        outside = [bool((info["target_m"] < 0).any() or (info["target_m"] > side).any()) for *_, info in steps]
        assert [terminated for _, terminated, *_ in steps] == outside
        assert outside[:-1] == [False] * (len(steps) - 1)
        assert [truncated for *_, truncated, _ in steps] == [k + 1 == 40 for k in range(len(steps))]
        early += len(steps) < 40
        errors = [info["error_m"] for *_, info in steps]
        assert steps[-1][3]["episode_rms_m"] == pytest.approx(np.sqrt(np.mean(np.square(errors))))
        assert steps[-1][3]["antnp"] == np.mean([info["detections"] for *_, info in steps])
        with pytest.raises(gym.error.ResetNeeded, match=f"after {len(steps)} periods"):
            env.step(0)
    assert 0 < early


def test_the_rest_costs_the_reference_a_period():
    env = ClusterEnv(**LEAVING | dict(reference_error_m=100.0, reference_energy_mj=2000.0, lam=0.01))
    for seed in range(5):
        *before, (reward, terminated, _, info) = play(env, seed)
        rest = -120.0 * (40 - len(before) - 1)
        assert info["reward_rest"] == pytest.approx(rest)
        assert reward == pytest.approx(info["reward_error"] + info["reward_energy"] + rest)
        assert all("reward_rest" not in step[3] for step in before)


def test_ending_never_pays():
    """Whoever stays below the reference in the periods left would have had more from playing them."""
    staying = ClusterEnv("Underwater-v0", **SMALL | dict(lam=0.006, periods=15, speed_ms=1.0))
    leaving = ClusterEnv(**LEAVING | dict(lam=0.006, periods=15, speed_ms=60.0))
    for seed in range(5):
        stayed, left = (sum(step[0] for step in play(env, seed)) for env in (staying, leaving))
        assert len(play(leaving, seed)) < 15 and left < stayed


@pytest.fixture(scope="module")
def comparison():
    scenario = Scenario.named("Underwater-v0", **QUANTITIES)
    return evaluate(["nearest0", "nearest4", "strongest_signal"], scenario, lams=[0.003, 0.03], episodes=30)


def test_an_evaluation_means_over_the_periods_played(comparison):
    first, *others = comparison.policies
    periods = comparison.values(first, 0.003, "periods")
    assert (periods < 40).any() and (periods == 40).any()
    for other in others:  # leaving is no policy's doing
        np.testing.assert_array_equal(comparison.values(other, 0.003, "periods"), periods)
    world = World(comparison.scenario)
    for row in comparison.rows[:5]:
        track = world.reset([draws.key_of_seed(row["seed"])]).track[0, 1:, ::2]
        outside = np.flatnonzero(((track < 0) | (track > 1000)).any(axis=1))
        assert row["periods"] == (outside[0] + 1 if len(outside) else 40)


def test_returns_rank_policies_as_without_the_charge(comparison):
    s = comparison.scenario
    for lam in comparison.lams:
        plain = {}
        for policy in comparison.policies:
            played, error, energy, whole = (
                comparison.values(policy, lam, name) for name in ("periods", "error_m", "energy_mj", "return")
            )
            plain[policy] = -played * (error + lam * energy)
            charge = (s.periods - played) * (s.reference_error_m + lam * s.reference_energy_mj)
            np.testing.assert_allclose(whole, plain[policy] - charge)
        for policy in comparison.policies[1:]:
            difference = comparison.difference(policy, comparison.policies[0], lam).mean
            assert difference == pytest.approx((plain[policy] - plain[comparison.policies[0]]).mean())


def test_an_evaluation_has_the_environments_return(comparison):
    env = ClusterEnv(comparison.scenario.override(lam=0.003), action="cluster", observation="view")
    policy = make_policy("nearest4", env.scenario)
    for row in [row for row in comparison.rows if row["policy"] == "nearest4" and row["lam"] == 0.003][:5]:
        observation, _ = env.reset(seed=row["seed"])
        total, ended = 0.0, False
        while not ended:
            observation, reward, terminated, truncated, info = env.step(policy.predict(observation)[0])
            total, ended = total + reward, terminated or truncated
        assert total == pytest.approx(row["return"]) and info["episode_rms_m"] == pytest.approx(row["rms_m"])


@pytest.mark.parametrize("motion", ["cruise", "crossing"])
def test_the_first_draw_is_kept(motion):
    """A track that stays inside by itself is that of the same episode without the option."""
    given = dict(motion=motion, acceleration_ms2=0.05, periods=60, particles=10)
    tracks = [
        World(Scenario.named("Underwater-v0", ends_outside=ends, **given)).reset(np.arange(50)).track
        for ends in (False, True)
    ]
    margin = 60.0 if motion == "cruise" else 0.0
    inside = ((tracks[1][:, :, ::2] >= margin) & (tracks[1][:, :, ::2] <= 1000 - margin)).all(axis=(1, 2))
    assert 0 < inside.sum() < 50
    np.testing.assert_array_equal(tracks[0][inside], tracks[1][inside])
    assert not (tracks[0] == tracks[1]).all(axis=(1, 2))[~inside].any()


def test_nothing_is_reflected():
    given = dict(motion="turns", speed_ms=3.0, periods=100, particles=10)
    inside, through = (
        World(Scenario.named("PreDC-v0", ends_outside=ends, **given)).reset(np.arange(20)).track[..., ::2]
        for ends in (False, True)
    )
    assert inside.min() >= 0 and inside.max() <= 100
    assert through.min() < -10 and through.max() > 110
    assert np.linalg.norm(np.diff(through, axis=1), axis=2).max() == pytest.approx(3.0, rel=1e-3)


def test_bad_input_is_named():
    with pytest.raises(ScenarioError, match="unscored = 3: must be 0 with ends_outside"):
        Scenario.named("Ble-v0", ends_outside=True)
    with pytest.raises(ScenarioError, match="ends_outside = 'yes'"):
        Scenario.named("PreDC-v0", ends_outside="yes")
    with pytest.raises(ValueError, match="ends_outside = True: must be False"):
        score(lambda observations: np.zeros(2, int), ClusterVectorEnv(2, **LEAVING))
