"""Rows of a training that can be brought to where they were."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
from gymnasium.spaces import Discrete, MultiDiscrete
from stable_baselines3.common.vec_env import VecMonitor
from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs, VecEnvStepReturn

from wsn_env.learning.sb3 import SB3VecEnv
from wsn_env.learning.training_reward import TrainingReward


class ReplayableRows(VecMonitor):
    """A VecMonitor that remembers what each row has been through since its episode began: by key and actions alone a
    world is played again to the bit.

    Args:
        envs: in disabled autoreset mode, with actions of whole numbers.
    """

    def __init__(self, envs: SB3VecEnv) -> None:
        super().__init__(envs)
        space: Any = envs.action_space
        if not isinstance(space, (Discrete, MultiDiscrete)):
            raise ValueError(f"ReplayableRows: action space {space}: must be Discrete or MultiDiscrete")
        self._rows = envs
        self._allowed: np.ndarray = np.asarray(space.n if isinstance(space, Discrete) else space.nvec)
        self._kept = np.min_scalar_type(int(self._allowed.max()))
        self._actions: deque[np.ndarray] = deque(maxlen=envs.periods)
        self.episodes: np.ndarray = np.ones(self.num_envs, np.int64)  # begun, the present one among them
        self.rms_m: deque[float] = deque(maxlen=200)  # of the last episodes

    def reset(self) -> VecEnvObs:
        """New episodes in all rows."""
        self._actions.clear()
        self.episodes[:] = 1
        return super().reset()

    def step_async(self, actions: np.ndarray) -> None:
        """Remember the actions."""
        self._actions.append(actions.astype(self._kept))
        super().step_async(actions)

    def step_wait(self) -> VecEnvStepReturn:
        """One period."""
        observation, rewards, dones, infos = super().step_wait()
        self.episodes += dones
        self.rms_m.extend(info["episode_rms_m"] for info in infos if "episode_rms_m" in info)
        return observation, rewards, dones, infos

    def recent_actions(self) -> np.ndarray:
        """(T, B, ...) since the oldest of the present episodes began."""
        oldest = int(self.episode_lengths.max(initial=0))
        actions = list(self._actions)[len(self._actions) - oldest :]
        return np.array(actions, self._kept).reshape(oldest, self.num_envs, *self._allowed.shape)

    def replay(self, episodes: np.ndarray, ages: np.ndarray, actions: np.ndarray, steps: int) -> VecEnvObs:
        """Bring the rows to where others were, from the seeds given to `seed()`.

        Args:
            episodes: (B,) begun by each.
            ages: (B,) periods of the present ones.
            actions: (T, B, ...) as `recent_actions()` gave them.
            steps: periods since `reset()`.

        Returns: the observations there.

        Raises:
            ValueError: there is no such place.
        """
        shape = (int(ages.max()), self.num_envs, *self._allowed.shape)
        good = ages.min() >= 0 and shape[0] <= min(steps, self._rows.periods)
        good = good and episodes.min() >= 1 and (episodes <= 1 + steps - ages).all()
        if not good or actions.dtype != self._kept or actions.shape != shape or (actions >= self._allowed).any():
            raise ValueError("its episodes or actions cannot have been")
        self._actions.clear()
        self._actions.extend(actions)
        return self._rows.replay(episodes, ages, actions.astype(np.int64), steps)

    def error_sums(self) -> list[np.ndarray]:
        """Of each part's TrainingReward, its own arrays."""
        parts = getattr(self._rows.envs, "parts", [self._rows.envs])
        return [part.errors for part in parts if isinstance(part, TrainingReward)]
