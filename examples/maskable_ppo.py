# /// script
# dependencies = ["wsn_env[train]", "sb3-contrib==2.9.2"]
# ///
"""sb3-contrib's MaskablePPO on the native batch: entries of the menu that stand for another are never taken.

python examples/maskable_ppo.py --steps 20000
"""

import gymnasium as gym
import tyro
from closing import ENV, FIELD, Example
from sb3_contrib import MaskablePPO

from wsn_env.learning.sb3 import SB3VecEnv
from wsn_env.learning.training_reward import TrainingReward


def main(steps: int = 20_000, rows: int = 64, seed: int = 0) -> None:
    """Train, then play."""
    example = Example("sb3-contrib MaskablePPO")
    envs = gym.make_vec(ENV, rows, vectorization_mode="vector_entry_point", autoreset_mode="Disabled", **FIELD)
    batch = SB3VecEnv(TrainingReward(envs))  # finds the environment's action_masks() by itself
    model = MaskablePPO("MlpPolicy", batch, n_steps=16, batch_size=256, learning_rate=1e-3, gamma=0.95, seed=seed)
    model.learn(steps)

    def act(observations):
        masks = example.held_out.unwrapped.action_masks()
        return model.predict(observations, action_masks=masks, deterministic=True)[0]

    example.close(act, model.num_timesteps)


if __name__ == "__main__":
    tyro.cli(main)
