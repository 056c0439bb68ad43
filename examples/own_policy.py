"""A policy of your own: the head and the two nodes beside the way that the target is taking.

python examples/own_policy.py
wsn evaluate --policies examples/own_policy.py:Beside examples/own_policy.py:Beside:apart_m=6 nearest2
"""

from dataclasses import dataclass

import numpy as np

import wsn_env
from wsn_env import Cluster, Scenario, View
from wsn_env.agents.base import ViewPolicy


@dataclass(frozen=True)
class Beside(ViewPolicy):
    """Head: the living node nearest to the prediction; members: the nearest one on either side of the target's way.

    All arrays lead with B, the environments of a batch; see View for what a policy may look at.
    """

    apart_m: float = 3.0  # how far beside the predicted position members are looked for
    sees_lam = False  # the choice does not depend on view.lam, so that one play serves every lam

    def act(self, view: View) -> Cluster:
        velocity = view.predicted_mean[:, [1, 3]]
        speed = np.linalg.norm(velocity, axis=1, keepdims=True)
        along = np.where(speed > 1e-9, velocity / np.maximum(speed, 1e-9), [1.0, 0.0])
        across = np.stack([-along[:, 1], along[:, 0]], axis=1)
        members = [self._nearest_to(view, view.prediction + side * self.apart_m * across) for side in (1.0, -1.0)]
        return Cluster(view.nearest_living(), np.stack(members, axis=1).astype(np.int32))

    @staticmethod
    def _nearest_to(view: View, points: np.ndarray) -> np.ndarray:
        """(B,) living nodes."""
        distance = np.linalg.norm(view.positions - points[:, None], axis=2)
        return np.where(view.alive, distance, np.inf).argmin(axis=1)


if __name__ == "__main__":
    scenario = Scenario.named("PreDC-v0", particles=1000)
    policies = {"beside": Beside(scenario), "nearest2": wsn_env.make_policy("nearest2", scenario)}
    evaluation = wsn_env.evaluate(policies, scenario, episodes=20)
    for name in policies:
        print(f"{name}: return {evaluation.values(name, 4.0, 'return').mean():.1f}")
    difference = evaluation.difference("beside", "nearest2", 4.0)
    print(f"beside minus nearest2: {difference.mean:+.1f} [{difference.low:+.1f}, {difference.high:+.1f}]")
