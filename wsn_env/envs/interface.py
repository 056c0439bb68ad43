"""What learners meet: actions (spaces <-> Cluster), observations (View -> arrays), rewards, pictures."""

from collections.abc import Mapping
from dataclasses import dataclass
from inspect import signature
from typing import Any

import numpy as np
from gymnasium.spaces import Box, Discrete

from wsn_env.envs.actions import Action, ActionName, make_action
from wsn_env.envs.observations import Observation, ObservationName, make_observation
from wsn_env.envs.rewards import RewardName, make_reward, reward_space
from wsn_env.models.measurement.base import Order
from wsn_env.models.quantity import UnknownKeyword, UnknownQuantity, short, suggest, whole_number
from wsn_env.models.state import Cluster
from wsn_env.scenario import Scenario
from wsn_env.simulation.view import View


@dataclass(frozen=True)
class Settings:
    """An environment's actions, observations and rewards, whatever the scenario."""

    action: ActionName = "menu"
    observation: ObservationName = "candidates"
    reward: RewardName = "error"
    order: Order = "nearest"
    candidates: int = 12

    def __post_init__(self) -> None:
        object.__setattr__(self, "candidates", whole_number("candidates", self.candidates, 1))


def scenario_of(scenario: str | Scenario, overrides: Any, environment: type) -> Scenario:
    """The scenario of an environment that was given these keywords beside its own.

    Raises:
        UnknownKeyword: suggests among the quantities and the environment's own arguments.
    """
    try:
        return Scenario.of(scenario, **overrides)
    except UnknownQuantity as problem:
        own = [
            each.name for each in signature(environment).parameters.values() if each.kind is each.POSITIONAL_OR_KEYWORD
        ]
        hint, shown = (
            suggest(problem.name, [*problem.known, *own]),
            getattr(environment, "shown_as", environment.__name__),
        )
        raise UnknownKeyword(f"{shown}() got an unexpected keyword argument {problem.name!r}: {hint}") from None


def check_options(options: Any) -> None:
    """Raise ValueError unless reset's options are a dict or None."""
    if options is not None and not isinstance(options, Mapping):
        raise ValueError(f"options = {short(repr(options))}: must be a dict or None")


class Interface:
    """The three translations of an environment, bound to a scenario."""

    def __init__(self, scenario: Scenario, settings: Settings, threads: int = 1) -> None:
        self.action: Action = make_action(settings.action, scenario, settings.order, settings.candidates, threads)
        self.observation: Observation = make_observation(
            settings.observation, scenario, settings.order, settings.candidates, threads
        )
        self.reward_space: Box | None = reward_space(settings.reward)
        self._reward = make_reward(settings.reward, scenario.counted_m)
        self._counted = scenario.counted_m
        self._reference = scenario.reference_error_m, scenario.reference_energy_mj

    def check_masks(self, name: ActionName) -> None:
        """Raise ValueError if the action, of this name, has no masks."""
        if isinstance(self.action.space, Box):
            raise ValueError(f"action_mask = True: action {name!r} is of numbers and has no masks")

    def most_probable(self, logits: np.ndarray, view: View) -> Cluster:
        """The clusters of the most probable actions.

        Args:
            logits: (B, n) of the action space's components, one after the other.
        """
        space = self.action.space
        ends = np.cumsum(logit_counts(space))[:-1]
        best = np.stack([part.argmax(axis=1) for part in np.split(logits, ends, axis=1)], axis=1)
        return self.action.cluster(best.reshape(len(best), *space.shape), view)

    def reward_and_info(self, outcome: dict[str, Any], lam: Any) -> tuple[Any, dict[str, Any]]:
        """A period's reward, and its info: the outcome, with the reward told apart in error and energy. Of a vector
        reward these are the parts of the mission's reward at this lam.

        Args:
            outcome: OUTCOME_FIELDS by name, arrays (B, ...) or one row's numbers; becomes the info.
            lam: (B,) or a number.
        """
        reward = self._reward(outcome, lam)
        energy = -lam * outcome["energy_mj"]
        whole = self.reward_space is None
        outcome["reward_energy"] = energy
        outcome["reward_error"] = reward - energy if whole else -self._counted(outcome["error_m"])
        return reward, outcome

    def charge_rest(self, reward: Any, lam: Any, periods: Any) -> tuple[Any, Any]:
        """Charge the periods that are left when an episode ends outside the field: ending must never pay.

        Each costs a fixed price, whatever the policy: that of the scenario's reference point.

        Args:
            reward: of the last period, arrays (B, ...) or one row's.
            periods: (B,) or a number: how many are left, 0 in a row that goes on or ends at the horizon.

        Returns: the reward with the charge, and the charge alone at this lam, at most 0.
        """
        error, energy = (each * periods for each in self._reference)
        rest = -(error + lam * energy)
        if self.reward_space is None:
            return reward + rest, rest
        return reward - np.stack([error, energy], axis=-1).astype(np.float32), rest


def logit_counts(space: Any) -> list[int]:
    """How many logits each component of an action has."""
    return [space.n] if isinstance(space, Discrete) else list(space.nvec)
