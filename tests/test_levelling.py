"""What levelling does to PPO's advantages, and what it leaves alone."""

import numpy as np
import torch
from gymnasium.spaces import Box, Discrete
from stable_baselines3.common.buffers import RolloutBuffer

from wsn_env.learning.levelling import WIDTH, LevelledRollout

PERIODS, ROWS, TIMES = 64, 256, 10.0


def fill(kind, **more):
    """A rollout in which one row in eight has a wide belief, and advantages TIMES the size."""
    buffer = kind(PERIODS, Box(-10, 10, (5,), np.float32), Discrete(3), n_envs=ROWS, gamma=0.95, gae_lambda=0.0, **more)
    rng = np.random.default_rng(3)
    wide = np.arange(ROWS) % 8 == 0
    buffer.observations[:] = 0.0
    buffer.observations[..., WIDTH] = np.where(wide, 2.5, -0.7)
    buffer.rewards[:] = rng.normal(size=(PERIODS, ROWS)) * np.where(wide, TIMES, 1.0)
    buffer.compute_returns_and_advantage(torch.zeros(ROWS), np.zeros(ROWS))
    return buffer, wide


def size(advantages):
    return np.sqrt((advantages**2).mean())


def test_whole_levelling_gives_all_widths_one_size():
    buffer, wide = fill(LevelledRollout, level=1.0)
    assert 0.95 < size(buffer.advantages[:, wide]) / size(buffer.advantages[:, ~wide]) < 1.05


def test_half_of_it_takes_the_root():
    buffer, wide = fill(LevelledRollout, level=0.5)
    assert 0.95 < size(buffer.advantages[:, wide]) / size(buffer.advantages[:, ~wide]) / TIMES**0.5 < 1.05


def test_within_a_width_advantages_keep_their_proportions_and_returns_stay():
    plain, wide = fill(RolloutBuffer)
    levelled, _ = fill(LevelledRollout, level=1.0)
    assert (levelled.returns == plain.returns).all()
    for rows in (wide, ~wide):
        ratio = levelled.advantages[:, rows] / plain.advantages[:, rows]
        assert np.allclose(ratio, ratio.flat[0], rtol=1e-6) and ratio.flat[0] > 0


def test_no_levelling_changes_nothing():
    assert (fill(LevelledRollout, level=0.0)[0].advantages == fill(RolloutBuffer)[0].advantages).all()


def test_a_width_hardly_ever_met_is_not_taken_for_its_luck():
    """Two transitions of a width never met before, hugely lucky: they are divided by far less than their own size."""
    buffer, _ = fill(LevelledRollout, level=1.0)
    before = size(buffer.advantages)
    buffer.observations[0, :2, WIDTH] = 5.0
    buffer.rewards[0, :2] = 3000.0
    buffer.compute_returns_and_advantage(torch.zeros(ROWS), np.zeros(ROWS))
    assert abs(buffer.advantages[0, :2]).min() > 3 * before
