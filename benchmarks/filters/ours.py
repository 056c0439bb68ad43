"""The particle filter of wsn_env, as `World.step` calls it: nothing else of a period runs.

The only file of the filter benchmarks that knows how a State is laid out.
"""

import inspect

import numpy as np

from benchmarks.filters.implementation import Absent, Implementation
from benchmarks.filters.problem import MEMBERS, Problem
from wsn_env.simulation.world import World


class Strict(Implementation):
    """Identical bits on every processor, for any batch and any number of threads."""

    batches = True
    options: dict = {}

    def __init__(self, problem: Problem):
        unknown = self.options.keys() - inspect.signature(World).parameters.keys()
        if unknown:
            raise Absent(f"World takes no keyword {min(unknown)}")
        self.world = World(problem.scenario.override(nodes=MEMBERS), threads=1, **self.options)
        self.state = self.world.reset(problem.keys)
        self.state.reports.count[:] = MEMBERS
        self.state.reports.node[:] = np.arange(MEMBERS)
        self.sensors, self.values = (np.moveaxis(a, 1, 0).copy() for a in (problem.sensors, problem.values))
        self.resampled = np.zeros(problem.rows, bool)
        super().__init__(problem)

    def restart(self) -> None:
        """Clouds, weights and the point about which the first sums run."""
        belief = self.state.belief
        belief.particles[:] = self.problem.particles
        belief.log_weights[:] = 0.0
        belief.predicted_mean[:] = self.problem.prior_mean

    def advance(self, period: int) -> None:
        """Period, nodes and reports into the state, and the tracker's step."""
        state = self.state
        state.row["period"] = period + 1
        state.network.positions[:] = self.sensors[period]
        state.reports.value[:] = self.values[period]
        self.world.tracker.correct(
            state.key, state.row["period"].copy(), state.belief, state.network, state.reports, self.resampled
        )
        state.belief.predicted_mean[:] = state.belief.mean

    def estimate(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """As the belief has them."""
        belief = self.state.belief
        return belief.mean, belief.cov, belief.n_eff


class Fast(Strict):
    """The compiler may reorder sums and contract products."""

    options = {"fast": True}
