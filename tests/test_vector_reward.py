"""The vector reward: MO-Gymnasium's convention and wrappers, and that it is the scalar reward taken apart."""

import gymnasium as gym
import mo_gymnasium as mo
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from mo_gymnasium.wrappers import LinearReward, MONormalizeReward, MORecordEpisodeStatistics
from mo_gymnasium.wrappers.vector import MORecordEpisodeStatistics as RecordRows
from mo_gymnasium.wrappers.vector import MOSyncVectorEnv

from tests.test_env import SMALL, same
from wsn_env import ClusterEnv, ClusterVectorEnv
from wsn_env.learning.sb3 import SB3VecEnv

SINGLE_PRECISION = 1e-6


def make(**settings) -> ClusterEnv:
    return ClusterEnv(reward="vector", **SMALL | settings)


def play(env, periods, seed=3):
    """Steps of periods with the same menu entries; episodes follow each other."""
    env.reset(seed=seed)
    rng, steps = np.random.default_rng(0), []
    for _ in range(periods):
        steps.append(env.step(int(rng.integers(19))))
        if steps[-1][3]:
            env.reset()
    return steps


def test_it_is_minus_error_and_minus_energy():
    env = make(lam=2.5)
    assert env.reward_dim == 2 and env.reward_space.shape == (2,) and env.reward_space.dtype == np.float32
    scalar = ClusterEnv(lam=2.5, **SMALL)
    assert not hasattr(scalar, "reward_space")
    for ours, theirs in zip(play(env, 20), play(scalar, 20)):
        reward, info = ours[1], ours[4]
        assert reward in env.reward_space
        assert same(reward, np.array([-info["error_m"], -info["energy_mj"]], dtype=np.float32))
        assert info["reward_error"] == pytest.approx(theirs[4]["reward_error"], rel=1e-12)
        assert info["reward_energy"] == theirs[4]["reward_energy"]
        assert same(ours[0], theirs[0])


@pytest.mark.parametrize("lam", [0.3, 4.0, 30.0])
def test_linear_reward_is_the_scalar_environment(lam):
    weighed = LinearReward(make(lam=lam), weight=np.array([1.0, lam]))
    for ours, theirs in zip(play(weighed, 20), play(ClusterEnv(lam=lam, **SMALL), 20)):
        assert ours[1] == pytest.approx(theirs[1], rel=SINGLE_PRECISION)


def test_the_wrappers_of_mo_gymnasium_run():
    steps = play(MORecordEpisodeStatistics(make(), gamma=0.9), SMALL["periods"])
    rewards = np.array([step[1] for step in steps])
    episode = steps[-1][4]["episode"]
    assert episode["r"] == pytest.approx(rewards.sum(axis=0), rel=1e-5)
    assert episode["dr"] == pytest.approx((rewards * 0.9 ** np.arange(len(rewards))[:, None]).sum(axis=0), rel=1e-5)
    normal = play(MONormalizeReward(make(), idx=0), 2 * SMALL["periods"])
    plain = play(make(), 2 * SMALL["periods"])
    assert all(a[1][1] == b[1][1] and a[1][0] != b[1][0] for a, b in zip(normal, plain))
    made = mo.make("wsn_env/PreDC-v0", reward="vector", **SMALL)
    assert same(play(LinearReward(made), 3)[-1][1], play(LinearReward(make()), 3)[-1][1])


def test_rows_equal_mo_gymnasiums_own_vector_environment():
    """Next-step mode, several episodes; the row that only begins has no reward. Statistics count each episode whole."""
    rows, rng = 5, np.random.default_rng(1)
    settings = dict(lam=(0.5, 8.0), radius_m=6.0)
    native = RecordRows(ClusterVectorEnv(rows, reward="vector", **SMALL | settings))
    theirs = MOSyncVectorEnv([lambda: make(**settings)] * rows)
    assert native.unwrapped.reward_dim == 2 and native.unwrapped.reward_space == theirs.reward_space
    assert same(native.reset(seed=5)[0], theirs.reset(seed=5)[0])
    total = np.zeros((rows, 2))
    for k in range(1, 3 * (SMALL["periods"] + 1)):
        actions = rng.integers(0, 19, rows)
        left, right = native.step(actions), theirs.step(actions)
        assert all(same(a, b) for a, b in zip(left[:4], right[:4])) and left[1].shape == (rows, 2)
        total += left[1]
        if k % (SMALL["periods"] + 1) == 0:
            assert not left[1].any()
        elif left[3].all():
            assert left[4]["episode"]["r"] == pytest.approx(total, rel=1e-5)
            total[:] = 0


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_every_autoreset_mode_tells_the_same_of_its_rewards_as_scalar_rows(mode):
    rows, rng = 4, np.random.default_rng(2)
    settings = dict(autoreset_mode=mode, lam=(0.5, 8.0), **SMALL)
    vector, scalar = (ClusterVectorEnv(rows, reward=reward, **settings) for reward in ("vector", "error"))
    for envs in (vector, scalar):
        envs.reset(seed=9)
    for _ in range(2 * SMALL["periods"]):
        actions, lam = rng.integers(0, 19, rows), vector.lam.copy()
        ours, theirs = vector.step(actions), scalar.step(actions)
        assert ours[1] @ np.array([1.0, 0.0]) + lam * ours[1][:, 1] == pytest.approx(theirs[1], rel=SINGLE_PRECISION)
        for name in ("reward_error", "reward_energy"):
            assert ours[4][name] == pytest.approx(theirs[4][name], rel=1e-12)
        if mode == AutoresetMode.SAME_STEP and ours[3].any():
            last = ours[4]["final_info"]
            assert last["reward_error"] == pytest.approx(-last["error_m"], rel=1e-12)
        if mode == AutoresetMode.DISABLED and ours[3].any():
            for envs in (vector, scalar):
                envs.reset(options={"reset_mask": ours[3].copy()})


def test_stable_baselines3_is_refused():
    with pytest.raises(ValueError, match="vector.*one number.*'error' or 'belief'"):
        SB3VecEnv(ClusterVectorEnv(2, reward="vector", autoreset_mode="SameStep", **SMALL))


def test_made_by_gymnasium_without_its_checker():
    env = gym.make("wsn_env/PreDC-v0", reward="vector", disable_env_checker=True, **SMALL)
    env.reset(seed=0)
    assert env.step(12)[1].shape == (2,)
