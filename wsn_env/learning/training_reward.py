"""Rewards as learners need them: of one size for every scenario and lam, and of low variance without a bias."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode

from wsn_env.evaluation.native_envs import unwrap_native
from wsn_env.models.arguments import checked
from wsn_env.scenario import Scenario

WIDTHS = np.arange(-1.0, 4.5, 0.5)  # of beliefs, log2 of their rms over a scenario's typical error
PRIOR_M = 100.0  # of error in every width before the first period: soon outweighed


class TrainingReward(gym.vector.VectorWrapper):
    """For the native vector environment.

    Args:
        envs: a ClusterVectorEnv, maybe wrapped.
        scaled: rewards are divided by the scenario's `typical_cost`, so that their size is alike for every scenario and
            lam.
        calibrated: the part of the reward that stands for the error is multiplied by the ratio of all true errors so
            far to it, among beliefs about as wide, so that a believed error costs on average what the true one does:
            filters believe too little or too much of themselves, and most where they know least. Not in same-step mode,
            whose infos are the next episodes' where one ends.
    """

    @checked
    def __init__(self, envs: gym.vector.VectorEnv, scaled: bool = True, calibrated: bool = False) -> None:
        if unwrap_native(envs).interface.reward_space is not None:
            raise ValueError("reward 'vector': learners need one number, 'error' or 'belief'")
        if calibrated and unwrap_native(envs).autoreset_mode == AutoresetMode.SAME_STEP:
            raise ValueError("calibrated=True needs autoreset_mode Disabled or NextStep")
        super().__init__(envs)
        self._scaled, self._calibrated = scaled, calibrated
        # Sums of true errors, and of what the rewards took for them, by width; at first they agree.
        self.errors: np.ndarray = np.full((2, len(WIDTHS)), PRIOR_M)

    def step(self, actions: Any) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """One period; the rewards are float32 copies."""
        scenario, lam = unwrap_native(self).scenario, unwrap_native(self).lam.copy()
        observations, rewards, terminated, truncated, info = self.env.step(actions)
        if self._calibrated:
            rewards = rewards + (self._error_ratio(info, scenario) - 1.0) * info["reward_error"]
        scale = scenario.typical_cost(lam) if self._scaled else 1.0
        return observations, (rewards / scale).astype(np.float32), terminated, truncated, info

    def _error_ratio(self, info: dict[str, Any], scenario: Scenario) -> np.ndarray:
        """(B,) true over believed errors, after those of this period. Rows that only begin have neither."""
        width = np.log2(np.maximum(info["posterior_rms_m"] / scenario.typical_error_m, 1e-9))
        nearest = abs(WIDTHS[:, None] - width).argmin(axis=0)
        for sums, errors in zip(self.errors, (scenario.counted_m(info["error_m"]), -info["reward_error"])):
            sums += np.bincount(nearest, errors, len(WIDTHS))
        return np.interp(width, WIDTHS, self.errors[0] / self.errors[1])
