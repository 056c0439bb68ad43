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


class LastEpisode(BaseCallback):
    """Remembers what MORecordEpisodeStatistics told of the last episode."""

    def _on_step(self) -> bool:
        for info in self.locals["infos"]:
            self.episode = info.get("episode", getattr(self, "episode", None))
        return True


def main(steps: int = 20_000, rows: int = 8, seed: int = 0) -> None:
    """Train, then play."""
    example = Example("MO-Gymnasium, PPO")

    def weighed() -> gym.Env:
        counted = MORecordEpisodeStatistics(mo.make(ENV, **FIELD | {"reward": "vector"}))
        return LinearReward(counted, weight=np.array([1.0, FIELD["lam"]]))

    envs = DummyVecEnv([weighed] * rows)
    model = PPO("MlpPolicy", envs, n_steps=128, batch_size=256, learning_rate=1e-3, gamma=0.95, seed=seed)
    last = LastEpisode()
    model.learn(steps, callback=last)
    error, energy = -last.episode["r"]
    print(f"the last episode of training: {error:.1f} m and {energy:.1f} mJ, each the sum of its periods")
    example.close(lambda observations: model.predict(observations, deterministic=True)[0], model.num_timesteps)


if __name__ == "__main__":
    tyro.cli(main)
