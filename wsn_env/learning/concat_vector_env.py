"""Several native vector environments as one: a training meets many scenarios at once."""

from __future__ import annotations

from collections.abc import Sequence

import gymnasium as gym
import numpy as np
from gymnasium.vector.utils import batch_space


class ConcatVectorEnv(gym.vector.VectorEnv):
    """The rows of its parts, one after the other; seeds go to rows, as those of a single vector environment would.

    Args:
        parts: ClusterVectorEnv, wrapped or not, of the same spaces and autoreset mode.
    """

    def __init__(self, parts: Sequence[gym.vector.VectorEnv]):
        first = parts[0]
        for part in parts:
            for name in ("single_observation_space", "single_action_space"):
                if getattr(part, name) != getattr(first, name):
                    raise ValueError(
                        f"ConcatVectorEnv: {name} {getattr(part, name)} differs from {getattr(first, name)}"
                    )
            if part.unwrapped.autoreset_mode != first.unwrapped.autoreset_mode:
                raise ValueError("ConcatVectorEnv: the parts' autoreset modes differ")
        self.parts = list(parts)
        ends = np.cumsum([0] + [part.num_envs for part in parts])
        self._rows = [slice(start, stop) for start, stop in zip(ends, ends[1:])]
        self.num_envs, self.metadata = int(ends[-1]), first.metadata
        self.autoreset_mode = first.unwrapped.autoreset_mode
        self.single_observation_space, self.single_action_space = (
            first.single_observation_space,
            first.single_action_space,
        )
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._observations: list = [None] * len(self.parts)

    def reset(self, *, seed=None, options=None):
        """New episodes, in the rows of options["reset_mask"] only where it is given."""
        seeds = [seed + i for i in range(self.num_envs)] if isinstance(seed, int) else seed
        mask = (options or {}).get("reset_mask")
        infos = []
        for i, (part, rows) in enumerate(zip(self.parts, self._rows)):
            info = {}
            if mask is None or mask[rows].any():
                own = {} if mask is None else {"options": {"reset_mask": mask[rows]}}
                self._observations[i], info = part.reset(seed=None if seeds is None else list(seeds[rows]), **own)
            infos.append(info)
        return self._joined(self._observations), self._joined_infos(infos)

    def step(self, actions):
        """One period of every part."""
        told = [part.step(actions[rows]) for part, rows in zip(self.parts, self._rows)]
        self._observations = [one[0] for one in told]
        rewards, terminated, truncated = (np.concatenate([one[i] for one in told]) for i in (1, 2, 3))
        infos = self._joined_infos([one[4] for one in told])
        return self._joined(self._observations), rewards, terminated, truncated, infos

    def _joined(self, observations):
        if isinstance(observations[0], dict):
            return {name: np.concatenate([one[name] for one in observations]) for name in observations[0]}
        return np.concatenate(observations)

    def _joined_infos(self, infos: list[dict]) -> dict:
        """Gymnasium's form: where a part has no such entry its rows are zeros, and their mask is False."""
        joined = {}
        for name in dict.fromkeys(name for info in infos for name in info):
            some = next(info[name] for info in infos if name in info)
            if isinstance(some, dict):  # final_info
                joined[name] = self._joined_infos([info.get(name, {}) for info in infos])
                continue
            joined[name] = np.zeros((self.num_envs, *some.shape[1:]), some.dtype)
            for info, rows in zip(infos, self._rows):
                if name in info:
                    joined[name][rows] = info[name]
        return joined

    @property
    def lam(self) -> np.ndarray:
        """(B,) the present episodes' trade-offs [m/mJ]."""
        return np.concatenate([part.unwrapped.lam for part in self.parts])

    def action_masks(self) -> np.ndarray:
        """(B, n) bool: which entries of each row's action make sense now."""
        return np.concatenate([part.unwrapped.action_masks() for part in self.parts])

    def render(self):
        """Frames of all rows."""
        return tuple(frame for part in self.parts for frame in part.render())

    def close_extras(self, **kwargs):
        """Close all."""
        for part in self.parts:
            part.close()
