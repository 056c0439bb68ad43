# /// script
# dependencies = [
#     "wsn_env[train]", "minari[create,hdf5]==0.5.4",
#     "datasets", "huggingface-sb3>=3", "sacred", "scikit-learn",
# ]
# [tool.examples]
# without-dependencies = ["seals==0.2.1", "imitation==1.0.1"]
# ///
"""imitation clones Pre-DC's behaviour from a Minari dataset, then goes on with GAIL on the native batch.

python examples/imitation_gail.py --steps 20000

imitation 1.0.1 asks for gymnasium~=0.29 and stable-baselines3~=2.2.1, and works with later ones: pip install --no-deps
"""

import os
from tempfile import TemporaryDirectory

import gymnasium as gym
import numpy as np
import tyro
from closing import ENV, FIELD, Example
from demonstrations import record
from imitation.algorithms.adversarial.gail import GAIL
from imitation.algorithms.bc import BC
from imitation.data.types import Trajectory
from imitation.rewards.reward_nets import BasicRewardNet
from stable_baselines3 import PPO

from wsn_env import score
from wsn_env.learning.sb3 import SB3VecEnv


def main(steps: int = 20_000, rows: int = 64, seed: int = 0) -> None:
    """Record a quarter of the time steps, clone, go on with GAIL, play."""
    example = Example("imitation, cloning and GAIL")
    envs = gym.make_vec(ENV, rows, vectorization_mode="vector_entry_point", autoreset_mode="Disabled", **FIELD)
    batch = SB3VecEnv(envs)
    learner = PPO("MlpPolicy", batch, n_steps=16, batch_size=256, learning_rate=3e-4, gamma=0.95, seed=seed)

    def act(observations):
        return learner.predict(observations, deterministic=True)[0]

    with TemporaryDirectory() as folder:
        os.environ["MINARI_DATASETS_PATH"] = folder
        recorded = record(max(1, steps // 4 // envs.unwrapped.scenario.periods), seed)
        episodes = list(recorded.iterate_episodes())
    shown = [Trajectory(one.observations, one.actions, infos=None, terminal=True) for one in episodes]
    spaces = dict(observation_space=batch.observation_space, action_space=batch.action_space)
    rng = np.random.default_rng(seed)
    cloning = BC(**spaces, rng=rng, policy=learner.policy, demonstrations=shown, batch_size=64, device="cpu")
    cloning.train(n_epochs=30, progress_bar=False)
    print(f"cloned: return {score(act, example.held_out).mean():.1f}")
    judge = BasicRewardNet(**spaces)
    gail = GAIL(demonstrations=shown, demo_batch_size=256, venv=batch, gen_algo=learner, reward_net=judge)
    gail.train(steps - recorded.total_steps)
    example.close(act, recorded.total_steps + learner.num_timesteps)


if __name__ == "__main__":
    tyro.cli(main)
