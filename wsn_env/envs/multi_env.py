"""Environments with several targets in one field: a joint choice of clusters, one for each."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from wsn_env.envs.interface import check_options
from wsn_env.envs.rendering.camera import FPS, RENDER_MODES
from wsn_env.envs.spec import TellsHorizon
from wsn_env.envs.vector_env import ClusterVectorEnv, check_reset_mask, row_seeds, stack_actions
from wsn_env.models.quantity import UnknownKeyword, whole_number
from wsn_env.models.state import Cluster
from wsn_env.scenario import Scenario
from wsn_env.simulation.view import View

TARGETS = 3
SUMS = ("energy_mj", "episode_energy_mj", "reward_energy", "reward_error")  # of infos, over the targets


class TargetRows(ClusterVectorEnv):
    """A row for each target; those of a field stand one after the other, and are reset together.

    Seeds are of fields, as MultiVectorEnv has them; a seed for each row counts if it is of a field's first.
    """

    takes_several_targets, shown_as = True, "MultiVectorEnv"

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """New episodes, in whole fields."""
        targets, fields = self.scenario.targets, self.num_envs // self.scenario.targets
        if not isinstance(seed, (list, tuple, np.ndarray)) or len(seed) == fields:
            seed = np.repeat(np.array(row_seeds(seed, fields), object), targets).tolist()
        mask = options.get("reset_mask") if isinstance(options, Mapping) else None
        if isinstance(mask, np.ndarray) and mask.shape == (self.num_envs,):
            if (mask.reshape(-1, targets) != mask[::targets, None]).any():
                raise ValueError(f"options['reset_mask'] = {mask!r}: must mark all {targets} rows of a field, or none")
        return super().reset(seed=seed, options=options)

    def _draw_keys(self, rows: np.ndarray) -> np.ndarray:
        """One for each field, from the generator of its first row."""
        targets = self.scenario.targets
        first = np.arange(self.num_envs) % targets == 0
        return np.repeat(super()._draw_keys(rows & first)[::targets], targets)


class MultiVectorEnv(TellsHorizon, gym.vector.VectorEnv):
    """B fields with M targets each, which share nodes and batteries. Each target has its track, its belief and its
    cluster; a node in two clusters is awake once, reports to both heads and pays for both reports.

    It is a ClusterVectorEnv of B * M rows, a target each, with an axis of targets: observations (B, M, ...), actions
    (B, M, ...). The reward is the sum over the targets; infos are (B, M) of what is a target's own and (B,) of
    `energy_mj`, `episode_energy_mj`, `reward_energy`, `reward_error`, their sums. With one target all numbers are those
    of ClusterVectorEnv.

    Args:
        num_envs: B.
        scenario: an id such as "PreDC-v0", or a Scenario.
        targets: M; None: those of a Scenario, 3 of an id.
        The rest: as ClusterVectorEnv, but for vector rewards and pictures.
    """

    metadata: dict[str, Any] = {
        "render_modes": list(RENDER_MODES),
        "render_fps": FPS,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }
    horizon_as_argument = True

    def __init__(
        self,
        num_envs: int = 1,
        scenario: str | Scenario = "PreDC-v0",
        targets: int | None = None,
        reward: str = "error",
        **more: Any,
    ) -> None:
        if reward == "vector":
            raise ValueError("reward = 'vector': must be 'error' or 'belief' with several targets")
        self.num_envs: int = whole_number("num_envs", num_envs, 1)
        usual = scenario.targets if isinstance(scenario, Scenario) else TARGETS
        scenario = Scenario.of(scenario)
        self.targets: int = whole_number("targets", usual if targets is None else targets, 1)
        more |= dict(scenario=scenario, targets=self.targets, reward=reward)
        self.rows: TargetRows = TargetRows(self.num_envs * self.targets, **more)
        self.scenario: Scenario = self.rows.scenario
        self.render_mode = self.rows.render_mode
        self.autoreset_mode: AutoresetMode = self.rows.autoreset_mode
        self.metadata = self.rows.metadata
        self.single_action_space: gym.Space[Any] = _of_targets(self.rows.single_action_space, self.targets)
        self.single_observation_space: gym.Space[Any] = _of_targets(self.rows.single_observation_space, self.targets)
        self.action_space: gym.Space[Any] = batch_space(self.single_action_space, self.num_envs)
        self.observation_space: gym.Space[Any] = batch_space(self.single_observation_space, self.num_envs)
        self.rewards: np.ndarray = np.zeros((self.num_envs, self.targets))  # of the last step, each target's

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """New episodes; seeds and options["reset_mask"] are of fields, as ClusterVectorEnv.reset has them of rows."""
        check_options(options)
        mask = (options or {}).get("reset_mask")
        if mask is not None:
            check_reset_mask(mask, self.num_envs)
            options = {**(options or {}), "reset_mask": np.repeat(mask, self.targets)}
        seeds: Any = row_seeds(seed, self.num_envs)
        observation, info = self.rows.reset(seed=seeds, options=options)
        return self._fold(observation), self._fold_info(info)

    def step(self, actions: Any) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """One period for every field.

        Args:
            actions: (B, M, ...) of the action space; or a Cluster of B * M rows, as policies choose it of `view`.
        """
        if not isinstance(actions, Cluster):
            actions = self._unfold(stack_actions(actions))
        observation, reward, terminated, truncated, info = self.rows.step(actions)
        first = slice(None, None, self.targets)
        self.rewards = reward.reshape(self.num_envs, self.targets)
        return (
            self._fold(observation),
            self.rewards.sum(axis=1),
            terminated[first],
            truncated[first],
            self._fold_info(info),
        )

    @property
    def np_random_seed(self) -> tuple[int | None, ...]:  # type: ignore[override]
        """(B,) the seeds that the fields' generators began with; None before the first reset."""
        return self.rows.np_random_seed[:: self.targets]

    @property  # type: ignore[misc]
    def np_random(self) -> tuple[np.random.Generator | None, ...]:  # type: ignore[override]
        """(B,) the fields' generators; None before the first reset."""
        return self.rows.np_random[:: self.targets]

    @property
    def view(self) -> View:
        """What hand-written policies see: B * M rows, those of a field's targets one after the other."""
        return self.rows.view

    @property
    def lam(self) -> np.ndarray:
        """(B,) the present episodes' trade-offs [m/mJ]."""
        return self.rows.lam[:: self.targets]

    @property
    def horizon(self) -> int:
        """Time steps of an episode."""
        return self.rows.horizon

    def reference_all_awake_m(self) -> np.ndarray:
        """(B, M) as ClusterVectorEnv has it."""
        return self._fold(self.rows.reference_all_awake_m())

    def action_masks(self) -> np.ndarray:
        """(B, M, n) bool: which actions of each target differ from others now."""
        return self._fold(self.rows.action_masks())

    def render(self) -> Any:
        """As ClusterVectorEnv, a frame of each field with all its targets."""
        return self.rows.render()

    def close_extras(self, **kwargs: Any) -> None:
        """Close the window, if there is one."""
        self.rows.close_extras()

    def _fold(self, values: Any) -> Any:
        """(B * M, ...) as (B, M, ...)."""
        if isinstance(values, dict):
            return {name: self._fold(value) for name, value in values.items()}
        return values.reshape(self.num_envs, self.targets, *values.shape[1:])

    def _unfold(self, values: Any) -> Any:
        """(B, M, ...) as (B * M, ...)."""
        if isinstance(values, dict):
            return {name: self._unfold(value) for name, value in values.items()}
        values = np.asarray(values)
        if values.shape[:2] != (self.num_envs, self.targets):
            wanted = f"({self.num_envs}, {self.targets}, ...)"
            raise ValueError(f"actions have the shape {values.shape}: must be {wanted}, one for each field and target")
        return values.reshape(-1, *values.shape[2:])

    def _fold_info(self, info: dict[str, Any]) -> dict[str, Any]:
        folded: dict[str, Any] = {}
        for name, value in info.items():
            if name == "final_info":
                folded[name] = self._fold_info(value)
            elif name == "final_obs":
                folded[name] = self._fold_final(value)
            elif name.startswith("_"):
                folded[name] = value[:: self.targets]
            else:
                several = self._fold(value)
                folded[name] = several.sum(axis=1) if name in SUMS else several
        return folded

    def _fold_final(self, rows: np.ndarray) -> np.ndarray:
        """(B,) last observations of the fields that have ended, of those of all rows."""
        final = np.full(self.num_envs, None, dtype=object)
        for i, own in enumerate(rows.reshape(self.num_envs, self.targets)):
            if isinstance(own[0], dict):
                final[i] = {name: np.stack([each[name] for each in own]) for name in own[0]}
            elif own[0] is not None:
                final[i] = np.stack(list(own))
        return final


class MultiEnv(TellsHorizon, gym.Env):
    """One field with several targets: a MultiVectorEnv of one, without its first axis.

    Args:
        As MultiVectorEnv.
    """

    metadata: dict[str, Any] = {"render_modes": list(RENDER_MODES), "render_fps": FPS}

    def __init__(self, scenario: str | Scenario = "PreDC-v0", targets: int | None = None, **more: Any) -> None:
        for name in ("num_envs", "autoreset_mode", "threads", "max_episode_steps"):
            if name in more:
                raise UnknownKeyword(f"MultiEnv() got an unexpected keyword argument {name!r}: it is of MultiVectorEnv")
        self.fields: MultiVectorEnv = MultiVectorEnv(1, scenario, targets, **more, autoreset_mode="Disabled", threads=1)
        self.scenario, self.targets = self.fields.scenario, self.fields.targets
        self.render_mode = self.fields.render_mode
        self.action_space = self.fields.single_action_space
        self.observation_space = self.fields.single_observation_space
        self._ended = False

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """A new episode: seed fixes field, tracks and every draw."""
        check_options(options)
        seed = None if seed is None else whole_number("seed", seed, 0)
        if seed is None and self._np_random is not None:
            self.fields.rows.use_generator(0, self._np_random)
        observation, info = self.fields.reset(seed=seed)
        self._np_random, self._np_random_seed = self.fields.np_random[0], self.fields.np_random_seed[0]
        self._ended = False
        return part_of(observation, 0), self._own(info)

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """One period.

        Args:
            action: (M, ...) of the action space; or a Cluster of M rows.
        """
        if self._ended:
            raise gym.error.ResetNeeded("the episode has ended: call reset()")
        if not isinstance(action, Cluster):
            several = isinstance(action, dict)
            action = {k: np.asarray(v)[None] for k, v in action.items()} if several else np.asarray(action)[None]
        observation, reward, terminated, truncated, info = self.fields.step(action)
        self._ended = bool(terminated[0] or truncated[0])
        return part_of(observation, 0), float(reward[0]), bool(terminated[0]), bool(truncated[0]), self._own(info)

    @property
    def lam(self) -> np.ndarray:
        """(1,) the present episode's trade-off [m/mJ]."""
        return self.fields.lam

    def reference_all_awake_m(self) -> np.ndarray:
        """(M,) as ClusterEnv has it."""
        return self.fields.reference_all_awake_m()[0]

    @property
    def view(self) -> View:
        """What hand-written policies see: M rows."""
        return self.fields.view

    def action_masks(self) -> np.ndarray:
        """(M, n) bool."""
        return self.fields.action_masks()[0]

    def render(self) -> Any:
        """A frame (frame_px, frame_px, 3) uint8 of the field with all targets; in "human" mode None."""
        frames = self.fields.render()
        return None if frames is None else frames[0]

    def close(self) -> None:
        """Close the window, if there is one."""
        self.fields.close()

    @property
    def horizon(self) -> int:
        """Time steps of an episode."""
        return self.fields.horizon

    def _own(self, info: dict[str, Any]) -> dict[str, Any]:
        """Of the one field, without the masks of a batch."""
        return {
            name: value[0]
            for name, value in info.items()
            if not name.startswith("_") and info.get(f"_{name}", np.ones(1, bool))[0]
        }


def part_of(observation: Any, index: int) -> Any:
    """One entry of the first axis, of an array or of each in a dict."""
    if isinstance(observation, dict):
        return {name: part_of(value, index) for name, value in observation.items()}
    return observation[index]


def _of_targets(space: Any, targets: int) -> Any:
    """The space of one target, for each of several."""
    if isinstance(space, spaces.Dict):
        return spaces.Dict({name: _of_targets(each, targets) for name, each in space.spaces.items()})
    return batch_space(space, targets)
