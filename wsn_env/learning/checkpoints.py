"""Checkpoints of stable-baselines3's PPO, and what a training tells and keeps on its way."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback

from wsn_env.evaluation.files import replacing

CHECKPOINT = "checkpoint.zip"


def save_checkpoint(model: BaseAlgorithm, folder: Path) -> None:
    """Whole or not at all."""
    with replacing(folder / CHECKPOINT) as path, open(path, "wb") as file:
        model.save(file)


def load_checkpoint(folder: Path, envs: Any, seed: int) -> PPO | None:
    """The model of the last checkpoint, if there is one; its episodes are others than before.

    Args:
        envs: what it goes on in.
        seed: of the training.

    Raises:
        ValueError: the file is damaged.
    """
    path = folder / CHECKPOINT
    if not path.exists():
        return None
    try:
        model = PPO.load(path, env=envs)
    except Exception as problem:  # zipfile, pickle and torch raise all kinds for a damaged file
        raise ValueError(f"{path} is cut short or no checkpoint: remove it to begin anew ({problem!r})") from None
    envs.seed(seed + model.num_timesteps)
    return model


class Watch(BaseCallback):
    """Progress and checkpoints.

    Args:
        folder: for checkpoints.
        steps: of the whole training.
        checkpoint_steps: between two checkpoints.
        report: is called with steps done, all of them and how it goes.
    """

    def __init__(self, folder: Path, steps: int, checkpoint_steps: int, report: Callable[[int, int, str], Any]) -> None:
        super().__init__()
        self._folder, self._steps, self._checkpoint_steps, self._report = folder, steps, checkpoint_steps, report
        self._saved = 0
        self._rms: deque[float] = deque(maxlen=200)  # episodes

    def _on_step(self) -> bool:
        self._rms.extend(info["episode_rms_m"] for info in self.locals["infos"] if "episode_rms_m" in info)
        return True

    def _on_rollout_end(self) -> None:
        rms, error = mean_and_error(self._rms)
        self.logger.record("rollout/episode_rms_m", rms)
        self.logger.record("rollout/episode_rms_se_m", error)
        rewards = [info["r"] for info in self.model.ep_info_buffer or ()]
        self.logger.record("rollout/ep_rew_se", mean_and_error(rewards)[1])
        self._report(min(self.num_timesteps, self._steps), self._steps, f"training, RMS {rms:.2f} m")
        if self.num_timesteps - self._saved >= self._checkpoint_steps:
            save_checkpoint(self.model, self._folder)
            self._saved = self.num_timesteps


def mean_and_error(values: Collection[float]) -> tuple[float, float]:
    """Of some numbers their mean and its standard error; NaN where there are too few."""
    numbers = np.array(values, dtype=float)
    mean = float(numbers.mean()) if len(numbers) else float("nan")
    return mean, float(numbers.std(ddof=1) / np.sqrt(len(numbers))) if len(numbers) > 1 else float("nan")
