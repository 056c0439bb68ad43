# /// script
# dependencies = ["wsn_env[train]", "mo-gymnasium==1.3.2"]
# ///
"""MO-Gymnasium's wrappers on the vector reward (-error, -energy), and PPO on a weighing of it.

python examples/mo_gymnasium_ppo.py --steps 20000
"""

import gymnasium as gym
import mo_gymnasium as mo
import numpy as np
import tyro
from closing import ENV, FIELD, Example
from mo_gymnasium.wrappers import LinearReward, MORecordEpisodeStatistics
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import DummyVecEnv

TYPICAL_COST = 1.5  # of a period [m]


class LastEpisode(BaseCallback):
    """Remembers what MORecordEpisodeStatistics told of the last episode."""

    episode = None

    def _on_step(self) -> bool:
        for info in self.locals["infos"]:
            self.episode = info.get("episode", self.episode)
        return True


def main(steps: int = 20_000, rows: int = 32, seed: int = 0) -> None:
    """Train, then play."""
    example = Example("MO-Gymnasium, PPO")

    def weighed() -> gym.Env:
        counted = MORecordEpisodeStatistics(mo.make(ENV, **FIELD | {"reward": "vector"}))
        return LinearReward(counted, weight=np.array([1.0, FIELD["lam"]]) / TYPICAL_COST)

    envs = DummyVecEnv([weighed] * rows)
    model = PPO("MlpPolicy", envs, n_steps=32, batch_size=256, learning_rate=5e-4, gamma=0.95, ent_coef=0.01, seed=seed)
    last = LastEpisode()
    model.learn(steps, callback=last)
    if last.episode:
        error, energy = -last.episode["r"]
        print(f"the last episode of training: {error:.1f} m and {energy:.1f} mJ, each the sum of its periods")
    # By chance, as it trained: of the true error so few periods tell little, and the likeliest entry may be a bad one.
    example.close(lambda observations: model.predict(observations)[0], model.num_timesteps)


if __name__ == "__main__":
    tyro.cli(main)
