"""Rewards: minus (error + lam * energy), in metres; or minus each of the two, for learners of several objectives."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Literal

import numpy as np
from gymnasium.spaces import Box

from wsn_env.models.quantity import suggest

RewardName = Literal["error", "belief", "vector"]

DISBELIEF = 3.0  # a true error so many times the believed one is no accident


def error_cost(outcome: Any) -> Any:
    """The mission's: the distance between estimate and target [m]."""
    return outcome["error_m"]


def belief_cost(outcome: Any) -> Any:
    """The error that the belief expects, of much lower variance; the true one where the belief is plainly wrong [m].

    For training only.
    """
    wrong = outcome["error_m"] > DISBELIEF * outcome["posterior_rms_m"]
    return np.where(wrong, outcome["error_m"], outcome["believed_error_m"])


def vector_reward(outcome: Mapping[str, Any], lam: Any) -> np.ndarray:
    """MO-Gymnasium's: [-error in m, -energy in mJ], (..., 2) float32; the weight (1, lam) makes the mission's of it.

    A fresh array at each call, for MO-Gymnasium's wrappers write into it.
    """
    return -np.stack([outcome["error_m"], outcome["energy_mj"]], axis=-1).astype(np.float32)


COSTS: dict[str, Callable[[Any], Any]] = {"error": error_cost, "belief": belief_cost}
VECTOR = "vector"
REWARDS = (*COSTS, VECTOR)


def make_reward(name: RewardName) -> Callable[[Any, Any], Any]:
    """reward(outcome, lam) for one of REWARDS; `outcome` has the fields of OUTCOME by name, arrays or numbers.

    Raises:
        ValueError: for an unknown name.
    """
    if name not in REWARDS:
        raise ValueError(f"reward {name!r} is unknown: {suggest(name, REWARDS)}")
    return vector_reward if name == VECTOR else partial(_reward, COSTS[name])


def reward_space(name: RewardName) -> Box | None:
    """The space of one row's vector reward, as MO-Gymnasium asks for; None for a reward of one number."""
    return Box(-np.inf, 0.0, (2,), np.float32) if name == VECTOR else None


def _reward(cost: Callable[[Any], Any], outcome: Mapping[str, Any], lam: Any) -> Any:
    return -(cost(outcome) + lam * outcome["energy_mj"])
