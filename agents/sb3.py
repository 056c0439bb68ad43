"""The native vector environment, or several of them, as a stable-baselines3 VecEnv."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.vec_env import VecEnv

from wsn_env.vector_env import ClusterVectorEnv

WIDTHS = np.arange(-1.0, 4.5, 0.5)  # of beliefs, log2 of their rms over a scenario's typical error
HARDLY_ANYTHING_M = 100.0


class SB3VecEnv(VecEnv):
    """Steps all rows at once, bit-identical to a DummyVecEnv of single environments.

    Infos are filled for rows that end (their last info, terminal_observation, TimeLimit.truncated); the others' are
    empty.

    Args:
        envs: in same-step or disabled autoreset mode. Next-step's extra reset row is no transition: it is refused.
        scaled: rewards are divided by the scenario's `typical_cost`, so that their size is alike for every scenario and
            lam.
        calibrated: the part of the reward that stands for the error is multiplied by the ratio of all true errors so
            far to it, among beliefs about as wide, so that a believed error costs on average what the true one does:
            filters believe too little or too much of themselves, and most where they know least.
        stagger: let the rows' first episodes end early, evenly spread, as truncations: later resets stay spread.
            Disabled mode only.
    """

    def __init__(self, envs: ClusterVectorEnv, scaled: bool = False, stagger: bool = False, calibrated: bool = False):
        if envs.autoreset_mode == AutoresetMode.NEXT_STEP:
            raise ValueError("autoreset_mode NextStep makes rows that are no transitions: use SameStep or Disabled")
        if envs.interface.reward_space is not None:
            raise ValueError("reward 'vector': stable-baselines3 learns from one number, use 'error' or 'belief'")
        if calibrated and envs.autoreset_mode != AutoresetMode.DISABLED:
            raise ValueError("calibrated=True needs autoreset_mode Disabled")
        if stagger and envs.autoreset_mode != AutoresetMode.DISABLED:
            raise ValueError("stagger=True needs autoreset_mode Disabled")
        self.envs = envs
        self.seconds = 0.0  # wall time spent in step and reset
        super().__init__(envs.num_envs, envs.single_observation_space, envs.single_action_space)
        self._scaled, self._calibrated = scaled, calibrated
        # Sums of true errors, and of what the rewards took for them, by width; at first they agree.
        self._errors = np.full((2, len(WIDTHS)), HARDLY_ANYTHING_M)
        self._first_end = np.full(envs.num_envs, -1)
        if stagger:
            self._first_end = 1 + np.arange(envs.num_envs) * envs.scenario.periods // envs.num_envs
        self._steps = 0

    def reset(self):
        """New episodes in all rows."""
        started = time.perf_counter()
        observation, info = self.envs.reset(seed=list(self._seeds))
        self.seconds += time.perf_counter() - started
        self.reset_infos = [_row_info(info, i) for i in range(self.num_envs)]
        self._reset_seeds()
        self._reset_options()
        self._steps = 0
        return observation

    def step_async(self, actions) -> None:
        """Remember the actions."""
        self._actions = actions

    def step_wait(self):
        """One period; ended rows give the first observation of their next episode."""
        started = time.perf_counter()
        result = self._step()
        self.seconds += time.perf_counter() - started
        return result

    def _step(self):
        lam = self.envs.lam.copy()
        observation, rewards, terminated, truncated, info = self.envs.step(self._actions)
        self._steps += 1
        truncated = truncated | (self._first_end == self._steps)
        done = terminated | truncated
        infos: list[dict] = [{} for _ in range(self.num_envs)]
        if done.any():
            same_step = self.envs.autoreset_mode == AutoresetMode.SAME_STEP
            last = info["final_info"] if same_step else info
            for i in np.flatnonzero(done):
                infos[i] = _row_info(last, i)
                infos[i]["terminal_observation"] = info["final_obs"][i] if same_step else _row(observation, i)
                infos[i]["TimeLimit.truncated"] = bool(truncated[i] and not terminated[i])
            if not same_step:
                observation, _ = self.envs.reset(options={"reset_mask": done})
        if self._calibrated:
            rewards = self._calibrate(rewards, info)
        # A copy in float32: stable-baselines3 adds the bootstrapped value in place.
        scale = self.envs.scenario.typical_cost(lam) if self._scaled else 1.0
        return observation, (rewards / scale).astype(np.float32), done, infos

    def _calibrate(self, rewards: np.ndarray, info: dict) -> np.ndarray:
        width = np.log2(np.maximum(info["posterior_rms_m"] / self.envs.scenario.typical_error_m, 1e-9))
        nearest = abs(WIDTHS[:, None] - width).argmin(axis=0)
        for sums, errors in zip(self._errors, (info["error_m"], -info["reward_error"])):
            sums += np.bincount(nearest, errors, len(WIDTHS))
        ratio = np.interp(width, WIDTHS, self._errors[0] / self._errors[1])
        return rewards + (ratio - 1.0) * info["reward_error"]

    def close(self) -> None:
        """Close the environments."""
        self.envs.close()

    def get_attr(self, attr_name: str, indices=None) -> list[Any]:
        """An attribute of the vector environment, once for each row."""
        return [getattr(self.envs, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices=None) -> None:
        """Refused: the rows share one environment."""
        raise AttributeError(f"cannot set {attr_name!r} of single rows: make the environment with other settings")

    def env_method(self, method_name: str, *method_args, indices=None, **method_kwargs) -> list[Any]:
        """Call a batched method, such as action_masks(), and slice its answer."""
        answer = getattr(self.envs, method_name)(*method_args, **method_kwargs)
        return [answer[i] for i in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class, indices=None) -> list[bool]:
        """Rows are never wrapped one by one."""
        return [False for _ in self._get_indices(indices)]

    def has_attr(self, attr_name: str) -> bool:
        """Whether the vector environment has the attribute."""
        return hasattr(self.envs, attr_name)

    def get_images(self):
        """Frames of all rows."""
        return self.envs.render()


class SB3Fleet(VecEnv):
    """Several SB3VecEnv as one, their rows one after the other: a training meets many scenarios at once.

    Args:
        parts: of the same spaces.
    """

    def __init__(self, parts: Sequence[SB3VecEnv]):
        first = parts[0]
        for part in parts:
            if (part.observation_space, part.action_space) != (first.observation_space, first.action_space):
                raise ValueError(
                    f"spaces differ: {part.observation_space}, {part.action_space} of {part.envs.scenario.name} and"
                    f" {first.observation_space}, {first.action_space}"
                )
        self.parts = list(parts)
        super().__init__(sum(part.num_envs for part in parts), first.observation_space, first.action_space)
        self._ends = np.cumsum([part.num_envs for part in parts])

    @property
    def seconds(self) -> float:
        """Wall time spent in step and reset."""
        return sum(part.seconds for part in self.parts)

    def seed(self, seed: int | None = None):
        """Row i of all gets seed + i."""
        starts = [0, *self._ends[:-1]]
        return [
            one for part, at in zip(self.parts, starts) for one in part.seed(None if seed is None else seed + int(at))
        ]

    def reset(self):
        """New episodes in all rows."""
        observations = [part.reset() for part in self.parts]
        self.reset_infos = [info for part in self.parts for info in part.reset_infos]
        return np.concatenate(observations)

    def step_async(self, actions) -> None:
        """Remember the actions."""
        for part, own in zip(self.parts, np.split(actions, self._ends[:-1])):
            part.step_async(own)

    def step_wait(self):
        """One period of every part."""
        observations, rewards, dones, infos = zip(*(part.step_wait() for part in self.parts))
        return np.concatenate(observations), np.concatenate(rewards), np.concatenate(dones), sum(infos, [])

    def close(self) -> None:
        """Close all."""
        for part in self.parts:
            part.close()

    def get_attr(self, attr_name: str, indices=None) -> list[Any]:
        """An attribute of the parts, once for each row."""
        values = [value for part in self.parts for value in part.get_attr(attr_name)]
        return [values[i] for i in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices=None) -> None:
        """Refused, as by the parts."""
        self.parts[0].set_attr(attr_name, value)

    def env_method(self, method_name: str, *method_args, indices=None, **method_kwargs) -> list[Any]:
        """Call a batched method of every part, and slice the answers."""
        answers = [
            answer for part in self.parts for answer in part.env_method(method_name, *method_args, **method_kwargs)
        ]
        return [answers[i] for i in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class, indices=None) -> list[bool]:
        """Rows are never wrapped one by one."""
        return [False for _ in self._get_indices(indices)]

    def has_attr(self, attr_name: str) -> bool:
        """Whether the parts have the attribute."""
        return self.parts[0].has_attr(attr_name)

    def get_images(self):
        """Frames of all rows."""
        return [image for part in self.parts for image in part.get_images()]


def _row(arrays, i: int):
    return {name: value[i].copy() for name, value in arrays.items()} if isinstance(arrays, dict) else arrays[i].copy()


def _row_info(info: dict, i: int) -> dict:
    """Row i of a Gymnasium vector info, as plain values."""
    row = {}
    for name, value in info.items():
        if not name.startswith("_") and name not in ("final_obs", "final_info") and info[f"_{name}"][i]:
            row[name] = value[i] if np.ndim(value[i]) else value[i].item()
    return row
