"""What all policies share: a scenario, and stable-baselines3's predict()."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from wsn_env.models.state import KEEP_CLUSTER, Cluster
from wsn_env.scenario import Scenario
from wsn_env.scenario.sensing import detection_probability
from wsn_env.simulation.view import View

FEW_NODES = 20  # that may all be awake at a time


@dataclass(frozen=True)
class ViewPolicy:
    """Base of the policies: final classes add their parameters as fields and `act`."""

    scenario: Scenario = Scenario()
    sees_lam = True  # False, where a class says so: its choices do not depend on view.lam, and one play serves all lams

    @property
    def fits(self) -> bool:
        """Whether the policy is meant for such scenarios: the comparison after a training leaves out the others."""
        return True

    def act(self, view: View) -> Cluster:
        """Choose the clusters of the next period, for every row."""
        raise TypeError(f"{type(self).__name__} must define act(view)")

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[Any, ...]:
        """stable-baselines3's predict, on environments made with action="cluster", observation="view".

        Args:
            observation: one environment's dict, or a vector environment's.

        Returns: the action (a dict, or a list of dicts for a vector environment), and `state` as given.
        """
        view = View.from_arrays(observation)
        cluster = self.act(view)
        nodes = np.asarray(observation["battery"]).shape[-1]
        chosen = np.zeros((len(cluster.head), nodes), dtype=np.int64)
        rows, slots = np.nonzero(cluster.members >= 0)
        chosen[rows, cluster.members[rows, slots]] = 1
        kept = cluster.head == KEEP_CLUSTER
        chosen[kept] = view.member[kept]
        heads = np.where(cluster.head < 0, view.head, cluster.head)  # -1 keeps the head; before there is one
        heads = np.where(heads < 0, view.nearest_living(), heads)  # the world takes the nearest living node
        heads = np.maximum(heads, 0)
        actions = [{"head": np.int64(head), "members": row} for head, row in zip(heads, chosen)]
        return (actions[0] if np.ndim(observation["battery"]) == 1 else actions), state

    def detection(self, view: View) -> np.ndarray:
        """(B, S) detection probability of the living nodes at the prediction."""
        p = detection_probability(view.distance, self.scenario)
        return np.where(view.alive, p, 0.0)
