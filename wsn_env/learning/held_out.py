"""A training's progress on episodes that it never meets: its network against the best rule, at fixed trade-offs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wsn_env.envs.interface import Interface, Settings
from wsn_env.evaluation.comparison import evaluate
from wsn_env.evaluation.policies import Policy
from wsn_env.evaluation.rollout import BLOCK
from wsn_env.learning.network import PolicyNetwork
from wsn_env.models.state import Cluster
from wsn_env.scenario import Scenario
from wsn_env.simulation.view import View

SEED = 9100  # of the episodes; no table is of them
HELD_OUT = "held_out/lam_"  # name in the log, before the trade-off


class Lead(NamedTuple):
    """Return over the best rule's, in percent of its size."""

    mean: float
    error: float  # standard


@dataclass(frozen=True)
class Acting:
    """The network as it is now, as a policy."""

    interface: Interface
    network: PolicyNetwork

    def act(self, view: View) -> Cluster:
        """The most probable action, for every row."""
        return self.interface.most_probable(self.network.logits(self.interface.observation.encode(view)), view)


class HeldOut:
    """The same episodes for every network and for the rules: differences are paired.

    Args:
        scenario: that is trained in.
        settings: of the interface.
        rules: by name; the best at each trade-off is the one with the highest mean return on these episodes.
        lams: the trade-offs [m/mJ].
        episodes: at each.
    """

    def __init__(
        self,
        scenario: Scenario,
        settings: Settings,
        rules: Mapping[str, Policy],
        lams: Sequence[float],
        episodes: int = BLOCK,
    ) -> None:
        self._scenario, self._interface = scenario, Interface(scenario, settings)
        self._lams, self._episodes = lams, episodes
        played = evaluate(dict(rules), scenario, lams, episodes, SEED, progress=None)
        self._best = {lam: played.values(played.ranked(lam)[0], lam, "return") for lam in lams}

    def __call__(self, network: PolicyNetwork) -> dict[float, Lead]:
        """Of a network, by trade-off."""
        policies: dict[str, Policy] = {"network": Acting(self._interface, network)}
        played = evaluate(policies, self._scenario, self._lams, self._episodes, SEED, progress=None)
        leads = {}
        for lam, best in self._best.items():
            percent = 100.0 * (played.values("network", lam, "return") - best) / abs(best.mean())
            leads[lam] = Lead(float(percent.mean()), float(percent.std(ddof=1) / np.sqrt(len(percent))))
        return leads
