# /// script
# dependencies = ["wsn_env[train,multi]", "torch==2.13.0", "pettingzoo==1.27.0", "supersuit==3.11.0"]
# ///
"""Several targets: PettingZoo's environment through SuperSuit in stable-baselines3's PPO. All agents share one policy.

    python examples/pettingzoo_sb3.py --steps 20000

An agent observes what the single agent of a field with one target does, so the policy is scored there as it is.
"""

import supersuit
import tyro
from closing import FIELD, Example
from pettingzoo.utils import BaseParallelWrapper
from stable_baselines3 import PPO
from stable_baselines3.common.utils import set_random_seed

import wsn_env


class TruncationInfo(BaseParallelWrapper):
    """Tells stable-baselines3 that an episode was truncated: SuperSuit hands over both kinds of end as one `done`."""

    def step(self, actions):
        """One time step."""
        observations, rewards, terminations, truncations, infos = super().step(actions)
        for agent, info in infos.items():
            info["TimeLimit.truncated"] = truncations[agent] and not terminations[agent]
        return observations, rewards, terminations, truncations, infos


def main(steps: int = 20_000, fields: int = 20, targets: int = 3, seed: int = 0) -> None:
    """Train, then play. `steps` counts those of every target."""
    set_random_seed(seed)  # PPO(seed=...) would call a method `seed` that SuperSuit's environments do not have
    example = Example("SuperSuit, stable-baselines3 PPO")
    env = TruncationInfo(wsn_env.parallel_env("Multi-v0", targets=targets, rewards="own", **FIELD))
    scale = env.unwrapped.env.scenario.typical_cost(FIELD["lam"])
    env = supersuit.reward_lambda_v0(env, lambda reward: reward / scale)
    envs = supersuit.pettingzoo_env_to_vec_env_v1(env)  # an environment for each agent
    envs = supersuit.concat_vec_envs_v1(envs, fields, base_class="stable_baselines3")
    envs.venv.reset(seed=seed)  # seed + i for field i; later resets continue the generators
    model = PPO("MlpPolicy", envs, n_steps=16, batch_size=256, learning_rate=1e-3, gamma=0.95, gae_lambda=0.9)
    model.learn(steps)
    example.close(lambda observations: model.predict(observations, deterministic=True)[0], model.num_timesteps)


if __name__ == "__main__":
    tyro.cli(main)
