"""Advantages of one size in every world of a training."""

import gymnasium as gym
import numpy as np
import pytest
import torch
from stable_baselines3.common.buffers import RolloutBuffer

from wsn_env.learning.even_worlds import EvenWorldsBuffer
from wsn_env.learning.sb3 import SB3VecEnv
from wsn_env.training import trainer as train

SETTINGS = dict(gamma=0.9, gae_lambda=0.8)


def filled(kind, rewards, **more):
    """A buffer after a rollout with these rewards (T, B)."""
    buffer = kind(
        len(rewards), gym.spaces.Box(-1, 1, (1,)), gym.spaces.Discrete(2), n_envs=rewards.shape[1], **SETTINGS, **more
    )
    nothing = np.zeros((rewards.shape[1], 1), np.float32)
    for reward in rewards:
        buffer.add(nothing, nothing, reward, nothing[:, 0], torch.zeros(len(reward), 1), torch.zeros(len(reward)))
    buffer.compute_returns_and_advantage(torch.zeros(len(nothing), 1), nothing[:, 0])
    return buffer


def test_every_world_has_its_own_mean_and_size_and_returns_stay():
    rewards = np.random.default_rng(0).normal(size=(30, 9)).astype(np.float32)
    rewards[:, 3:] = 40 * rewards[:, 3:] - 100  # a world of larger costs
    plain, even = filled(RolloutBuffer, rewards), filled(EvenWorldsBuffer, rewards, rows=[3, 6])
    assert np.array_equal(even.returns, plain.returns)
    for rows in (slice(3), slice(3, 9)):
        own = plain.advantages[:, rows]
        assert even.advantages[:, rows] == pytest.approx((own - own.mean()) / own.std(), abs=1e-4)
    assert plain.advantages[:, 3:].std() > 20 * plain.advantages[:, :3].std()


def test_a_world_without_differences_moves_nothing():
    rewards = np.zeros((5, 4), np.float32)
    rewards[:, 2:] = np.random.default_rng(0).normal(size=(5, 2))
    even = filled(EvenWorldsBuffer, rewards, rows=[2, 2])
    assert (even.advantages[:, :2] == 0).all() and np.isfinite(even.advantages).all()


@pytest.mark.parametrize("even", [True, False])
def test_a_training_takes_the_worlds_that_it_has(even):
    settings = train.Training(
        rows=20, rollout=4, batch=80, set=["particles=50"], vary=["nodes=81", "nodes=400"], even_worlds=even
    )
    scenario = train.complete_settings(settings)
    interface = train.Settings(settings.action, "menu", settings.reward, settings.order)
    envs = train.make_envs(settings, scenario, interface, settings.rows)
    assert [part.num_envs for part in envs.parts] == [6, 7, 7]
    buffer = train.make_model(settings, train.ReplayableRows(SB3VecEnv(envs, stagger=True))).rollout_buffer
    assert isinstance(buffer, EvenWorldsBuffer) == even
