# /// script
# dependencies = ["wsn_env[train]", "sb3-contrib==2.9.2"]
# ///
"""sb3-contrib's RecurrentPPO on the native batch: an LSTM remembers what the observation leaves out.

python examples/recurrent_ppo.py --steps 20000
"""

import gymnasium as gym
import numpy as np
import tyro
from closing import ENV, FIELD, Example
from sb3_contrib import RecurrentPPO

from wsn_env.learning.sb3 import SB3VecEnv
from wsn_env.learning.training_reward import TrainingReward


def main(steps: int = 20_000, rows: int = 64, seed: int = 0) -> None:
    """Train, then play."""
    example = Example("sb3-contrib RecurrentPPO")
    envs = gym.make_vec(ENV, rows, vectorization_mode="vector_entry_point", autoreset_mode="Disabled", **FIELD)
    shape = dict(lstm_hidden_size=64, enable_critic_lstm=False, shared_lstm=True)
    settings = dict(n_steps=16, batch_size=256, learning_rate=1e-3, gamma=0.95, seed=seed, policy_kwargs=shape)
    model = RecurrentPPO("MlpLstmPolicy", SB3VecEnv(TrainingReward(envs)), **settings)
    model.learn(steps)
    memory, first = None, np.ones(example.held_out.num_envs, bool)

    def act(observations):
        nonlocal memory
        actions, memory = model.predict(observations, memory, first, deterministic=True)
        first[:] = False
        return actions

    example.close(act, model.num_timesteps)


if __name__ == "__main__":
    tyro.cli(main)
