# /// script
# dependencies = ["wsn_env[train]", "minari[create,hdf5]==0.5.4"]
# ///
"""Minari: record Pre-DC, clone its behaviour from the dataset, then go on with PPO.

    python examples/minari_cloning.py --steps 20000

A quarter of the time steps is recorded, the others are PPO's.
"""

import os
from tempfile import TemporaryDirectory

import gymnasium as gym
import minari
import numpy as np
import torch
import tyro
from closing import ENV, FIELD, Example
from demonstrations import record
from stable_baselines3 import PPO

from wsn_env import score
from wsn_env.learning.sb3 import SB3VecEnv
from wsn_env.learning.training_reward import TrainingReward


def clone(model: PPO, dataset: minari.MinariDataset, epochs: int = 60) -> None:
    """Make the recorded actions likely."""
    episodes = list(dataset.iterate_episodes())
    seen = torch.as_tensor(np.concatenate([one.observations[:-1] for one in episodes]))
    did = torch.as_tensor(np.concatenate([one.actions for one in episodes]))
    for _ in range(epochs):
        for batch in torch.randperm(len(did)).split(256):
            _, log_probability, _ = model.policy.evaluate_actions(seen[batch], did[batch])
            model.policy.optimizer.zero_grad()
            (-log_probability.mean()).backward()
            model.policy.optimizer.step()


def main(steps: int = 20_000, rows: int = 64, seed: int = 0) -> None:
    """Record, clone, train, play."""
    example = Example("Minari, cloning and PPO")
    envs = gym.make_vec(ENV, rows, vectorization_mode="vector_entry_point", autoreset_mode="Disabled", **FIELD)
    batch = SB3VecEnv(TrainingReward(envs))
    model = PPO("MlpPolicy", batch, n_steps=16, batch_size=256, learning_rate=1e-3, gamma=0.95, seed=seed)

    def act(observations):
        return model.predict(observations, deterministic=True)[0]

    recorded = max(1, steps // 4 // envs.unwrapped.scenario.periods)
    with TemporaryDirectory() as folder:
        os.environ["MINARI_DATASETS_PATH"] = folder
        dataset = record(recorded, seed)
        print(f"recorded: {dataset.total_episodes} episodes, {dataset.total_steps:,} time steps")
        clone(model, dataset)
    print(f"cloned: return {score(act, example.held_out).mean():.1f}")
    model.learn(steps - dataset.total_steps)
    example.close(act, dataset.total_steps + model.num_timesteps)


if __name__ == "__main__":
    tyro.cli(main)
