"""Rewards: minus (error + lam * energy), in metres; or minus each of the two, for learners of several objectives.

`counted` is the scenario's `counted_m`: errors count as at most its cap.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Literal

import numpy as np
from gymnasium.spaces import Box

from wsn_env.models.quantity import suggest

Counted = Callable[[Any], Any]
RewardName = Literal["error", "belief", "vector"]

DISBELIEF = 3.0  # a true error so many times the believed one is no accident


def error_cost(outcome: Any, counted: Counted) -> Any:
    """The mission's: the distance between estimate and target [m]."""
    return counted(outcome["error_m"])


def belief_cost(outcome: Any, counted: Counted) -> Any:
    """The error that the belief expects, of much lower variance; the true one where the belief is plainly wrong [m].

    For training only.
    """
    wrong = outcome["error_m"] > DISBELIEF * outcome["posterior_rms_m"]
    return counted(np.where(wrong, outcome["error_m"], outcome["believed_error_m"]))


def vector_reward(counted: Counted, outcome: Mapping[str, Any], lam: Any) -> np.ndarray:
    """MO-Gymnasium's: [-error in m, -energy in mJ], (..., 2) float32; the weight (1, lam) makes the mission's of it.

    A fresh array at each call, for MO-Gymnasium's wrappers write into it.
    """
    return -np.stack([counted(outcome["error_m"]), outcome["energy_mj"]], axis=-1).astype(np.float32)


COSTS: dict[str, Callable[[Any, Counted], Any]] = {"error": error_cost, "belief": belief_cost}
VECTOR = "vector"
REWARDS = (*COSTS, VECTOR)


def make_reward(name: RewardName, counted: Counted) -> Callable[[Any, Any], Any]:
    """reward(outcome, lam) for one of REWARDS; `outcome` has the fields of OUTCOME by name, arrays or numbers.

    Raises:
        ValueError: for an unknown name.
    """
    if name not in REWARDS:
        raise ValueError(f"reward {name!r} is unknown: {suggest(name, REWARDS)}")
    return partial(vector_reward, counted) if name == VECTOR else partial(_reward, COSTS[name], counted)


def reward_space(name: RewardName) -> Box | None:
    """The space of one row's vector reward, as MO-Gymnasium asks for; None for a reward of one number."""
    return Box(-np.inf, 0.0, (2,), np.float32) if name == VECTOR else None


def _reward(cost: Callable[[Any, Counted], Any], counted: Counted, outcome: Mapping[str, Any], lam: Any) -> Any:
    return -(cost(outcome, counted) + lam * outcome["energy_mj"])
