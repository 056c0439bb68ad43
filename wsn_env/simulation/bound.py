"""A lower bound on the error of any tracker: the posterior Cramer-Rao bound of a policy in a scenario.

Whatever computes with all reports that a policy gets,

    E |estimate(k) - target(k)|^2  >=  trace of the position part of J(k)^-1
    J(k) = (F J(k-1)^-1 F' + q^2 G G')^-1 + E[sum over the awake nodes of I]

(Tichavsky, Muravchik & Nehorai, 1998, eq. 21), with I the Fisher information of an awake node about the position: of
whether it detects, and of what it then measures (`DetectionRule.information`). The expectation is over tracks, fields,
noise and, as a policy chooses by what it has heard, schedules; here it is the mean over the episodes played. Since the
first belief is known, the mean may be taken along and across its velocity. J(0) is the information of P0 and of the
start's own covariance together. A lost report counts as if it had arrived: its sender's battery may tell of it later.

It is a bound where the recursion's suppositions are the world's, and only there (`why_no_bound`).
"""

from __future__ import annotations

import numpy as np

from wsn_env.compiled.kernels import lean_kernel, lean_piece, over_rows
from wsn_env.models.detection.base import information
from wsn_env.models.measurement.base import node_at, value_information
from wsn_env.models.state import Outcome, State, state_at
from wsn_env.scenario import Scenario
from wsn_env.scenario.constants import constants


def why_no_bound(scenario: Scenario) -> str | None:
    """What of a scenario leaves it without a bound, and what is allowed; None: it has one."""
    motion, detection, measurement = scenario.motion, scenario.detection, scenario.measurement
    if motion.start_sds is None or motion.process_noise_ms2 is None or motion.bounded:
        return f"Scenario.motion = {type(motion).__name__}: its law is not normal; allowed is motion='free'"
    if not measurement.gaussian:
        kind = type(measurement).__name__
        return f"Scenario.measurement = {kind}: its noise is not normal and constant; allowed are others"
    if not detection.regular:
        return f"Scenario.detection = {detection}: its probability jumps at an edge; allowed is a softer one"
    if scenario.tracking.start != "known":
        return f"Tracking.start = {scenario.tracking.start!r}: allowed is 'known', whose error is normal"
    if scenario.tracking.search:
        return "Tracking.search = True: the choice of a head tells of strengths; allowed is False"
    if scenario.ends_outside:
        return "Scenario.ends_outside = True: the mean is over the whole horizon; allowed is False"
    if scenario.faults:
        return f"Scenario.faults = {scenario.faults}: reports are not of the target alone; allowed is ()"
    if scenario.unscored:
        return f"Scenario.unscored = {scenario.unscored}: the mean is over the whole horizon; allowed is 0"
    return None


class Bound:
    """The bound of a policy, from the episodes that it plays: `begin` and `advance` as they go, then `rms_m`.

    Every `begin` starts a block of episodes; between blocks the standard error is estimated.
    """

    def __init__(self, scenario: Scenario, threads: int = 1) -> None:
        """Prepare.

        Raises:
            ValueError: where it would be no bound.
        """
        if why := why_no_bound(scenario):
            raise ValueError(why)
        self._scenario, self._constants, self._threads = scenario, constants(scenario), threads
        self._sums: list[np.ndarray] = []  # (periods, 3) of each block: along, across, along times across [1/m^2]
        self._episodes: list[int] = []  # of each block

    def begin(self, state: State) -> None:
        """New episodes, in period 0."""
        velocity = state.belief.row["mean"][:, [1, 3]]
        self._along = velocity / np.maximum(np.hypot(*velocity.T), 1e-12)[:, None]
        self._episodes.append(state.rows)
        self._sums.append(np.zeros((self._scenario.periods, 3)))

    def advance(self, state: State, outcome: Outcome) -> None:
        """One period of all of them; `state` is that after it.

        Raises:
            ValueError: when a node has died: who was awake is then no longer known.
        """
        if (outcome.alive < self._scenario.field.nodes).any():
            radio = self._scenario.radio
            what = f"{type(radio).__name__}.battery_j = {radio.battery_j}"
            raise ValueError(f"{what}: a node died; the bound needs batteries that last")
        found = np.empty((state.rows, 3))
        args = self._constants, outcome.row, state.handle, self._along, found
        over_rows(_information_of_awake, state.rows, self._threads, *args)
        self._sums[-1][state.row["period"][0] - 1] += found.sum(axis=0)

    def per_period_m(self) -> np.ndarray:
        """(periods,) root of the least mean square error in each period [m]."""
        return self._recursion(np.sum(self._sums, axis=0) / sum(self._episodes))

    def rms_m(self) -> float:
        """Root mean square over the periods [m]: no tracker's root mean square error is lower."""
        return float(np.sqrt(np.mean(self.per_period_m() ** 2)))

    def stderr_m(self) -> float:
        """Standard error of `rms_m`, by leaving out one block after the other; NaN with a single block [m]."""
        blocks, whole, episodes = len(self._sums), np.sum(self._sums, axis=0), sum(self._episodes)
        rest = [
            np.sqrt(np.mean(self._recursion((whole - own) / (episodes - count)) ** 2))
            for own, count in zip(self._sums, self._episodes, strict=True)
            if episodes > count
        ]
        return float(np.sqrt((blocks - 1) * np.var(rest))) if len(rest) > 1 else float("nan")

    def _recursion(self, informations: np.ndarray) -> np.ndarray:
        """(periods,) with these mean informations (periods, 3)."""
        t, q = self._scenario.period_s, self._scenario.track_q
        f, g = np.kron(np.eye(2), [[1.0, t], [0.0, 1.0]]), np.kron(np.eye(2), [[t * t / 2], [t]])
        tracking, own = self._scenario.tracking, self._scenario.motion.start_sds
        sds = np.array([[tracking.start_sd_m, tracking.start_sd_ms], own])
        cov = np.diag(np.tile(1.0 / (sds**-2.0).sum(axis=0), 2))
        squares = []
        for along, across, both in informations:
            cov = f @ cov @ f.T + q * q * (g @ g.T)
            found = np.zeros((4, 4))
            found[np.ix_([0, 2], [0, 2])] = (along, both), (both, across)
            cov = np.linalg.solve(np.eye(4) + cov @ found, cov)
            squares.append(cov[0, 0] + cov[2, 2])
        return np.sqrt(squares)


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
                one = _information_of_node(node_at(network.positions[b], node), x, y, c)
                xx, xy, yy = xx + one[0], xy + one[1], yy + one[2]
        s, t = along[b]
        found[b, 0] = s * s * xx + 2.0 * s * t * xy + t * t * yy
        found[b, 1] = t * t * xx - 2.0 * s * t * xy + s * s * yy
        found[b, 2] = s * t * (yy - xx) + (s * s - t * t) * xy


@lean_piece
def _information_of_node(node, x, y, c):
    """xx, xy and yy of an awake node [1/m^2]."""
    dx, dy = x - node.x, y - node.y
    squared = max(dx * dx + dy * dy, 1e-12)
    value, radial = information(c.detection, c.measurement, np.sqrt(squared))
    xx, xy, yy = value_information(c.measurement, node, x, y)
    radial /= squared
    return value * xx + radial * dx * dx, value * xy + radial * dx * dy, value * yy + radial * dy * dy
