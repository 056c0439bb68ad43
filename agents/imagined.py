"""Worlds drawn from what a network believes, for a planner to try its choices in.

Nothing of the truth enters: not the track, and not the key that the real detections and noises come from.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import uint64

from wsn_env.compiled import draws
from wsn_env.compiled.kernels import kernel, lean_piece, piece
from wsn_env.filters.kernels import redraw_row
from wsn_env.filters.resampling import correlated, lower_root
from wsn_env.models.measurement.base import PositionBelief, at_point, linearise, node_at, unwrap
from wsn_env.models.motion.modes import advance_in_mode, mode_at, next_mode
from wsn_env.models.motion.prediction import advance
from wsn_env.models.state import Belief, Network, Reports, State, knowledge_at, state_at
from wsn_env.scenario import Scenario
from wsn_env.scenario.constants import constants
from wsn_env.simulation.view import View
from wsn_env.simulation.world import World


def imagined_world(scenario: Scenario, periods: int, particles: int) -> World:
    """The scenario with another horizon, a cheap filter at the head, a target that moves as the filter supposes, and no
    faults, of which the network knows nothing; prices and noises are the same.

    Args:
        particles: of a particle filter; 0: a `GaussianTracker`, which cannot read binary sensors.
    """
    changes: dict[str, Any] = dict(periods=periods, motion="straight", faults=None, association="known", targets=1)
    changes |= dict(tracker="particle", particles=max(particles, 2), gate_m=None)
    if not scenario.tracking.switches:
        changes |= dict(filter_q=scenario.filter_q, manoeuvre_q=None)
    if scenario.radio.handover == "particles":  # as many as there really are
        changes |= dict(handover="estimate", handover_bits=scenario.handover_bits)
    world = World(scenario.override(**changes), threads=1)
    if particles == 0:
        world.tracker = GaussianTracker(scenario)
    return world


def draw_worlds(state: State, view: View, world: World, first: int, count: int) -> None:
    """Fill a state with worlds number first, ..., first + count - 1, drawn from a belief, again and again.

    The target comes from the belief's mean and covariance (eqs. 9-13 of Xiang & Guo, 2013, say what these are). It
    switches between the filter's modes of motion, from one that the belief's probabilities give; where the filter has
    none, it moves by constant velocity with its noise (eq. 8). Worlds 2i and 2i + 1 lie on opposite sides of the mean
    and share their modes. A world's draws depend on its number and the view's `random_bits` alone.

    Args:
        state: (n * count rows) filled; row b is world first + b % count.
        view: of one row.
        world: of the `imagined_world`.
    """
    scenario, tracking = world.scenario, world.scenario.tracking
    motion = scenario.period_s, scenario.filter_q, tracking.manoeuvre_q or 0.0
    _draw_worlds(first, count, motion, tracking.search_gap, state.handle, view.knowledge.handle)


@kernel
def _draw_worlds(first, count, motion, search_gap, handle, knowledge_handle):
    period_s, q, manoeuvre_q = motion
    state, known = state_at(handle), knowledge_at(knowledge_handle)
    row, belief, bitmap = known.row[0], known.belief[0], known.reports.bitmap[0]
    for b in range(len(state.key)):
        number = first + b % count
        key, pair = _world_key(row.random_bits, number), _world_key(row.random_bits, number - number % 2)
        state.key[b] = key
        mine, own = state.row[b], state.belief.row[b]
        mine.period = 0
        mine.lam = row.lam
        mine.log_miss = row.log_miss
        mine.last_search = -search_gap  # of an earlier one the view as an observation says nothing
        own.mean[:], own.cov[:] = belief.mean, belief.cov
        own.predicted_mean[:], own.predicted_cov[:] = belief.predicted_mean, belief.predicted_cov
        if state.belief.particles.shape[2] > 0:
            redraw_row(key, 0, state.belief, b)
            for i in range(state.belief.modes.shape[1]):
                share = draws.uniform(draws.stream(key, 0, draws.RESAMPLING), i)
                state.belief.modes[b, i] = mode_at(share, belief.mode_probabilities)
        own.mode_probabilities[:] = belief.mode_probabilities
        _copy_network(known.network, state, b)
        state.reports.count[b] = 0
        state.reports.bitmap[b] = bitmap
        state.sensed[b] = bitmap

        side = 1.0 if number % 2 == 0 else -1.0
        track, off = state.track[b], correlated(draws.stream(pair, 0, draws.START), 0, lower_root(own.cov))
        for axis in range(4):
            track[0, axis] = own.mean[axis] + side * off[axis]
        switches = draws.stream(pair, 0, draws.PROCESS)
        mode = mode_at(draws.uniform(switches, 0), belief.mode_probabilities)
        for k in range(len(track) - 1):
            ax, ay = draws.normal_pair(draws.stream(pair, 0, draws.TRACK), k)
            if manoeuvre_q > 0.0:
                advance_in_mode(
                    mode, track[k], period_s, side * manoeuvre_q * ax, side * manoeuvre_q * ay, track[k + 1]
                )
                mode = next_mode(mode, draws.uniform(switches, 1 + 2 * k), draws.uniform(switches, 2 + 2 * k))
            else:
                advance(track[k], period_s, side * q * ax, side * q * ay, track[k + 1])


@lean_piece
def _world_key(random_bits, number):
    return draws.mix((uint64(random_bits) << uint64(32)) + uint64(number))


@piece
def _copy_network(network, state, b):
    """Batteries, taken for what they are known to be, and the standing cluster; the rest has its place once
    `place_nodes` has been."""
    copy = state.network
    standing, count = copy.row[b], network.row[0].n_members
    standing.alive = network.row[0].alive
    standing.head = network.row[0].head
    standing.n_members = count
    copy.battery[b] = network.battery[0]
    state.residual_j[b] = network.battery[0]
    state.living[b] = network.row[0].alive
    copy.members[b, :count] = network.members[0, :count]


def place_nodes(state: State, view: View) -> None:
    """Put the nodes of all rows where the view of one row has them."""
    state.network.positions[:] = view.positions
    for (_, copy), (_, original) in zip(state.network.grid.leaves(), view.network.grid.leaves()):
        copy[:] = original


class GaussianTracker:
    """An extended Kalman filter, report by report, whose strengths are linearised at the root mean square distance:
    one that is sure to be near would else take a strength for more than it says.

    It stands in for the particle filter where few numbers must do: what it believes has no sampling noise.
    """

    particles = 0

    def __init__(self, scenario: Scenario) -> None:
        if not scenario.measurement.independent:
            raise ValueError("particles = 0: must be at least 2 where nodes report a state")
        self._constants = constants(scenario)

    def start(self, keys: np.ndarray, periods: np.ndarray, rows: np.ndarray, belief: Belief) -> None:
        """Mean and covariance are all there is."""

    def relocate(self, keys: np.ndarray, periods: np.ndarray, rows: np.ndarray, belief: Belief) -> None:
        """The search has set them."""

    def correct(
        self,
        keys: np.ndarray,
        periods: np.ndarray,
        belief: Belief,
        network: Network,
        reports: Reports,
        resampled: np.ndarray,
    ) -> None:
        """Correct the predictions with the reports, in place."""
        _correct_rows(self._constants, belief.row, network.positions, reports.count, reports.node, reports.value)


@kernel
def _correct_rows(cs, beliefs, positions, count, node, value):
    m = cs[0].measurement
    for b in range(len(beliefs)):
        mean, cov = beliefs[b].mean, beliefs[b].cov
        mean[:], cov[:] = beliefs[b].predicted_mean, beliefs[b].predicted_cov
        for j in range(count[b]):
            place = node_at(positions[b], node[b, j])
            for k in range(len(linearise(m, place, at_point(0.0, 0.0)))):
                target = PositionBelief(mean[0], mean[2], cov[0, 0], cov[0, 2], cov[2, 2])
                line = linearise(m, place, target)[k]
                innovation = unwrap(m, value[b, j, k], line.expected) - line.expected
                _correct(mean, cov, line.slope_x, line.slope_y, innovation, max(line.variance, 1e-12))


@lean_piece
def _correct(mean, cov, hx, hy, innovation, r):
    """One number z = hx x + hy y + noise of variance r: P h / (h' P h + r) is the gain."""
    ph = (
        cov[0, 0] * hx + cov[0, 2] * hy,
        cov[1, 0] * hx + cov[1, 2] * hy,
        cov[2, 0] * hx + cov[2, 2] * hy,
        cov[3, 0] * hx + cov[3, 2] * hy,
    )
    s = hx * ph[0] + hy * ph[2] + r
    for i in range(4):
        mean[i] += ph[i] * innovation / s
        for k in range(4):
            cov[i, k] -= ph[i] * ph[k] / s


def take_rows(value: Any, rows: Any) -> Any:
    """Some rows of a View or of a record of arrays: a slice, or their numbers."""
    if isinstance(value, View):
        return View(take_rows(value.knowledge, rows))
    return value.map(lambda array: array[rows])
