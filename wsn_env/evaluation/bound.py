"""How near a tracker comes to the least error that its reports allow."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wsn_env.evaluation import rollout
from wsn_env.evaluation.intervals import Measured
from wsn_env.evaluation.policies import Policy, named_policies
from wsn_env.models.arguments import checked_but
from wsn_env.scenario import Scenario
from wsn_env.simulation.bound import Bound
from wsn_env.simulation.world import World


class BoundedError(NamedTuple):
    """A policy's error with the scenario's tracker, beside the bound [m]."""

    rms_m: float
    rms_stderr_m: float
    bound_m: float  # no tracker's root mean square error is lower
    bound_stderr_m: float  # the bound's expectations are means over the episodes, too; NaN with fewer than 100


@checked_but("policy", "episodes", "seed")
def error_bound(policy: Policy | str, scenario: Scenario | str, episodes: int = 1000, seed: int = 0) -> BoundedError:
    """Play a policy and bound the error of any tracker with its reports (`simulation/bound.py`).

    Args:
        policy: or its name.
        scenario: motion="free", start="known", search=False, with what else the bound supposes.
        episodes: the bound's expectations are means over them; at least 2.
        seed: which episodes, as of `evaluate`.

    Raises:
        ValueError: where the scenario has no bound, or a node dies.
    """
    scenario = Scenario.of(scenario)
    scenario.check_one_target("a bound")
    (policy,) = named_policies(policy if isinstance(policy, str) else {"policy": policy}, scenario).values()
    world, seeds = World(scenario), rollout.evaluation_seeds(seed, episodes)
    bound, squares = Bound(scenario, world.threads), []
    for first in range(0, len(seeds), rollout.BLOCK):
        block = seeds[first : first + rollout.BLOCK]
        square = np.zeros(len(block))
        for state, outcome in rollout.episodes(policy, world, block, lambda state, _: bound.begin(state)):
            bound.advance(state, outcome)
            square += outcome.error_m**2 / scenario.periods
        squares.append(square)
    rms = Measured.root_mean(np.concatenate(squares))
    return BoundedError(rms.value, rms.stderr, bound.rms_m(), bound.stderr_m())
