"""The same environments as stable-baselines3 takes them."""

from typing import Any

import gymnasium as gym
import numpy as np
from stable_baselines3.common.vec_env import VecEnv

from benchmarks.environments import FURTHER
from benchmarks.environments.naive import NaiveEnv
from wsn_env.scenario import Scenario


class TextbookEnv(gym.Env):
    """One field.

    Args:
        kind: of the filter.
    """

    def __init__(self, scenario: Scenario, kind: type):
        self.field = NaiveEnv(scenario, kind=kind)
        self.action_space = gym.spaces.Discrete(1 + FURTHER)
        self.observation_space = _space(self.field.reset(0)[0])

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        """A new episode."""
        super().reset(seed=seed)
        return self.field.reset(int(self.np_random.integers(2**31)))

    def step(self, action):
        """One period."""
        return self.field.step(int(action))


class JaxVecEnv(VecEnv):
    """Rows of JAX fields."""

    def __init__(self, scenario: Scenario, rows: int):
        from benchmarks.environments.jax_vmap import JaxFields

        self.fields = JaxFields(rows, scenario)
        observation = self.fields.reset(0)[0]
        super().__init__(rows, _space(observation), gym.spaces.Discrete(1 + FURTHER))

    def reset(self):
        """New episodes."""
        return self.fields.reset(0)

    def step_async(self, actions):
        """Remember them."""
        self.actions = actions

    def step_wait(self):
        """One period; all rows end together."""
        period = self.fields.step(self.actions)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        if period.ends:
            for info, last in zip(infos, period.last):
                info["terminal_observation"], info["TimeLimit.truncated"] = last, True
        return period.observations, period.reward.copy(), np.full(self.num_envs, period.ends), infos

    def close(self):
        """Nothing to close."""

    def get_attr(self, attr_name, indices=None):
        """Rows have none of their own, but PPO asks for render_mode."""
        return [None] * self.num_envs

    def set_attr(self, attr_name, value, indices=None):
        """Not needed by PPO."""
        raise NotImplementedError

    def env_method(self, method_name, *method_args, indices=None, **method_kwargs):
        """Not needed by PPO."""
        raise NotImplementedError

    def env_is_wrapped(self, wrapper_class, indices=None):
        """No wrappers."""
        return [False] * self.num_envs


def _space(observation: np.ndarray) -> gym.spaces.Box:
    return gym.spaces.Box(-np.inf, np.inf, observation.shape, np.float32)
