"""PettingZoo's form of several targets: an agent for each target, or for each node that could serve it."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from typing import Any, Literal, Protocol

import gymnasium as gym
import numpy as np
from gymnasium import spaces

try:
    from pettingzoo import ParallelEnv
except ImportError:
    raise ImportError("wsn_env.parallel_env needs pettingzoo: pip install 'wsn_env[multi]'") from None

from wsn_env.envs.multi_env import MultiEnv, part_of
from wsn_env.envs.registration import MULTI
from wsn_env.envs.vector_env import stack_actions
from wsn_env.scenario import Scenario

# Scores of a node that sleeps, and of one that offers to lead, more and more.
BIDS = np.array([-1.0, 1 / 3, 2 / 3, 1.0], np.float32)


def parallel_env(name: str | Scenario = "Multi-v0", **arguments: Any) -> ParallelClusterEnv:
    """A ParallelClusterEnv by the name of a scenario; "Multi-v0" is PreDC-v0."""
    return ParallelClusterEnv("PreDC-v0" if name in ("Multi-v0", MULTI) else name, **arguments)


class ParallelClusterEnv(ParallelEnv):
    """One field with M targets as PettingZoo's ParallelEnv.

    Args:
        agents: "targets": `target_0`, ..., each chooses the cluster of its target, by any action of MultiEnv; or
            "candidates": `target_0/node_0`, ..., the K living nodes nearest to each target's prediction, each with
            Discrete(4): 0 sleeps, 1, 2 and 3 wake and offer to lead, of equal offers that of the nearest node counts.
        rewards: "shared": all agents have the sum over the targets; or "own": that of the agent's target.
        The rest: as MultiEnv.
    """

    def __init__(
        self,
        scenario: str | Scenario = "PreDC-v0",
        targets: int | None = None,
        agents: Literal["targets", "candidates"] = "targets",
        rewards: Literal["shared", "own"] = "shared",
        **more: Any,
    ) -> None:
        for name, chosen, allowed in (
            ("agents", agents, ("targets", "candidates")),
            ("rewards", rewards, ("shared", "own")),
        ):
            if chosen not in allowed:
                raise ValueError(f"{name} = {chosen!r}: allowed are {' and '.join(map(repr, allowed))}")
        if agents == "candidates":
            for name, value in (("action", "scores"), ("observation", "candidates")):
                if more.get(name, value) != value:
                    raise ValueError(f"{name} = {more[name]!r}: must be {value!r} with agents = 'candidates'")
            more |= {"action": "scores", "observation": "candidates"}
        self.env: MultiEnv = MultiEnv(scenario, targets, **more)
        self.metadata: dict[str, Any] = {"name": f"wsn_env/{self.env.scenario.name}", **self.env.metadata}
        self.render_mode = self.env.render_mode
        faces: dict[str, Callable[[MultiEnv], _Face]] = {"targets": _Targets, "candidates": _Candidates}
        self._face: _Face = faces[agents](self.env)
        self._shared = rewards == "shared"
        self.possible_agents: list[str] = list(self._face.target_of)
        self.agents: list[str] = []
        self.observation_spaces = {agent: self._face.observation_space() for agent in self.possible_agents}
        self.action_spaces = {agent: self._face.action_space() for agent in self.possible_agents}

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """The same object for an agent at every call."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """The same object for an agent at every call."""
        return self.action_spaces[agent]

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[dict, dict]:
        """A new episode; all agents are there until its end."""
        observation, info = self.env.reset(seed=seed, options=options)
        self.agents = list(self.possible_agents)
        return self._face.observe(observation), self._infos(info)

    def step(self, actions: dict[str, Any]) -> tuple[dict, dict, dict, dict, dict]:
        """One period.

        Args:
            actions: of every agent.
        """
        if not self.agents:
            raise gym.error.ResetNeeded("the episode has ended, or has not begun: call reset()")
        missing = [agent for agent in self.agents if agent not in actions]
        if missing:
            raise ValueError(f"actions: {', '.join(missing[:5])} must have one each")
        observation, reward, terminated, truncated, info = self.env.step(self._face.joint(actions))
        of_targets = self.env.fields.rewards
        rewards = {
            agent: reward if self._shared else float(of_targets[0, target])
            for agent, target in self._face.target_of.items()
        }
        ends = dict.fromkeys(self.agents, terminated), dict.fromkeys(self.agents, truncated)
        infos = self._infos(info)
        if terminated or truncated:
            self.agents = []
        return self._face.observe(observation), rewards, *ends, infos

    def _infos(self, info: dict[str, Any]) -> dict[str, dict[str, Any]]:
        """Of each agent what is its target's, and what all share."""
        return {
            agent: {name: value[target] if np.ndim(value) else value for name, value in info.items()}
            for agent, target in self._face.target_of.items()
        }

    def render(self) -> Any:
        """As MultiEnv."""
        return self.env.render()

    def close(self) -> None:
        """Close the window, if there is one."""
        self.env.close()


class _Face(Protocol):
    """How agents, their observations and actions, go with those of a MultiEnv."""

    target_of: dict[str, int]

    def observation_space(self) -> spaces.Space[Any]: ...

    def action_space(self) -> spaces.Space[Any]: ...

    def observe(self, observation: Any) -> dict[str, Any]: ...

    def joint(self, actions: dict[str, Any]) -> Any: ...


class _Targets:
    """An agent for each target."""

    def __init__(self, env: MultiEnv) -> None:
        self._rows = env.fields.rows
        self.target_of = {f"target_{k}": k for k in range(env.targets)}

    def observation_space(self) -> spaces.Space[Any]:
        return deepcopy(self._rows.single_observation_space)

    def action_space(self) -> spaces.Space[Any]:
        return deepcopy(self._rows.single_action_space)

    def observe(self, observation: Any) -> dict[str, Any]:
        return {agent: part_of(observation, target) for agent, target in self.target_of.items()}

    def joint(self, actions: dict[str, Any]) -> Any:
        return stack_actions([actions[agent] for agent in self.target_of])


class _Candidates:
    """An agent for each of the K living nodes nearest to a target's prediction."""

    def __init__(self, env: MultiEnv) -> None:
        encoder: Any = env.fields.rows.interface.observation
        self._belief, (self._count, self._width) = encoder.belief, encoder.shape
        self._space = env.fields.rows.single_observation_space
        self._targets, self._bids = env.targets, spaces.Discrete(len(BIDS))
        self.target_of = {f"target_{k}/node_{j}": k for k in range(env.targets) for j in range(self._count)}

    def observation_space(self) -> spaces.Space[Any]:
        low, high = (getattr(self._space, end).flat[0] for end in ("low", "high"))
        return spaces.Box(low, high, (self._belief + self._width,), np.float32)

    def action_space(self) -> spaces.Space[Any]:
        return spaces.Discrete(len(BIDS))

    def observe(self, observation: np.ndarray) -> dict[str, Any]:
        about, own = observation[:, : self._belief], observation[:, self._belief :]
        own = own.reshape(self._targets, self._count, self._width)
        places = ((k, j) for k in range(self._targets) for j in range(self._count))
        return {agent: np.concatenate([about[k], own[k, j]]) for agent, (k, j) in zip(self.target_of, places)}

    def joint(self, actions: dict[str, Any]) -> np.ndarray:
        for agent in self.target_of:
            if not self._bids.contains(actions[agent]):
                raise ValueError(f"actions[{agent!r}] = {actions[agent]!r:.80}: must be 0, 1, 2 or 3")
        return BIDS[[int(actions[agent]) for agent in self.target_of]].reshape(self._targets, self._count)
