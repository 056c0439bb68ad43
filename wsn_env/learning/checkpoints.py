"""Checkpoints of stable-baselines3's PPO, and what a training tells and keeps on its way.

A checkpoint is taken between two updates. It holds all that decides how the training goes on: weights, optimizer,
generators, running sums, and of each row how many episodes it has begun and the actions since, which are played again.
A training that goes on from it is to the bit one that was never stopped.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from wsn_env.learning.actor_critic import actor_network
from wsn_env.learning.checkpoint_file import read_checkpoint, refuse_executable, unsuitable, write_checkpoint
from wsn_env.learning.held_out import HELD_OUT, HeldOut
from wsn_env.learning.replayable import ReplayableRows

CHECKPOINT = "checkpoint.safetensors"
OLD_CHECKPOINT = "checkpoint.zip"
GENERATORS = "generators.torch", "generators.numpy", "generators.numpy_place"
WINDOWS = {"episodes.r": np.float32, "episodes.l": np.int32, "episodes.rms_m": np.float64}  # of the last episodes
EARLIEST = 0.01  # share of the training after which the learning curve begins; its points are closer at first
PENDING = "pending."  # what the last update has told, to be logged with the next rollout


def take_checkpoint(model: PPO) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Copies of its arrays, and facts, between two updates."""
    rows = _rows_of(model)
    mt19937: Any = np.random.get_state()
    last = list(model.ep_info_buffer or ())
    windows = [info["r"] for info in last], [info["l"] for info in last], list(rows.rms_m)
    arrays = {name: array.copy() for name, array in _live_arrays(model).items()}
    arrays |= {name: np.array(values, kind) for (name, kind), values in zip(WINDOWS.items(), windows)}
    arrays |= zip(GENERATORS, (torch.get_rng_state().numpy(), mt19937[1].copy(), np.array(mt19937[2:])))
    arrays |= {"actions": rows.recent_actions(), "observation": np.array(model._last_obs)}
    logger: Any = model.logger
    arrays |= {PENDING + name: np.array(value) for name, value in logger.name_to_value.items()}
    excluded = {name: list(logger.name_to_excluded[name]) for name in logger.name_to_value}
    return arrays, {"periods": model.num_timesteps, "excluded": excluded}


def load_checkpoint(
    model: PPO, folder: Path, steps: int, facts: dict[str, dict[str, Any]]
) -> list[tuple[str, Any, Any]]:
    """Bring a new model to the last checkpoint, if there is one.

    Args:
        model: of ReplayableRows, which have been seeded.
        steps: of the whole training.
        facts: what the checkpoint must have been written with.

    Returns: what its logger is to record.

    Raises:
        ValueError: the file is damaged, of something else, or one that could execute anything.
    """
    path = folder / CHECKPOINT
    refuse_executable(folder / OLD_CHECKPOINT, path)
    if not path.exists():
        return []
    arrays, found = read_checkpoint(path, facts)
    try:
        _restore(model, arrays, found, steps)
        excluded = found["excluded"]
        return [
            (name.removeprefix(PENDING), array[()], tuple(excluded[name.removeprefix(PENDING)]))
            for name, array in arrays.items()
            if name.startswith(PENDING)
        ]
    except (LookupError, TypeError, ValueError, AttributeError, RuntimeError) as problem:
        raise unsuitable(path, problem) from None


def _restore(model: PPO, arrays: dict[str, np.ndarray], facts: dict[str, Any], steps: int) -> None:
    rows = _rows_of(model)
    periods, rollout = facts["periods"], model.n_steps * model.n_envs
    if type(periods) is not int or periods % rollout or not 0 <= periods < steps + rollout:
        raise ValueError(f"periods = {periods!r}: must be a multiple of {rollout} below {steps + rollout}")
    model.num_timesteps, model._n_updates = periods, periods // rollout * model.n_epochs
    if periods:  # as Adam begins with its first step
        for weight in model.policy.parameters():
            moments = {name: torch.zeros_like(weight) for name in ("exp_avg", "exp_avg_sq")}
            model.policy.optimizer.state[weight] = {"step": torch.zeros(()), **moments}
    live = _live_arrays(model)
    for name, array in live.items():
        _check_like(name, arrays[name], array.dtype, array.shape)
        if not np.isfinite(arrays[name]).all():
            raise ValueError(f"{name} is not finite")
    for name, kind in WINDOWS.items():
        _check_like(name, arrays[name], kind, (arrays[name].size,))
    place: Any = rows.replay(arrays["episodes"], arrays["ages"], arrays["actions"], periods // model.n_envs)
    if not np.array_equal(place, arrays["observation"]):
        raise ValueError("its episodes do not come to the same observations here")
    model._last_obs, model._last_episode_starts = place, arrays["ages"] == 0
    for name, array in live.items():
        array[...] = arrays[name]
    returns, lengths, rms_m = (arrays[name] for name in WINDOWS)
    last = [{"r": r, "l": length} for r, length in zip(returns, lengths)]
    model.ep_info_buffer, model.ep_success_buffer = (deque(own, model._stats_window_size) for own in (last, []))
    rows.rms_m.extend(rms_m.tolist())
    of_torch, of_numpy, drawn = (arrays[name] for name in GENERATORS)
    torch.set_rng_state(torch.from_numpy(of_torch))
    _check_like(GENERATORS[1], of_numpy, np.uint32, (624,))
    if not 0 <= drawn[0] <= len(of_numpy):
        raise ValueError(f"{GENERATORS[2]} = {drawn}: must be at most {len(of_numpy)}")
    np.random.set_state(("MT19937", of_numpy, int(drawn[0]), int(drawn[1]), float(drawn[2])))


def _live_arrays(model: PPO) -> dict[str, np.ndarray]:
    """Everything that is restored in place, by name; none is a copy."""
    rows, policy = _rows_of(model), model.policy
    arrays = {f"policy.{name}": tensor.numpy() for name, tensor in policy.state_dict().items()}
    for i, weight in enumerate(policy.parameters()):
        moments = policy.optimizer.state.get(weight, {})
        arrays |= {f"optimizer.{i}.{name}": tensor.numpy() for name, tensor in moments.items()}
    arrays |= {f"errors.{i}": sums for i, sums in enumerate(rows.error_sums())}
    return arrays | {"episodes": rows.episodes, "ages": rows.episode_lengths, "returns": rows.episode_returns}


def _rows_of(model: PPO) -> ReplayableRows:
    rows = model.get_env()
    if not isinstance(rows, ReplayableRows):
        raise TypeError("a checkpoint needs ReplayableRows")
    return rows


def _check_like(name: str, array: np.ndarray, kind: Any, shape: tuple[int, ...]) -> None:
    if array.dtype != kind or array.shape != shape:
        raise ValueError(f"{name} is {array.dtype} of shape {array.shape}: must be {np.dtype(kind)} of shape {shape}")


def check_finite(model: Any) -> None:
    """Raise ValueError unless all weights of a model of stable-baselines3 are finite."""
    if not all(bool(torch.isfinite(weights).all()) for weights in model.policy.parameters()):
        rate, entropy = model.lr_schedule(1.0), model.ent_coef
        raise ValueError(
            f"training diverged after {model.num_timesteps:,} periods: its weights are not finite; take a smaller"
            f" learning_rate than {rate:g} (or entropy than {entropy:g}) and begin anew"
        )


class Watch(BaseCallback):
    """Progress and checkpoints: one every `checkpoint_steps` and, by `save`, that of the last update.

    Args:
        folder: for checkpoints.
        steps: of the whole training.
        checkpoint_steps: between two checkpoints.
        facts: what a training must share to go on from them.
        report: is called with steps done, all of them and how it goes.
        held_out: gives a network's lead by trade-off; None: no learning curve.
        points: of the learning curve, besides the last.
    """

    def __init__(
        self,
        folder: Path,
        steps: int,
        checkpoint_steps: int,
        facts: dict[str, dict[str, Any]],
        report: Callable[[int, int, str], Any],
        held_out: HeldOut | None = None,
        points: int = 1,
    ) -> None:
        super().__init__()
        self._path, self._steps, self._checkpoint_steps = folder / CHECKPOINT, steps, checkpoint_steps
        self._facts, self._report, self._held_out = facts, report, held_out
        self._told_at = steps * np.geomspace(EARLIEST, 1.0, points + 1)[:-1]
        self._taken: tuple[dict[str, np.ndarray], dict[str, Any]] | None = None

    def save(self) -> None:
        """Write the checkpoint of the last update."""
        if self._taken is not None:
            arrays, facts = self._taken
            write_checkpoint(self._path, arrays, facts | self._facts)
            self._saved = facts["periods"]

    def _take(self) -> None:
        model = self.model
        assert isinstance(model, PPO)
        check_finite(model)
        self._taken = take_checkpoint(model)

    def _on_training_start(self) -> None:
        self._saved = self.num_timesteps

    def _evaluate(self) -> None:
        """Log the lead over the best rule, with the rollout to come."""
        assert self._held_out is not None and isinstance(self.model, PPO)
        for lam, lead in self._held_out(actor_network(self.model)).items():
            self.logger.record(f"{HELD_OUT}{lam:g}", lead.mean)
            self.logger.record(f"{HELD_OUT}{lam:g}_se", lead.error)

    def _on_rollout_start(self) -> None:
        model = self.model
        assert isinstance(model, PPO)
        due = (self._told_at > self.num_timesteps - model.n_steps * model.n_envs) & (
            self._told_at <= self.num_timesteps
        )
        if self._held_out is not None and due.any():
            self._evaluate()
        self._take()
        if self.num_timesteps - self._saved >= self._checkpoint_steps:
            self.save()

    def _on_training_end(self) -> None:
        self._take()
        if self._held_out is not None:
            self._evaluate()
            self.logger.record("time/total_timesteps", self.num_timesteps)
            self.logger.dump(self.num_timesteps)

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        model = self.model
        assert isinstance(model, PPO)
        rms, error = mean_and_error(_rows_of(model).rms_m)
        self.logger.record("rollout/episode_rms_m", rms)
        self.logger.record("rollout/episode_rms_se_m", error)
        rewards = [info["r"] for info in self.model.ep_info_buffer or ()]
        self.logger.record("rollout/ep_rew_se", mean_and_error(rewards)[1])
        self._report(min(self.num_timesteps, self._steps), self._steps, f"training, RMS {rms:.2f} m")


def mean_and_error(values: Collection[float]) -> tuple[float, float]:
    """Of some numbers their mean and its standard error; NaN where there are too few."""
    numbers = np.array(values, dtype=float)
    mean = float(numbers.mean()) if len(numbers) else float("nan")
    return mean, float(numbers.std(ddof=1) / np.sqrt(len(numbers))) if len(numbers) > 1 else float("nan")
