# /// script
# dependencies = ["wsn_env", "torch==2.13.0", "peft==0.21.2", "agilerl==2.58.0"]
# ///
"""AgileRL's PPO: takes the native batch as it is, and masks of actions from its infos.

python examples/agilerl_ppo.py --steps 20000

One agent; `train_on_policy` with a population of them, and its mutations, takes the same environment.
"""

import gymnasium as gym
import numpy as np
import torch
import tyro
from agilerl.algorithms import PPO
from agilerl.rollouts import collect_rollouts
from closing import ENV, FIELD, Example

from wsn_env.learning.training_reward import TrainingReward


def main(steps: int = 20_000, rows: int = 64, rollout: int = 16, seed: int = 0) -> None:
    """Train, then play."""
    torch.manual_seed(seed)
    np.random.seed(seed)  # AgileRL shuffles its batches with it
    example = Example("AgileRL PPO")
    masked = dict(vectorization_mode="vector_entry_point", autoreset_mode="SameStep", action_mask=True)
    envs = TrainingReward(gym.make_vec(ENV, rows, **masked, **FIELD))
    agent = PPO(
        envs.single_observation_space,
        envs.single_action_space,
        net_config={"latent_dim": 64, "encoder_config": {"hidden_size": [64]}, "head_config": {"hidden_size": [64]}},
        batch_size=256,
        lr=1e-3,
        learn_step=rollout * rows,
        gamma=0.95,
        gae_lambda=0.9,
        ent_coef=1e-3,
        update_epochs=10,
        num_envs=rows,
    )
    observations, info = envs.reset(seed=seed)
    before = observations, np.zeros(rows), np.zeros(rows), info  # and which episodes ended, and their scores
    updates = -(-steps // (rollout * rows))
    for _ in range(updates):
        names = "last_obs", "last_done", "last_scores", "last_info"
        _, *before = collect_rollouts(agent, envs, n_steps=rollout, **dict(zip(names, before)))
        agent.learn()
    agent.set_training_mode(False)

    def act(observations):
        masks = example.held_out.unwrapped.action_masks()
        return agent.get_action(observations, action_mask=masks)[0]

    example.close(act, updates * rollout * rows)


if __name__ == "__main__":
    tyro.cli(main)
