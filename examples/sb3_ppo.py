# /// script
# dependencies = ["wsn_env[train]"]
# ///
"""stable-baselines3's PPO on the native batch.

    python examples/sb3_ppo.py --steps 20000

`SB3VecEnv` hands the batch over as it is. train.py does the same with a network of its own.
"""

import gymnasium as gym
import tyro
from closing import ENV, FIELD, Example
from stable_baselines3 import PPO

from wsn_env.learning.sb3 import SB3VecEnv
from wsn_env.learning.training_reward import TrainingReward


def main(steps: int = 20_000, rows: int = 64, seed: int = 0) -> None:
    """Train, then play."""
    example = Example("stable-baselines3 PPO")
    envs = gym.make_vec(ENV, rows, vectorization_mode="vector_entry_point", autoreset_mode="Disabled", **FIELD)
    model = PPO("MlpPolicy", SB3VecEnv(TrainingReward(envs)), n_steps=16, batch_size=256, learning_rate=1e-3, seed=seed)
    model.learn(steps)
    example.close(lambda observations: model.predict(observations)[0], model.num_timesteps)


if __name__ == "__main__":
    tyro.cli(main)
