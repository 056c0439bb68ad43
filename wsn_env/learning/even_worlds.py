"""Advantages of one size in every world of a training."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.buffers import RolloutBuffer


class EvenWorldsBuffer(RolloutBuffer):
    """PPO's buffer; the advantages of each world's rows get mean 0 and standard deviation 1. Else the worlds in which
    targets are fast, or lost, whose costs vary most, would decide what is learned for all.

    Args:
        rows: how many each world has; they come one after the other.
        The rest: as RolloutBuffer.
    """

    def __init__(self, *args: Any, rows: Sequence[int], **settings: Any) -> None:
        self._ends = np.cumsum(rows)
        super().__init__(*args, **settings)

    def compute_returns_and_advantage(self, last_values: torch.Tensor, dones: np.ndarray) -> None:
        """Returns, which teach the critic, stay as they are."""
        super().compute_returns_and_advantage(last_values, dones)
        for own in np.split(self.advantages, self._ends[:-1], axis=1):  # views
            own -= own.mean()
            own /= own.std() + 1e-8
