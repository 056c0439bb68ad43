"""Advantages that are not drowned by those of lost tracks."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from stable_baselines3.common.buffers import RolloutBuffer

from wsn_env.envs.features import BELIEF_FEATURES, BOUND

WIDTH = BELIEF_FEATURES.index("major_sd")
STEPS = 2  # widths kept apart, in a factor e
MEMORY = 0.8  # of the rollouts before
PRIOR_TRANSITIONS = 50.0  # transitions at the size of all: what a width counts as that was hardly ever met


class Levelling:
    """Advantages brought nearer to one size, whatever the belief's width.

    Advantages about a lost track are some twenty times the size of those about a sharp belief: a few such periods would
    weigh as much as all others. A factor that depends on the state alone leaves every action's rank in that state as it
    is.

    Args:
        level: advantages are divided by their root mean square among beliefs about as wide, to this power; 0: left as
            they are.
    """

    def __init__(self, level: float) -> None:
        self._level = level
        # Transitions so far and the sums of their squared advantages, by width.
        self.sums: np.ndarray = np.zeros((2, 1 + round(2 * BOUND * STEPS)))

    def __call__(self, observations: np.ndarray, advantages: np.ndarray) -> np.ndarray:
        """Of a rollout.

        Args:
            observations: (..., n).
            advantages: (...).

        Returns: (...) float32.
        """
        width = np.rint(STEPS * (observations[..., WIDTH] + BOUND)).astype(int)
        squares = advantages.astype(float) ** 2
        self.sums *= MEMORY
        for sums, weights in zip(self.sums, (np.ones_like(squares), squares)):
            sums += np.bincount(width.ravel(), weights.ravel(), len(sums))
        met, summed = self.sums
        size = np.sqrt((summed + PRIOR_TRANSITIONS * summed.sum() / met.sum()) / (met + PRIOR_TRANSITIONS))
        return (advantages / size[width] ** self._level).astype(np.float32)


class LevelledRollout(RolloutBuffer):
    """stable-baselines3's, with levelled advantages.

    Args:
        level: see Levelling.
        The rest: of RolloutBuffer.
    """

    def __init__(self, *args: Any, level: float = 0.0, **kwargs: Any) -> None:
        self.levelling: Levelling = Levelling(level)
        super().__init__(*args, **kwargs)

    def compute_returns_and_advantage(self, last_values: torch.Tensor, dones: np.ndarray) -> None:
        """As RolloutBuffer, then level."""
        super().compute_returns_and_advantage(last_values, dones)
        self.advantages: np.ndarray = self.levelling(self.observations, self.advantages)
