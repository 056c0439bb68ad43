"""What a training's critic sees and no policy does: the truth (asymmetric actor-critic, Pinto et al., 2018)."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np

from wsn_env.envs.feature import BOUND
from wsn_env.envs.vector_env import ClusterVectorEnv
from wsn_env.models.arguments import checked

TRUTH_FEATURES = (
    "ahead",  # where the target will be, in radii along and across the predicted velocity, from the prediction
    "left",
    "faster",  # its velocity less the predicted, in radii a period, along and across
    "leftward",
    "played",  # share of the episode's periods
)


class PrivilegedVectorEnv(gym.vector.VectorWrapper):
    """Observations (B, n) with TRUTH_FEATURES behind them, and which of the training's scenarios a row is of: (B, n + 5
    + scenarios).

    How well an action does hangs on where the target goes, which chance alone decides: a critic that knows needs not
    take it for the action's merit. The truth does not depend on the action, so that advantages stay without bias.

    Args:
        envs: ClusterVectorEnv, maybe of a subclass, with a flat observation.
        place: of its scenario among those of the training.
        scenarios: how many they are.
    """

    @checked
    def __init__(self, envs: ClusterVectorEnv, place: int = 0, scenarios: int = 1) -> None:
        super().__init__(envs)
        self._native, self._place = envs, place
        space: Any = envs.single_observation_space
        if not isinstance(space, gym.spaces.Box):
            raise ValueError(f"PrivilegedVectorEnv: observation space {space}: must be a Box")
        size = space.shape[0] + len(TRUTH_FEATURES) + scenarios
        self.single_observation_space = gym.spaces.Box(-BOUND, BOUND, (size,), np.float32)
        self.observation_space = gym.vector.utils.batch_space(self.single_observation_space, envs.num_envs)
        self._which = np.zeros((envs.num_envs, scenarios), np.float32)
        self._which[:, place] = 1.0

    def reset(self, **options: Any) -> tuple[Any, dict[str, Any]]:
        """As the environment's."""
        observation, info = self.env.reset(**options)
        return self._with_truth(observation), info

    def step(self, actions: Any) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """As the environment's."""
        observation, *rest = self.env.step(actions)
        return (self._with_truth(observation), *rest)

    def _with_truth(self, observation: np.ndarray) -> np.ndarray:
        state, scenario = self._native.state, self._native.scenario
        predicted, rows = state.belief.row["predicted_mean"], np.arange(len(observation))
        truth = state.track[rows, np.minimum(state.period + 1, scenario.periods)]
        ahead = predicted[:, 1::2] / np.maximum(np.hypot(predicted[:, 1], predicted[:, 3]), 1e-9)[:, None]
        left = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
        away = (truth - predicted) / scenario.radius_m
        away[:, 1::2] *= scenario.period_s
        parts = [(part * axis).sum(axis=1) for part in (away[:, ::2], away[:, 1::2]) for axis in (ahead, left)]
        told = np.stack([*parts, state.period / scenario.periods], axis=1).astype(np.float32)
        return np.concatenate([observation, np.clip(told, -BOUND, BOUND), self._which], axis=1)
