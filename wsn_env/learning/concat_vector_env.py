"""Several native vector environments as one: a training meets many scenarios at once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from wsn_env.envs.interface import Interface, check_options
from wsn_env.envs.vector_env import row_seeds
from wsn_env.evaluation.native_envs import unwrap_native
from wsn_env.models.arguments import checked


class ConcatVectorEnv(gym.vector.VectorEnv):
    """The rows of its parts, one after the other; seeds go to rows, as those of a single vector environment would.

    Args:
        parts: ClusterVectorEnv, wrapped or not, of the same spaces and autoreset mode.
    """

    @checked
    def __init__(self, parts: Sequence[gym.vector.VectorEnv]) -> None:
        if not parts:
            raise ValueError("parts = []: must hold at least one environment")
        first = parts[0]
        for part in parts:
            for name in ("single_observation_space", "single_action_space"):
                if getattr(part, name) != getattr(first, name):
                    raise ValueError(
                        f"ConcatVectorEnv: {name} {getattr(part, name)} differs from {getattr(first, name)}"
                    )
            if unwrap_native(part).autoreset_mode != unwrap_native(first).autoreset_mode:
                raise ValueError("ConcatVectorEnv: the parts' autoreset modes differ")
        self.interface: Interface = unwrap_native(first).interface  # that of all
        self.parts: list[gym.vector.VectorEnv] = list(parts)
        ends = np.cumsum([0] + [part.num_envs for part in parts])
        self._rows = [slice(start, stop) for start, stop in zip(ends, ends[1:])]
        self.num_envs: int = int(ends[-1])
        self.metadata: dict[str, Any] = first.metadata
        self.autoreset_mode: AutoresetMode = unwrap_native(first).autoreset_mode
        self.single_observation_space: gym.Space[Any] = first.single_observation_space
        self.single_action_space: gym.Space[Any] = first.single_action_space
        self.observation_space: gym.Space[Any] = batch_space(self.single_observation_space, self.num_envs)
        self.action_space: gym.Space[Any] = batch_space(self.single_action_space, self.num_envs)
        self._observations: list[Any] = [None] * len(self.parts)

    def reset(
        self, *, seed: int | Sequence[int] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """New episodes, in the rows of options["reset_mask"] only where there is one."""
        check_options(options)
        seeds = row_seeds(seed, self.num_envs)
        mask = (options or {}).get("reset_mask")
        infos = []
        for i, (part, rows) in enumerate(zip(self.parts, self._rows)):
            info: dict[str, Any] = {}
            if mask is None or mask[rows].any():
                own = {} if mask is None else {"options": {"reset_mask": mask[rows]}}
                of_rows: Any = seeds[rows]  # a native environment takes a seed for each row
                self._observations[i], info = part.reset(seed=of_rows, **own)
            infos.append(info)
        return self._join_observations(self._observations), self._join_infos(infos)

    def step(self, actions: Any) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """One period of every part."""
        results = [part.step(actions[rows]) for part, rows in zip(self.parts, self._rows)]
        self._observations = [one[0] for one in results]
        rewards, terminated, truncated = (np.concatenate([one[i] for one in results]) for i in (1, 2, 3))
        infos = self._join_infos([one[4] for one in results])
        return self._join_observations(self._observations), rewards, terminated, truncated, infos

    def _join_observations(self, observations: list[Any]) -> Any:
        if isinstance(observations[0], dict):
            return {name: np.concatenate([one[name] for one in observations]) for name in observations[0]}
        return np.concatenate(observations)

    def _join_infos(self, infos: list[dict[str, Any]]) -> dict[str, Any]:
        """Gymnasium's form: where a part has no such entry its rows are zeros, and their mask is False."""
        joined: dict[str, Any] = {}
        for name in dict.fromkeys(name for info in infos for name in info):
            some = next(info[name] for info in infos if name in info)
            if isinstance(some, dict):  # final_info
                joined[name] = self._join_infos([info.get(name, {}) for info in infos])
                continue
            joined[name] = np.zeros((self.num_envs, *some.shape[1:]), some.dtype)
            for info, rows in zip(infos, self._rows):
                if name in info:
                    joined[name][rows] = info[name]
        return joined

    @property
    def lam(self) -> np.ndarray:
        """(B,) the present episodes' trade-offs [m/mJ]."""
        return np.concatenate([unwrap_native(part).lam for part in self.parts])

    def action_masks(self) -> np.ndarray:
        """(B, n) bool: which entries of each row's action make sense now."""
        return np.concatenate([unwrap_native(part).action_masks() for part in self.parts])

    def render(self) -> tuple[Any, ...]:
        """Frames of all rows."""
        return tuple(frame for part in self.parts for frame in part.render() or ())

    def close_extras(self, **kwargs: Any) -> None:
        """Close all."""
        for part in self.parts:
            part.close()
