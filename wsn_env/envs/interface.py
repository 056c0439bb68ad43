"""What learners meet: actions (spaces <-> Cluster), observations (View -> arrays), rewards, pictures."""

from dataclasses import dataclass
from typing import Any

from gymnasium.spaces import Box

from wsn_env.envs.actions import Action, ActionName, make_action
from wsn_env.envs.info import period_info
from wsn_env.envs.observations import Observation, ObservationName, make_observation
from wsn_env.envs.rewards import RewardName, make_reward, reward_space
from wsn_env.models.measurement.base import Order
from wsn_env.scenario import Scenario


@dataclass(frozen=True)
class Settings:
    """An environment's actions, observations and rewards, whatever the scenario."""

    action: ActionName = "menu"
    observation: ObservationName = "candidates"
    reward: RewardName = "error"
    order: Order = "nearest"
    candidates: int = 12


class Interface:
    """The three translations of an environment, bound to a scenario."""

    def __init__(self, scenario: Scenario, settings: Settings, threads: int = 1) -> None:
        self.action: Action = make_action(settings.action, scenario, settings.order, settings.candidates)
        self.observation: Observation = make_observation(
            settings.observation, scenario, settings.order, settings.candidates, threads
        )
        self.reward_space: Box | None = reward_space(settings.reward)
        self._reward = make_reward(settings.reward)

    def reward_and_info(self, outcome: Any, lam: Any) -> tuple[Any, dict[str, Any]]:
        """A period's reward and info, of arrays (B, ...) or of one row's numbers."""
        reward = self._reward(outcome, lam)
        return reward, period_info(outcome, lam, reward if self.reward_space is None else None)
