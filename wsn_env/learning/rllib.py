"""PPO through RLlib: train.py's network, rewards and fields, with a native batch in every runner of a Ray cluster."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import ray
import torch
from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.core.columns import Columns
from ray.rllib.core.rl_module.apis.value_function_api import ValueFunctionAPI
from ray.rllib.core.rl_module.rl_module import RLModuleSpec
from ray.rllib.core.rl_module.torch import TorchRLModule
from ray.tune.registry import register_env

from wsn_env.evaluation.progress import Progress
from wsn_env.evaluation.ray_engine import connect, join_driver, send_own_code, software
from wsn_env.learning.actor_critic import EntryActorCritic
from wsn_env.learning.checkpoint_file import (
    pack,
    read_checkpoint,
    refuse_executable,
    unpack,
    unsuitable,
    write_checkpoint,
)
from wsn_env.learning.native_runner import NativeRunner
from wsn_env.learning.network import EntryNetwork

RAY_CHECKPOINT = "ray.safetensors"
OLD_RAY_CHECKPOINT = "ray"
FIRST_S = 900.0  # a rollout may take so long: runners compile their kernels in the first


class EntryModule(TorchRLModule, ValueFunctionAPI):
    """An EntryActorCritic; model_config["entries"] are its arguments."""

    def setup(self) -> None:
        """Make the network."""
        config: Any = self.model_config
        self.net: EntryActorCritic = EntryActorCritic(**config["entries"])

    def _forward(self, batch: dict[str, Any], **kwargs: Any) -> dict[str, Any]:
        return {Columns.ACTION_DIST_INPUTS: self.net.forward_actor(batch[Columns.OBS])}

    def compute_values(self, batch: dict[str, Any], embeddings: Any | None = None) -> torch.Tensor:
        """(B,) of the critic."""
        return self.net.forward_critic(batch[Columns.OBS]).squeeze(-1)


class _OwnSeeds(gym.vector.VectorWrapper):
    """RLlib seeds runner w with seed + w, and rows take seed + i: the runners would meet nearly the same fields."""

    def __init__(self, envs: gym.vector.VectorEnv, first: int) -> None:
        super().__init__(envs)
        self._first = first

    def reset(
        self, *, seed: int | list[int] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Row i of runner w gets first + w rows + i; seeds of single rows stay."""
        own: Any = (
            seed if seed is None or isinstance(seed, list) else self._first + (seed - self._first) * self.num_envs
        )
        return self.env.reset(seed=own, options=options)


class RayTraining:
    """PPO on a Ray cluster, from its last checkpoint where there is one; a context, which stops what it has started.

    Args:
        make_rows: how many -> native vector environment in disabled autoreset mode, with the training's rewards.
        entries: arguments of EntryActorCritic.
        folder: of the checkpoint.
        steps: of the whole training.
        facts: what it must share with the checkpoint that it goes on from.
        rows: over all runners.
        runners: processes that step environments, a core each; 0: none but this one.
        rollout: periods of each row between two updates.
        seed: of training.
        address: of a running cluster; None: one on this machine.
        training: more of RLlib's `training`: lr, gamma, ...
    """

    def __init__(  # noqa: PLR0913
        self,
        make_rows: Callable[[int], gym.vector.VectorEnv],
        entries: dict[str, Any],
        folder: Path,
        *,
        steps: int,
        facts: dict[str, dict[str, Any]],
        rows: int,
        runners: int,
        rollout: int,
        seed: int,
        address: str | None = None,
        **training: Any,
    ) -> None:
        self.periods: int = 0
        self._path, self._steps = folder / RAY_CHECKPOINT, steps
        self._facts = facts | {"version": facts["version"] | {"ray": ray.__version__}}
        refuse_executable(folder / OLD_RAY_CHECKPOINT, self._path)
        saved = read_checkpoint(self._path, self._facts) if self._path.exists() else None
        connect(address)
        send_own_code(ray)
        here, ours = os.getcwd(), software()

        def make(context: Any) -> gym.vector.VectorEnv:
            join_driver(here, ours)
            return _OwnSeeds(make_rows(context["num_envs"]), seed)

        register_env("wsn_env", make)
        each = rows // max(runners, 1)
        batch = rollout * each * max(runners, 1)
        self._most = steps + batch
        self._algorithm = (
            PPOConfig()
            .environment("wsn_env")
            .env_runners(
                env_runner_cls=NativeRunner,
                num_env_runners=runners,
                num_envs_per_env_runner=each,
                gym_env_vectorize_mode="vector_entry_point",
                rollout_fragment_length=rollout,
                sample_timeout_s=FIRST_S,
            )
            .fault_tolerance(restart_failed_env_runners=True)
            .training(
                train_batch_size_per_learner=batch,
                use_kl_loss=False,
                vf_clip_param=float("inf"),
                clip_param=0.2,
                vf_loss_coeff=0.5,
                grad_clip=0.5,
                **training,
            )
            .rl_module(rl_module_spec=RLModuleSpec(module_class=EntryModule, model_config={"entries": entries}))
            .debugging(seed=seed, log_level="ERROR")
        ).build_algo()
        if saved is not None:
            try:
                self._restore(*saved)
            except BaseException:
                self.__exit__()
                raise

    def __enter__(self) -> RayTraining:
        return self

    def __exit__(self, *_: object) -> None:
        self._algorithm.stop()
        ray.shutdown()

    def _restore(self, arrays: dict[str, np.ndarray], facts: dict[str, Any]) -> None:
        periods = facts.get("periods")
        try:
            if type(periods) is not int or not 0 <= periods < self._most:
                raise ValueError(f"periods = {periods!r}: must be below {self._most}")
            self._algorithm.set_state(unpack(arrays, facts["state"]))
        except Exception as problem:  # RLlib looks into the state here and there
            raise unsuitable(self._path, problem) from None
        self.periods = periods

    def run(self, checkpoint_steps: int, progress: Progress) -> None:
        """Train to the end; a checkpoint every `checkpoint_steps`, and whatever ends it."""
        saved = self.periods
        try:
            while self.periods < self._steps:
                result = self._algorithm.train()
                self.periods = int(result["num_env_steps_sampled_lifetime"])
                # Without "env_runners": all of them were lost, or late; they sample in the next turn.
                reward = result.get("env_runners", {}).get("episode_return_mean", float("nan"))
                progress(min(self.periods, self._steps), self._steps, f"training, reward {reward:.1f}")
                if self.periods - saved >= checkpoint_steps:
                    self._save()
                    saved = self.periods
        finally:
            self._save()

    def _save(self) -> None:
        arrays, state = pack(self._algorithm.get_state())
        write_checkpoint(self._path, arrays, {"periods": self.periods, "state": state} | self._facts)

    def actor_network(self) -> EntryNetwork:
        """The actor as NumPy arrays."""
        module: Any = self._algorithm.get_module()
        return module.net.actor_network()
