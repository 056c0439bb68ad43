"""Rewards: minus (error + lam * energy), in metres."""

from functools import partial

import numpy as np

from wsn_env.quantity import suggest

DISBELIEF = 3.0  # a true error so many times the believed one is no accident


def error_cost(outcome):
    """The mission's: the distance between estimate and target [m]."""
    return outcome["error_m"]


def belief_cost(outcome):
    """The error that the belief expects, of much lower variance; the true one where the belief is plainly wrong [m].

    For training only.
    """
    wrong = outcome["error_m"] > DISBELIEF * outcome["posterior_rms_m"]
    return np.where(wrong, outcome["error_m"], outcome["believed_error_m"])


REWARDS = {"error": error_cost, "belief": belief_cost}


def make_reward(name: str):
    """reward(outcome, lam) for one of REWARDS; `outcome` has the fields of OUTCOME by name, arrays or numbers.

    Raises:
        ValueError: for an unknown name.
    """
    if name not in REWARDS:
        raise ValueError(f"reward {name!r} is unknown: {suggest(name, REWARDS)}")
    return partial(_reward, REWARDS[name])


def _reward(cost, outcome, lam):
    return -(cost(outcome) + lam * outcome["energy_mj"])
