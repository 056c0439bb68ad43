"""A lower bound on the error of any tracker: the posterior Cramer-Rao bound of a policy in a scenario.

For all that reports can tell and whatever computes with it,

    E |estimate(k) - target(k)|^2  >=  trace of the position part of J(k)^-1
    J(k) = (F J(k-1)^-1 F' + q^2 G G')^-1 + E[sum over the awake nodes of I]

(Tichavsky, Muravchik & Nehorai, 1998, eq. 21), with I the Fisher information of all that an awake node can tell about
the position: that it detects or keeps silent, and what it then measures (`DetectionRule.information`). The expectation
is over tracks, fields, noise and, as a policy chooses by what it has heard, schedules; here it is the mean over the
episodes played. An estimator knows the first belief, so that the mean may be taken along and across its velocity.

It is a bound where the recursion's suppositions are the world's, and only there (`has_bound`): tracks of nearly
constant velocity from a normal start, never redrawn or reflected; a start known with an error N(0, P0); no search,
whose choice of a head tells of strengths; reports whose errors are independent, of nodes that detect by a law with a
slope. J(0) is the information of P0 and of the start's own covariance together. A lost report counts as if it had
arrived: its sender's battery may tell of it later.
"""

from __future__ import annotations

import numpy as np

from wsn_env.compiled.kernels import lean_kernel, lean_piece, over_rows
from wsn_env.models.detection.base import information
from wsn_env.models.measurement.base import node_at
from wsn_env.models.state import Outcome, State, state_at
from wsn_env.scenario import Scenario
from wsn_env.scenario.constants import constants
from wsn_env.simulation.reference import process_noise, value_information


def has_bound(scenario: Scenario) -> bool:
    """Whether the suppositions of the bound are the scenario's."""
    tracking, motion = scenario.tracking, scenario.motion
    own_law = motion.start_sds is not None and motion.process_noise_ms2 is not None
    reports = scenario.measurement.independent and scenario.detection.regular
    whole = not scenario.ends_outside  # an episode that ends early leaves the mean over the horizon open
    return reports and whole and own_law and tracking.start == "known" and not tracking.search


class Bound:
    """The bound of a policy, from the episodes that it plays: `begin` and `advance` as they go, then `rms_m`."""

    def __init__(self, scenario: Scenario, threads: int = 1) -> None:
        """Prepare.

        Raises:
            ValueError: where it would be no bound.
        """
        if not has_bound(scenario):
            raise ValueError(
                f"scenario = {scenario.name}, motion {type(scenario.motion).__name__}: has no bound; allowed are"
                " a motion with a normal start (motion='free'), start='known', search=False and a measurement whose"
                " errors are independent"
            )
        self._scenario, self._constants, self._threads = scenario, constants(scenario), threads
        self._sums = np.zeros((scenario.periods, 3))  # of information along, across and along times across [1/m^2]
        self._episodes = 0

    def begin(self, state: State) -> None:
        """New episodes, in period 0."""
        velocity = state.belief.row["mean"][:, [1, 3]]
        self._along = velocity / np.maximum(np.hypot(*velocity.T), 1e-12)[:, None]
        self._episodes += state.rows

    def advance(self, state: State, outcome: Outcome) -> None:
        """One period of all of them; `state` is that after it."""
        found = np.empty((state.rows, 3))
        args = self._constants, outcome.row, state.handle, self._along, found
        over_rows(_information_of_awake, state.rows, self._threads, *args)
        self._sums[state.row["period"][0] - 1] += found.sum(axis=0)

    def per_period_m(self) -> np.ndarray:
        """(periods,) root of the least mean square error in each period [m]."""
        t, q = self._scenario.period_s, process_noise(self._scenario)
        f, g = np.kron(np.eye(2), [[1.0, t], [0.0, 1.0]]), np.kron(np.eye(2), [[t * t / 2], [t]])
        tracking, own = self._scenario.tracking, self._scenario.motion.start_sds
        sds = np.array([[tracking.start_sd_m, tracking.start_sd_ms], own])
        cov = np.diag(np.tile(1.0 / (sds**-2.0).sum(axis=0), 2))
        squares = []
        for along, across, both in self._sums / self._episodes:
            cov = f @ cov @ f.T + q * q * (g @ g.T)
            told = np.zeros((4, 4))
            told[np.ix_([0, 2], [0, 2])] = (along, both), (both, across)
            cov = np.linalg.solve(np.eye(4) + cov @ told, cov)
            squares.append(cov[0, 0] + cov[2, 2])
        return np.sqrt(squares)

    def rms_m(self) -> float:
        """Root mean square over the periods [m]: no tracker's root mean square error is lower."""
        return float(np.sqrt(np.mean(self.per_period_m() ** 2)))


@lean_kernel
def _information_of_awake(start, stop, cs, outcomes, handle, along, found):
    """(B, 3) of each row's awake nodes, along and across its direction."""
    state, c = state_at(handle), cs[0]
    for b in range(start, stop):
        network, x, y = state.network, outcomes[b].target_m[0], outcomes[b].target_m[1]
        xx, xy, yy = 0.0, 0.0, 0.0
        for i in range(-1, network.row[b].n_members):
            node = network.members[b, i] if i >= 0 else network.row[b].head
            if node >= 0:
                one = _information_of(node_at(network.positions[b], node), x, y, c)
                xx, xy, yy = xx + one[0], xy + one[1], yy + one[2]
        s, t = along[b]
        found[b, 0] = s * s * xx + 2.0 * s * t * xy + t * t * yy
        found[b, 1] = t * t * xx - 2.0 * s * t * xy + s * s * yy
        found[b, 2] = s * t * (yy - xx) + (s * s - t * t) * xy


@lean_piece
def _information_of(node, x, y, c):
    """xx, xy and yy of an awake node [1/m^2]."""
    dx, dy = x - node.x, y - node.y
    squared = max(dx * dx + dy * dy, 1e-12)
    share, along = information(c.detection, c.measurement, np.sqrt(squared))
    xx, xy, yy = value_information(node, x, y, c)
    sight = along / squared
    return share * xx + sight * dx * dx, share * xy + sight * dx * dy, share * yy + sight * dy * dy
