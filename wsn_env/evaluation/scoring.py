"""The score of a policy from any toolkit, on the episodes of `evaluate`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import VectorEnv

from wsn_env.envs.env import ClusterEnv
from wsn_env.envs.vector_env import ClusterVectorEnv
from wsn_env.evaluation.native_envs import NATIVE
from wsn_env.evaluation.rollout import evaluation_seeds
from wsn_env.models.quantity import short


def score(act: Callable[[Any], Any], envs: VectorEnv | gym.Env, seed: int = 0) -> np.ndarray:
    """Play one whole episode in every row: the first B of `evaluate(..., seed=seed)`, so that both are paired.

    The reward of the environment and of its wrappers plays no part: a return is -sum(error + lam * energy), of the true
    error.

    Args:
        act: observations of all rows -> their actions, called once a period. It may keep a memory: all rows begin and
            end together. Of a single environment: its observation -> its action.
        envs: the native vector environment in any autoreset mode, wrapped or not; its B rows are the episodes. Or a
            single environment, B = 1.
        seed: of the evaluation.

    Returns: (B,).
    """
    unwrapped = getattr(envs, "unwrapped", envs)
    if not isinstance(unwrapped, (ClusterVectorEnv, ClusterEnv)):
        raise ValueError(f"envs = {type(unwrapped).__name__}: must be {NATIVE}, or a single environment")
    unwrapped.scenario.check_one_target("score")
    if not callable(act):
        raise ValueError(f"act = {short(repr(act))}: must be a function of the observations of all rows")
    if unwrapped.scenario.ends_outside:
        raise ValueError(
            "Scenario.ends_outside = True: must be False here, where all rows end together; use `evaluate`"
        )
    single, rows = isinstance(unwrapped, ClusterEnv), getattr(unwrapped, "num_envs", 1)
    seeds: Any = evaluation_seeds(seed, rows)  # the native environment takes a seed for each row
    observations, _ = envs.reset(seed=seeds[0] if single else seeds)
    lam, scenario = unwrapped.lam.copy(), unwrapped.scenario
    errors, energies = np.zeros((2, rows))
    for period in range(1, scenario.periods + 1):
        observations, _, _, truncated, info = envs.step(act(observations))
        info = info.get("final_info", info)  # same-step mode has begun the next episodes by now
        errors += scenario.counted_m(info["error_m"])
        energies += info["energy_mj"]
        if period < scenario.periods and np.any(truncated):
            raise ValueError(f"envs: truncated after {period} of {scenario.periods} periods: `evaluate` plays them all")
    return -(errors + lam * energies)
