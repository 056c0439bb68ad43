# /// script
# dependencies = ["wsn_env", "torch==2.13.0", "tianshou==2.0.1"]
# ///
"""Tianshou's PPO, through an adapter: its vector environments are made of single ones, which `Native` is not.

python examples/tianshou_ppo.py --steps 20000
"""

import gymnasium as gym
import numpy as np
import torch
import tyro
from closing import ENV, FIELD, Example
from tianshou.algorithm import PPO
from tianshou.algorithm.modelfree.reinforce import DiscreteActorPolicy
from tianshou.algorithm.optim import AdamOptimizerFactory
from tianshou.data import Collector, VectorReplayBuffer
from tianshou.env import BaseVectorEnv
from tianshou.trainer import OnPolicyTrainerParams
from tianshou.utils.net.common import Net
from tianshou.utils.net.discrete import DiscreteActor, DiscreteCritic

from wsn_env.learning.training_reward import TrainingReward


class Native(BaseVectorEnv):
    """The native batch, all rows of which Tianshou's collector steps at once; it says itself which begin anew."""

    is_async = is_closed = False

    def __init__(self, envs: gym.vector.VectorEnv):
        self.envs, self.env_num = envs, envs.num_envs

    def get_env_attr(self, key, id=None):
        """Of one row, for each."""
        name = {"action_space": "single_action_space", "observation_space": "single_observation_space"}.get(key, key)
        return [getattr(self.envs, name)] * self.env_num

    def reset(self, env_id=None, seed=None, **kwargs):
        """Rows env_id begin anew."""
        rows = np.arange(self.env_num) if env_id is None else np.asarray(env_id)
        mask = np.isin(np.arange(self.env_num), rows)
        observations, _ = self.envs.reset(seed=seed, options={"reset_mask": mask})
        return observations[rows], np.array([{} for _ in rows])

    def step(self, action, id=None):
        """All rows."""
        observations, rewards, terminated, truncated, _ = self.envs.step(action)
        return observations, rewards, terminated, truncated, np.array([{"env_id": i} for i in range(self.env_num)])

    def close(self):
        """Close."""
        self.envs.close()


def main(steps: int = 20_000, rows: int = 64, rollout: int = 16, seed: int = 0) -> None:
    """Train, then play."""
    torch.manual_seed(seed)
    np.random.seed(seed)  # Tianshou shuffles its batches with it
    example = Example("Tianshou PPO")
    native = gym.make_vec(ENV, rows, vectorization_mode="vector_entry_point", autoreset_mode="Disabled", **FIELD)
    envs = Native(TrainingReward(native))
    space, actions = example.held_out.single_observation_space, example.held_out.single_action_space
    layers = dict(state_shape=space.shape, hidden_sizes=[64, 64], activation=torch.nn.Tanh)
    actor = DiscreteActor(preprocess_net=Net(**layers), action_shape=actions.n, softmax_output=False)
    algorithm = PPO(
        policy=DiscreteActorPolicy(actor=actor, action_space=actions, observation_space=space, deterministic_eval=True),
        critic=DiscreteCritic(preprocess_net=Net(**layers)),
        optim=AdamOptimizerFactory(lr=1e-3),
        gamma=0.95,
        gae_lambda=0.9,
        ent_coef=1e-3,
        max_grad_norm=0.5,
    )
    collector = Collector(algorithm, envs, VectorReplayBuffer(rollout * rows, rows))
    collector.reset(gym_reset_kwargs={"seed": seed})
    updates = -(-steps // (rollout * rows))
    algorithm.run_training(
        OnPolicyTrainerParams(
            training_collector=collector,
            max_epochs=1,
            epoch_num_steps=updates * rollout * rows,
            collection_step_num_env_steps=rollout * rows,
            update_step_num_repetitions=4,
            batch_size=256,
            verbose=False,
            show_progress=False,
        )
    )
    with torch.no_grad():
        example.close(lambda observations: actor(observations)[0].argmax(1).numpy(), updates * rollout * rows)


if __name__ == "__main__":
    tyro.cli(main)
