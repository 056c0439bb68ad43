"""The single environment: a World with one row."""

from __future__ import annotations

import math
from typing import Any, Unpack

import gymnasium as gym
import numpy as np

from wsn_env.compiled import draws
from wsn_env.envs.actions import ActionName
from wsn_env.envs.info import outcome_by_name
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


class ClusterEnv(TellsHorizon, gym.Env):
    """Choose a cluster each period; the reward is minus (error + lam * energy).

    Args:
        scenario: an id such as "PreDC-v0", or a Scenario.
        action: "menu" | "subset" | "radius" | "scores" | "nodes" | "cluster".
        observation: "candidates" | "menu" | "dict" | "view".
        reward: "error" (the mission's) | "belief" (lower variance, for training only) | "vector" ([-error, -energy] as
            MO-Gymnasium has it, with `reward_space` and `reward_dim`).
        order: "nearest" | "information" | "value", the menu's order of merit.
        candidates: K, how many nodes actions and observations consider.
        render_mode: None | "rgb_array" | "human", a window, for which pygame-ce must be installed.
        frame_px: side of a frame.
        fast: a quicker particle filter, equal to rounding, whose bits differ from processor to processor.
        action_mask: every info also has `action_mask`, int8: what `action_masks()` gives.
        overrides: any quantity of the scenario: `nodes=400, particles=1000, lam=(0.3, 30), motion="sine"`.

    An episode is truncated at the horizon: a lost track or a dead network goes on. It terminates only with
    `ends_outside=True`, in the period in which the target is outside the field.
    """

    metadata: dict[str, Any] = {"render_modes": list(RENDER_MODES), "render_fps": FPS}

    @checked_but("candidates", "frame_px")
    def __init__(  # noqa: PLR0913
        self,
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
        **overrides: Unpack[Quantities],
    ) -> None:
        self.scenario: Scenario = scenario_of(scenario, overrides, type(self))
        self.scenario.check_one_target("ClusterEnv")
        self._camera = None if render_mode is None else Camera(self.scenario, render_mode, frame_px)
        self.interface: Interface = Interface(self.scenario, Settings(action, observation, reward, order, candidates))
        self._tells_mask: bool = action_mask
        if action_mask:
            self.interface.check_masks(action)
        self.world: World = World(self.scenario, threads=1, fast=fast)
        self.render_mode: RenderMode | None = render_mode
        self.action_space: gym.Space[Any] = self.interface.action.space
        self.observation_space: gym.Space[Any] = self.interface.observation.space
        if self.interface.reward_space is not None:
            self.reward_space: gym.spaces.Box = self.interface.reward_space
            self.reward_dim: int = 2
        self._busy = Busy()
        self._state: State = None  # type: ignore[assignment]  # until the first reset
        self._follower: Follower = None  # type: ignore[assignment]  # of the state, for the observation
        self._view: View = None  # type: ignore[assignment]  # shares the state's arrays
        self._shown: View | None = None  # the period's for others, once they have asked
        self._lam, self._period, self._ended = 0.0, 0, False
        self._squares = self._energy_mj = 0.0
        self._detections = 0
        self._reference = Reference(self.scenario) if has_reference(self.scenario) else None

    @one_thread
    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """A new episode: seed fixes field, track and every draw."""
        check_options(options)
        super().reset(seed=None if seed is None else whole_number("seed", seed, 0))
        state = self.world.allocate(1) if self._state is None else self._state
        key = draws.episode_key(self.np_random)
        outcome = self.world.restart(state, [True], np.array([key]), donate=True)[1]
        if self._state is None:
            self._state, self._follower = state, self.interface.observation.follow(state.knowledge)
        self._lam, self._period, self._ended = self._state.lam.item(), 0, False
        self._squares = self._energy_mj = 0.0
        self._detections = 0
        info = self.interface.reward_and_info(outcome_by_name(outcome.row), self._lam)[1]
        if self._reference is not None:
            info["reference_m"] = self._reference.begin(self._state).item()
        if self._camera is not None:
            self._camera.begin(self._state, outcome, [True])
            self._camera.show(self._state)
        return self._observe(info), info

    @one_thread
    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """One period. Returns observation, reward, terminated, truncated, info.

        Args:
            action: of the action space; or a Cluster, of one row, as policies choose it.
        """
        if self._state is None:
            raise gym.error.ResetNeeded("call reset() before step()")
        if self._ended:
            raise gym.error.ResetNeeded(f"the episode ended after {self._period} periods: call reset()")
        if isinstance(action, Cluster):
            cluster = choice_of(action, self._state)
        else:
            cluster = self.interface.action.cluster(_add_batch_axis(action), self._view)
        outcome = self.world.advance(self._state, *cluster)
        reward, info = self.interface.reward_and_info(outcome_by_name(outcome.row), self._lam)
        self._period += 1
        if self._period > self.scenario.unscored:
            self._squares += info["error_m"] * info["error_m"]
        self._energy_mj += info["energy_mj"]
        self._detections += info["detections"]
        if self._reference is not None:
            info["reference_m"] = self._reference.advance(self._state, outcome).item()
        if self._camera is not None:
            self._camera.add(self._state, outcome)
            self._camera.show(self._state)
        terminated = self.scenario.ends_outside and self.world.left(self._state).item()
        truncated = self._period >= self.scenario.periods
        self._ended = terminated or truncated
        if self._ended:
            info["episode_rms_m"] = math.sqrt(self._squares / (self._period - self.scenario.unscored))
            info["episode_energy_mj"] = self._energy_mj
            info["antnp"] = self._detections / self._period
            info |= {name: values.item() for name, values in lifetimes(self._state, self.scenario.periods).items()}
            if self.scenario.ends_outside:
                left = self.scenario.periods - self._period
                reward, info["reward_rest"] = self.interface.charge_rest(reward, self._lam, left)
            if self._reference is not None:
                info["episode_reference_m"] = self._reference.episode_m().item()
        return self._observe(info), reward, terminated, truncated, info

    @property
    def lam(self) -> np.ndarray:
        """(1,) the present episode's trade-off [m/mJ]."""
        return self._state.lam

    @property
    @one_thread
    def view(self) -> View:
        """What hand-written policies see now: `policy.act(env.view)` is their choice, whatever the action space."""
        if self._state is None:
            raise gym.error.ResetNeeded("call reset() first")
        if self._shown is None:
            self._shown = View.of(self._state)
        return self._shown

    @one_thread
    def reference_all_awake_m(self) -> float:
        """`episode_reference_m` of the present episode, had every node been awake throughout and every report arrived.

        Looks at every node in range in every period: for the end of an episode.

        Raises:
            ValueError: for a scenario without a reference.
        """
        if self._state is None:
            raise gym.error.ResetNeeded("call reset() first")
        if self._reference is None:
            raise ValueError(why_no_reference(self.scenario))
        return self._reference.all_awake_m(self._state).item()

    @one_thread
    def action_masks(self) -> np.ndarray:
        """Which entries of the action make sense now (flat bool, as sb3-contrib's MaskablePPO wants them)."""
        if self._state is None:
            raise gym.error.ResetNeeded("call reset() first")
        return self.interface.action.masks(self._view)[0]

    @one_thread
    def render(self) -> Any:
        """A frame (frame_px, frame_px, 3) uint8 of the present state; in "human" mode None: reset and step show it."""
        if self._camera is None or self._state is None:
            gym.logger.warn("render() needs render_mode='rgb_array' or 'human' and a reset environment")
            return None
        return self._camera.frames(self._state)[0] if self.render_mode == "rgb_array" else None

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._camera is not None:
            self._camera.close()

    @property
    def horizon(self) -> int:
        """Time steps of an episode."""
        return self.scenario.periods

    def _observe(self, info: dict[str, Any]) -> Any:
        self._view, arrays = self._follower()
        self._shown = None
        if self._tells_mask:
            info["action_mask"] = self.interface.action.masks(self._view)[0].astype(np.int8)
        if isinstance(arrays, dict):
            return {name: value[0] if value.ndim > 1 else value.item() for name, value in arrays.items()}
        return arrays[0]


def _add_batch_axis(action: Any) -> Any:
    try:
        if isinstance(action, dict):
            return {name: np.asarray(value)[None] for name, value in action.items()}
        return np.asarray(action)[None]
    except ValueError:  # lists of unequal lengths
        return [action]  # which no space contains
