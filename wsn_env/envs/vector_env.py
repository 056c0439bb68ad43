"""The native vector environment: a World with B rows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, Unpack, cast

import gymnasium as gym
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from wsn_env.compiled import draws
from wsn_env.envs.actions import ActionName
from wsn_env.envs.info import outcomes_by_name
from wsn_env.envs.interface import Interface, Settings, check_options, scenario_of
from wsn_env.envs.observations import Follower, ObservationName
from wsn_env.envs.one_thread import Busy, one_thread
from wsn_env.envs.rendering.camera import FPS, RENDER_MODES, Camera, RenderMode
from wsn_env.envs.rewards import RewardName
from wsn_env.envs.spec import TellsHorizon
from wsn_env.models.arguments import checked_but
from wsn_env.models.measurement.base import Order
from wsn_env.models.quantity import whole_number
from wsn_env.models.state import Cluster, State
from wsn_env.scenario import Scenario
from wsn_env.scenario.quantities import Quantities
from wsn_env.simulation.lifetime import lifetimes
from wsn_env.simulation.reference import Reference, has_reference, why_no_reference
from wsn_env.simulation.view import View
from wsn_env.simulation.world import World, choice_of


class ClusterVectorEnv(TellsHorizon, gym.vector.VectorEnv):
    """B fields at once. Row i is bit-identical to a ClusterEnv with seed + i, in all three autoreset modes.

    Args:
        num_envs: B.
        autoreset_mode: "NextStep" (Gymnasium's default), "SameStep", or "Disabled": then rows are started anew by
            `reset(options={"reset_mask": (B,) bool})`.
        max_episode_steps: episodes are truncated after so many periods, if that is before the horizon.
        threads: cores to share a large batch; None: all that the process may use. No bit depends on it.
        The rest: as ClusterEnv. A vector reward has the shape (B, 2); `reward_space` and `reward_dim` are of one row.
    """

    metadata: dict[str, Any] = {
        "render_modes": list(RENDER_MODES),
        "render_fps": FPS,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    takes_several_targets = False  # a row for each
    horizon_as_argument = True

    @checked_but("num_envs", "candidates", "frame_px", "threads", "max_episode_steps")
    def __init__(  # noqa: PLR0913
        self,
        num_envs: int = 1,
        scenario: str | Scenario = "PreDC-v0",
        action: ActionName = "menu",
        observation: ObservationName = "candidates",
        reward: RewardName = "error",
        order: Order = "nearest",
        candidates: int = Settings.candidates,
        render_mode: RenderMode | None = None,
        frame_px: int = 600,
        fast: bool = False,
        action_mask: bool = False,
        autoreset_mode: Literal["NextStep", "SameStep", "Disabled"] | AutoresetMode = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
        threads: int | None = None,
        **overrides: Unpack[Quantities],
    ) -> None:
        self.num_envs: int = whole_number("num_envs", num_envs, 1)
        self.autoreset_mode: AutoresetMode = AutoresetMode(autoreset_mode)
        self.metadata = type(self).metadata | {"autoreset_mode": self.autoreset_mode}
        self.render_mode: RenderMode | None = render_mode
        self.scenario: Scenario = scenario_of(scenario, overrides, type(self))
        if not self.takes_several_targets:
            self.scenario.check_one_target("ClusterVectorEnv")
        self._camera = None if render_mode is None else Camera(self.scenario, render_mode, frame_px)
        self.world: World = World(self.scenario, threads, fast)
        settings = Settings(action, observation, reward, order, candidates)
        self.interface: Interface = Interface(self.scenario, settings, self.world.threads)
        self._tells_mask: bool = action_mask
        if action_mask:
            self.interface.check_masks(action)
        periods = self.scenario.periods
        if max_episode_steps is not None:
            periods = min(periods, whole_number("max_episode_steps", max_episode_steps, 1 + self.scenario.unscored))
        self._horizon: int = periods
        self.single_action_space: gym.Space[Any] = self.interface.action.space
        self.single_observation_space: gym.Space[Any] = self.interface.observation.space
        self.action_space: gym.Space[Any] = batch_space(self.single_action_space, self.num_envs)
        self.observation_space: gym.Space[Any] = batch_space(self.single_observation_space, self.num_envs)
        if self.interface.reward_space is not None:
            self.reward_space: gym.spaces.Box = self.interface.reward_space
            self.reward_dim: int = 2
        self._generators: list[np.random.Generator | None] = [None] * self.num_envs
        self._seeds: list[int | None] = [None] * self.num_envs  # that they began with
        self._busy = Busy()
        self._state: State = None  # type: ignore[assignment]  # until the first reset
        self._follower: Follower = None  # type: ignore[assignment]  # of the state, for the observation
        self._view: View = None  # type: ignore[assignment]  # shares the state's arrays
        self._shown: View | None = None  # the period's for others, once they have asked
        self._squares = np.zeros(self.num_envs)
        self._energy_mj = np.zeros(self.num_envs)
        self._detections = np.zeros(self.num_envs, dtype=np.int64)
        self._ended = np.zeros(self.num_envs, dtype=bool)
        self._reference = None
        if has_reference(self.scenario):
            self._reference = Reference(self.scenario, self.num_envs, self.world.threads, self._horizon)

    @one_thread
    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """New episodes, in the rows of options["reset_mask"] only where it is given.

        Args:
            seed: an int seeds row i with seed + i; a list seeds each row, None leaves its generator going.
        """
        check_options(options)
        rows, seeds = self._rows_to_reset(options), row_seeds(seed, self.num_envs)
        for i in np.flatnonzero(rows):
            if seeds[i] is not None or self._generators[i] is None:
                self._generators[i], self._seeds[i] = seeding.np_random(seeds[i])
        if self._state is None:
            self._state = self.world.allocate(self.num_envs)
            self._follower = self.interface.observation.follow(self._state.knowledge)
        info = self._restart(rows)
        self._show()
        observation = self._observe(rows)
        return observation, _mask_info(info, rows) | self._told_masks()

    def _rows_to_reset(self, options: dict[str, Any] | None) -> np.ndarray:
        mask = (options or {}).get("reset_mask")
        if mask is None:
            return np.ones(self.num_envs, dtype=bool)
        check_reset_mask(mask, self.num_envs, self._state is None)
        return mask

    def _restart(self, rows: np.ndarray) -> dict[str, np.ndarray]:
        """Begin episodes in some rows; gives the info, which is theirs alone."""
        outcome = self.world.restart(self._state, rows, self._draw_keys(rows), donate=True)[1]
        self._squares[rows] = self._energy_mj[rows] = 0.0
        self._detections[rows] = 0
        self._ended = self._ended & ~rows
        info = self.interface.reward_and_info(outcomes_by_name(outcome.row), self._state.lam)[1]
        if self._reference is not None:
            info["reference_m"] = self._reference.begin(self._state, rows)
        if self._camera is not None:
            self._camera.begin(self._state, outcome, rows)
        return info

    def _draw_keys(self, rows: np.ndarray) -> np.ndarray:
        """(B,) of the next episodes in the rows marked, each from its row's generator."""
        keys = np.zeros(self.num_envs, np.uint64)
        for i in np.flatnonzero(rows):
            keys[i] = draws.episode_key(cast(np.random.Generator, self._generators[i]))
        return keys

    @one_thread
    def step(self, actions: Any) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """One period for every row; ended rows start anew as the autoreset mode says.

        Args:
            actions: of the action space; or a Cluster of B rows, as policies choose it.
        """
        if self._state is None:
            raise gym.error.ResetNeeded("call reset() before step()")
        anew = self._ended
        begins = anew.any()
        if begins and self.autoreset_mode == AutoresetMode.DISABLED:
            raise gym.error.ResetNeeded(
                f"rows {np.flatnonzero(anew).tolist()} have ended: reset them with options={{'reset_mask': ...}}"
            )
        if isinstance(actions, Cluster):
            cluster = choice_of(actions, self._state)
        else:
            cluster = self.interface.action.cluster(stack_actions(actions), self._view)
        outcome = self.world.advance(self._state, *cluster)
        reward, info = self.interface.reward_and_info(outcomes_by_name(outcome.row), self._state.lam)
        self._squares += np.where(self._state.period > self.scenario.unscored, outcome.error_m * outcome.error_m, 0.0)
        self._energy_mj += outcome.energy_mj
        self._detections += outcome.detections
        if self._reference is not None:
            info["reference_m"] = self._reference.advance(self._state, outcome)
        if self._camera is not None:
            self._camera.add(self._state, outcome)
        if begins:  # next-step mode: these rows only begin
            reward[anew] = 0.0
            _overwrite_rows(info, self._restart(anew), anew)
        truncated = self._state.period >= self._horizon
        terminated = self.world.left(self._state)
        ended = terminated | truncated
        ends = ended.any()
        if terminated.any():
            reward = self._charge_rest(reward, terminated)[0]
        if ends and self.autoreset_mode == AutoresetMode.SAME_STEP:
            return self._restart_within_step(reward, terminated, truncated, info)
        self._ended = ended
        self._show()
        infos = _mask_info(info)
        if ends:
            infos |= _mask_info(self._episode_info(ended), ended)
        observation = self._observe()
        return observation, reward, terminated, truncated, infos | self._told_masks()

    def _episode_info(self, rows: np.ndarray) -> dict[str, np.ndarray]:
        """What sums up an episode, of the rows that end."""
        played = np.maximum(self._state.period, 1)
        scored = np.maximum(played - self.scenario.unscored, 1)
        info = {"episode_rms_m": np.sqrt(self._squares / scored), "episode_energy_mj": self._energy_mj.copy()}
        info["antnp"] = self._detections / played
        info |= lifetimes(self._state, self._horizon)
        if self.scenario.ends_outside:
            info["reward_rest"] = self._charge_rest(0.0, rows)[1]
        if self._reference is not None:
            info["episode_reference_m"] = self._reference.episode_m()
        return info

    def _charge_rest(self, reward: Any, rows: np.ndarray) -> tuple[Any, np.ndarray]:
        """The reward with what the periods cost that some rows leave out, and that cost alone."""
        periods = np.where(rows, self.scenario.periods - self._state.period, 0)
        return self.interface.charge_rest(reward, self._state.lam, periods)

    def _restart_within_step(
        self, reward: np.ndarray, terminated: np.ndarray, truncated: np.ndarray, info: dict[str, Any]
    ) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Begin the ended rows within the step; their last observation and info go to final_obs and final_info."""
        ended = terminated | truncated
        last = self._observe()
        final = np.full(self.num_envs, None, dtype=object)
        for i in np.flatnonzero(ended):
            final[i] = {name: value[i] for name, value in last.items()} if isinstance(last, dict) else last[i]
        infos: dict[str, Any] = {"final_obs": final, "_final_obs": ended.copy()}
        infos["final_info"] = _mask_info(info | self._episode_info(ended), ended) | self._told_masks()
        infos["_final_info"] = ended.copy()
        _overwrite_rows(info, self._restart(ended), ended)
        self._show()
        infos |= _mask_info(info)
        observation = self._observe(ended)
        return observation, reward, terminated, truncated, infos | self._told_masks()

    @one_thread
    def skip_episodes(self, counts: np.ndarray) -> None:
        """Let each row's generator pass over so many episodes (B,), as if they had been played."""
        for generator, count in zip(self._generators, counts.tolist()):
            for _ in range(count):
                draws.episode_key(cast(np.random.Generator, generator))

    def use_generator(self, row: int, generator: np.random.Generator) -> None:
        """Let a row's next episodes be drawn by this generator."""
        self._generators[row] = generator

    @property
    def np_random_seed(self) -> tuple[int | None, ...]:  # type: ignore[override]
        """(B,) the seeds that the rows' generators began with; None before the first reset."""
        return tuple(self._seeds)

    @property  # type: ignore[misc]
    def np_random(self) -> tuple[np.random.Generator | None, ...]:  # type: ignore[override]
        """(B,) the rows' generators; None before the first reset."""
        return tuple(self._generators)

    @property
    def horizon(self) -> int:
        """Time steps of an episode."""
        return self._horizon

    @property
    def lam(self) -> np.ndarray:
        """(B,) the present episodes' trade-offs [m/mJ]."""
        if self._state is None:
            raise gym.error.ResetNeeded("call reset() first")
        return self._state.lam

    @property
    def state(self) -> State:
        """The whole world, the truth in it: for loggers and trainings, never for policies."""
        return self._state

    @property
    @one_thread
    def view(self) -> View:
        """What hand-written policies see now, all rows: `policy.act(envs.view)` is their choice."""
        if self._state is None:
            raise gym.error.ResetNeeded("call reset() first")
        if self._shown is None:
            self._shown = View.of(self._state)
        return self._shown

    @one_thread
    def reference_all_awake_m(self) -> np.ndarray:
        """(B,) `episode_reference_m` of the present episodes, had every node been awake throughout and every report
        arrived. Looks at every node in range in every period: for the end of an episode, before the next begins.

        Raises:
            ValueError: for a scenario without a reference.
        """
        if self._state is None:
            raise gym.error.ResetNeeded("call reset() first")
        if self._reference is None:
            raise ValueError(why_no_reference(self.scenario))
        return self._reference.all_awake_m(self._state)

    @one_thread
    def action_masks(self) -> np.ndarray:
        """(B, n) bool: which entries of each row's action make sense now."""
        if self._state is None:
            raise gym.error.ResetNeeded("call reset() first")
        return self.interface.action.masks(self._view)

    @one_thread
    def render(self) -> Any:
        """A tuple of B frames (frame_px, frame_px, 3) uint8; in "human" mode None: reset and step show one window."""
        if self._camera is None or self._state is None:
            gym.logger.warn("render() needs render_mode='rgb_array' or 'human' and a reset environment")
            return None
        return self._camera.frames(self._state) if self.render_mode == "rgb_array" else None

    def close_extras(self, **kwargs: Any) -> None:
        """Close the window, if there is one."""
        if self._camera is not None:
            self._camera.close()

    def _told_masks(self) -> dict[str, np.ndarray]:
        """What infos tell of the actions that make sense now."""
        if not self._tells_mask:
            return {}
        every = np.ones(self.num_envs, bool)
        return {"action_mask": self.interface.action.masks(self._view).astype(np.int8), "_action_mask": every}

    def _show(self) -> None:
        if self._camera is not None:
            self._camera.show(self._state)

    def _observe(self, rows: np.ndarray | None = None) -> Any:
        """The observation of all rows, of which only `rows` have changed since the last."""
        self._view, observation = self._follower(rows)
        self._shown = None
        return observation


def check_reset_mask(mask: Any, rows: int, first: bool = False) -> None:
    """Raise ValueError unless it marks some of so many rows; at the first reset all."""
    good = isinstance(mask, np.ndarray) and mask.shape == (rows,) and mask.dtype == bool and mask.any()
    if not good or (first and not mask.all()):
        raise ValueError(
            f"options['reset_mask'] = {mask!r}: must be a NumPy bool array of shape ({rows},) with at least one True,"
            " after a reset of all rows"
        )


def row_seeds(seed: Any, rows: int) -> list[int | None]:
    """A seed for each row: seed + i, or those of a sequence; None leaves a row's generator going."""
    if seed is None:
        return [None] * rows
    if not isinstance(seed, (Sequence, np.ndarray)) or isinstance(seed, str) or np.ndim(seed) == 0:
        first = whole_number("seed", seed, 0)
        return [first + i for i in range(rows)]
    if len(seed) != rows:
        raise ValueError(f"seed has {len(seed)} entries: must have one for each of the {rows} rows")
    return [None if each is None else whole_number("seed", each, 0) for each in seed]


def stack_actions(actions: Any) -> Any:
    """A dict of arrays from a list of dicts, as policies' predict() gives them; anything else as it is."""
    several = isinstance(actions, (list, tuple)) or (isinstance(actions, np.ndarray) and actions.ndim)
    if several and len(actions) and isinstance(actions[0], dict):
        if all(isinstance(one, dict) and one.keys() == actions[0].keys() for one in actions):
            return {name: np.stack([one[name] for one in actions]) for name in actions[0]}
    return actions


def _mask_info(info: dict[str, np.ndarray], rows: np.ndarray | None = None) -> dict[str, np.ndarray]:
    """Gymnasium's form of a vector info: zeros where a row has none, and a mask under "_name".

    Args:
        rows: (B,) bool, who has one; None: all have, and their arrays are taken as they are.
    """
    if rows is None:
        mask = np.ones(len(info["error_m"]), dtype=bool)
        return info | {f"_{name}": mask for name in info}
    out = {}
    for name, value in info.items():
        out[name] = value.copy()
        out[name][~rows] = 0
        out[f"_{name}"] = rows.copy()
    return out


def _overwrite_rows(info: dict[str, np.ndarray], other: dict[str, np.ndarray], rows: np.ndarray) -> None:
    for name, value in other.items():
        info[name][rows] = value[rows]
