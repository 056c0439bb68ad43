# /// script
# dependencies = ["wsn_env[train]", "sbx-rl==0.28.0"]
# ///
"""SBX's PPO, stable-baselines3 in JAX, on the native batch.

python examples/sbx_ppo.py --steps 20000

`SB3VecEnv` serves as with stable-baselines3, and models predict alike.
"""

import gymnasium as gym
import tyro
from closing import ENV, FIELD, Example
from sbx import PPO

from wsn_env.learning.sb3 import SB3VecEnv
from wsn_env.learning.training_reward import TrainingReward


def main(steps: int = 20_000, rows: int = 64, seed: int = 0) -> None:
    """Train, then play."""
    example = Example("SBX PPO")
    envs = gym.make_vec(ENV, rows, vectorization_mode="vector_entry_point", autoreset_mode="Disabled", **FIELD)
    settings = dict(n_steps=16, batch_size=256, n_epochs=10, learning_rate=1e-3, gamma=0.95, seed=seed)
    model = PPO("MlpPolicy", SB3VecEnv(TrainingReward(envs)), **settings)
    model.learn(steps)
    example.close(lambda observations: model.predict(observations, deterministic=True)[0], model.num_timesteps)


if __name__ == "__main__":
    tyro.cli(main)
