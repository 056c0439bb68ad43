"""The native vector environment as a stable-baselines3 VecEnv."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvObs, VecEnvStepReturn

from wsn_env.evaluation.native_envs import unwrap_native
from wsn_env.scenario import Scenario


class SB3VecEnv(VecEnv):
    """Steps all rows at once, bit-identical to a DummyVecEnv of single environments.

    Infos are filled for rows that end (their last info, terminal_observation, TimeLimit.truncated); the others' are
    empty.

    Args:
        envs: a ClusterVectorEnv or a ConcatVectorEnv, wrapped or not, in same-step or disabled autoreset mode.
            Next-step's extra reset row is no transition: it is refused.
        stagger: let the rows' first episodes end early, evenly spread, as truncations: later resets stay spread.
            Disabled mode only.
    """

    def __init__(self, envs: gym.vector.VectorEnv, stagger: bool = False) -> None:
        self._native = unwrap_native(envs)
        self._mode = self._native.autoreset_mode
        if self._mode == AutoresetMode.NEXT_STEP:
            raise ValueError("autoreset_mode NextStep makes rows that are no transitions: use SameStep or Disabled")
        if getattr(self._native, "reward_space", None) is not None:
            raise ValueError("reward 'vector': stable-baselines3 learns from one number, use 'error' or 'belief'")
        if stagger and self._mode != AutoresetMode.DISABLED:
            raise ValueError("stagger=True needs autoreset_mode Disabled")
        self.envs = envs
        self.seconds: float = 0.0  # wall time spent in step and reset
        super().__init__(envs.num_envs, envs.single_observation_space, envs.single_action_space)
        self._parts = [part.unwrapped for part in getattr(self._native, "parts", [envs])]
        self._first_end = np.full(envs.num_envs, -1)
        if stagger:
            self._first_end = np.concatenate([_staggered(part.num_envs, part.scenario) for part in self._parts])
        self._steps = 0

    def reset(self) -> VecEnvObs:
        """New episodes in all rows."""
        started = time.perf_counter()
        seeds: Any = list(self._seeds)  # the native environment takes a seed for each row
        observation, info = self.envs.reset(seed=seeds)
        self.seconds += time.perf_counter() - started
        self.reset_infos: list[dict[str, Any]] = [_row_info(info, i) for i in range(self.num_envs)]
        self._reset_seeds()
        self._reset_options()
        self._steps = 0
        return observation

    def step_async(self, actions: np.ndarray) -> None:
        """Remember the actions."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """One period; ended rows give the first observation of their next episode."""
        started = time.perf_counter()
        result = self._step()
        self.seconds += time.perf_counter() - started
        return result

    def _step(self) -> VecEnvStepReturn:
        observation, rewards, terminated, truncated, info = self.envs.step(self._actions)
        self._steps += 1
        truncated = truncated | (self._first_end == self._steps)
        done = terminated | truncated
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        if done.any():
            same_step = self._mode == AutoresetMode.SAME_STEP
            last = info["final_info"] if same_step else info
            for i in np.flatnonzero(done).tolist():
                infos[i] = _row_info(last, i)
                infos[i]["terminal_observation"] = info["final_obs"][i] if same_step else _copy_row(observation, i)
                infos[i]["TimeLimit.truncated"] = bool(truncated[i] and not terminated[i])
            if not same_step:
                observation, _ = self.envs.reset(options={"reset_mask": done})
        # A copy of the rewards: stable-baselines3 adds the bootstrapped value in place.
        return observation, rewards.astype(np.float32), done, infos

    @property
    def periods(self) -> int:
        """Of the longest episodes."""
        return max(part.scenario.periods for part in self._parts)

    def replay(self, episodes: np.ndarray, ages: np.ndarray, actions: np.ndarray, steps: int) -> VecEnvObs:
        """Play what the present episodes of other rows of these seeds were, to the same bits. Disabled mode only.

        Args:
            episodes: (B,) begun by each row.
            ages: (B,) periods of the present ones.
            actions: (T, B, ...) of the last T periods, T the oldest age.
            steps: periods since reset() there.

        Returns: the observations of the last of these periods.
        """
        seeds = list(self._seeds)
        observation = self.reset()
        for t in range(len(actions) + 1):
            begins = ages == len(actions) - t
            if begins.any():
                observation = self._begin(begins, seeds, episodes)
            if t < len(actions):
                observation, _, terminated, truncated, _ = self.envs.step(actions[t])
                # Rows whose episode begins later may end one of which nobody wants to know.
                ended = terminated | truncated
                if ended.any():
                    observation, _ = self.envs.reset(options={"reset_mask": ended})
        self._steps = steps
        return observation

    def _begin(self, rows: np.ndarray, seeds: list[Any], episodes: np.ndarray) -> VecEnvObs:
        """Begin so manieth episodes of their seeds in some rows."""
        own: Any = [seed if row else None for seed, row in zip(seeds, rows)]
        observation, _ = self.envs.reset(seed=own, options={"reset_mask": rows})
        later = rows & (episodes > 1)
        if later.any():
            counts = np.where(later, episodes - 2, 0)
            for part, skipped in zip(self._parts, np.split(counts, np.cumsum([p.num_envs for p in self._parts])[:-1])):
                part.skip_episodes(skipped)
            observation, _ = self.envs.reset(options={"reset_mask": later})
        return observation

    def close(self) -> None:
        """Close the environments."""
        self.envs.close()

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """An attribute of the vector environment, once for each row."""
        return [getattr(self._native, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Refused: the rows share one environment."""
        raise AttributeError(f"cannot set {attr_name!r} of single rows: make the environment with other settings")

    def env_method(
        self, method_name: str, *method_args: Any, indices: VecEnvIndices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call a batched method, such as action_masks(), and slice its answer."""
        answer = getattr(self._native, method_name)(*method_args, **method_kwargs)
        return [answer[i] for i in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class: type[gym.Wrapper], indices: VecEnvIndices = None) -> list[bool]:
        """Rows are never wrapped one by one."""
        return [False for _ in self._get_indices(indices)]

    def has_attr(self, attr_name: str) -> bool:
        """Whether the vector environment has the attribute."""
        return hasattr(self._native, attr_name)

    def get_images(self) -> Sequence[np.ndarray | None]:
        """Frames of all rows."""
        frames: Any = self.envs.render()
        return frames


def _staggered(rows: int, scenario: Scenario) -> np.ndarray:
    """(B,) the periods in which the first episodes end, evenly spread; the targets of a field end together."""
    targets = scenario.targets
    return np.repeat(1 + np.arange(rows // targets) * scenario.periods // (rows // targets), targets)


def _copy_row(arrays: VecEnvObs, i: int) -> Any:
    return {name: value[i].copy() for name, value in arrays.items()} if isinstance(arrays, dict) else arrays[i].copy()


def _row_info(info: dict[str, Any], i: int) -> dict[str, Any]:
    """Row i of a Gymnasium vector info, as plain values."""
    row = {}
    for name, value in info.items():
        if not name.startswith("_") and name not in ("final_obs", "final_info") and info[f"_{name}"][i]:
            row[name] = value[i] if np.ndim(value[i]) else value[i].item()
    return row
