"""A training whose weights are no numbers any more stops, and its last checkpoint stays."""

from __future__ import annotations

from typing import Any

import torch
from stable_baselines3.common.callbacks import BaseCallback


def is_finite(model: Any) -> bool:
    """Whether all weights of a model of stable-baselines3 are finite."""
    return all(bool(torch.isfinite(weights).all()) for weights in model.policy.parameters())


def check_finite(model: Any) -> None:
    """Raise ValueError unless they are."""
    if not is_finite(model):
        rate, entropy = model.lr_schedule(1.0), model.ent_coef
        raise ValueError(
            f"training diverged after {model.num_timesteps:,} periods: its weights are not finite; take a smaller"
            f" learning_rate than {rate:g} (or entropy than {entropy:g}) and begin anew"
        )


class StopDiverged(BaseCallback):
    """Looks after every update."""

    def _on_step(self) -> bool:
        return True

    def _on_rollout_start(self) -> None:
        check_finite(self.model)

    def _on_training_end(self) -> None:
        check_finite(self.model)
