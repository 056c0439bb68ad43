"""The score of a policy from any toolkit, on the episodes of `evaluate`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from gymnasium.vector import VectorEnv

from wsn_env.envs.vector_env import ClusterVectorEnv
from wsn_env.evaluation.native_envs import NATIVE, unwrap_native
from wsn_env.evaluation.rollout import evaluation_seeds
from wsn_env.models.quantity import short


def score(act: Callable[[Any], Any], envs: VectorEnv, seed: int = 0) -> np.ndarray:
    """Play one whole episode in every row: the first B of `evaluate(..., seed=seed)`, so that both are paired.

    The reward of the environment and of its wrappers plays no part: a return is -sum(error + lam * energy), of the true
    error.

    Args:
        act: observations of all rows -> their actions, called once a period. It may keep a memory: all rows begin and
            end together.
        envs: the native vector environment in any autoreset mode, wrapped or not; its B rows are the episodes.
        seed: of the evaluation.

    Returns: (B,).
    """
    unwrapped = getattr(envs, "unwrapped", envs)
    if not isinstance(unwrapped, ClusterVectorEnv):
        raise ValueError(f"envs = {type(unwrapped).__name__}: must be {NATIVE}")
    if not callable(act):
        raise ValueError(f"act = {short(repr(act))}: must be a function of the observations of all rows")
    if unwrap_native(envs).scenario.ends_outside:
        raise ValueError(
            "Scenario.ends_outside = True: must be False here, where all rows end together; use `evaluate`"
        )
    seeds: Any = evaluation_seeds(seed, envs.num_envs)  # the native environment takes a seed for each row
    observations, _ = envs.reset(seed=seeds)
    lam, scenario = unwrap_native(envs).lam.copy(), unwrap_native(envs).scenario
    errors, energies = np.zeros((2, envs.num_envs))
    for _ in range(scenario.periods):
        observations, _, _, _, info = envs.step(act(observations))
        info = info.get("final_info", info)  # same-step mode has begun the next episodes by now
        errors += scenario.counted_m(info["error_m"])
        energies += info["energy_mj"]
    return -(errors + lam * energies)
