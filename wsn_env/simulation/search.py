"""The search for a lost target: every living node wakes for the period, and those that detect it tell where it is."""

from typing import Any

import numpy as np

from wsn_env.compiled.kernels import lean_kernel, lean_piece
from wsn_env.models.association.base import is_of_target
from wsn_env.models.measurement.base import node_at, signal, tells
from wsn_env.models.radio.base import reception
from wsn_env.models.state import state_at
from wsn_env.simulation import messages
from wsn_env.simulation.faults import what_is_sensed
from wsn_env.simulation.messages import Episode
from wsn_env.simulation.sensing import is_awake, sense
from wsn_env.simulation.truth import target_of
from wsn_env.simulation.unnamed import in_doubt
from wsn_env.simulation.unnamed_search import best_supported, list_strange, mark_supported, nearest_of_target


@lean_kernel
def search(
    start: int, stop: int, cs: Any, rows: np.ndarray, found: Any, outcomes: np.ndarray, handle: np.ndarray
) -> None:
    """Every living node wakes for the period; the belief's position restarts at the centroid of those that detect.

    Args:
        rows: (B,) bool, where.
        found: (B,) bool, set where a node was heard.
    """
    state, c = state_at(handle), cs[0]
    for b in range(start, stop):
        if not rows[b]:
            continue
        out = outcomes[b]
        out.searched = True
        state.row[b].last_search = state.row[b].period
        episode = Episode(state, b, out, b - b % c.targets, c.targets)
        strange = in_doubt(episode, c)
        if strange:  # the list is of use from here on
            state.reports.count[b] = 0
        strongest = _wake_all(episode, rows, found, c)
        if strongest >= 0:
            # The new head takes over (the velocity is handed to it) and hears the others.
            if c.radio.to_head and messages.take_over(strongest, episode, c.radio):
                out.handover = True
            out.detections = 0
            before = state.reports.count[b]
            state.reports.count[b] = 0
            state.reports.bitmap[b] = 0  # all are asked, and silence means 0
            target = target_of(state, b)
            for node in range(state.network.battery.shape[1]):
                sense(node, strongest, messages.SEARCH, target, episode, c)
            if strange:
                mark_supported(strongest, rows, found, episode, c)
            found[b] = _restart_at_centroid(state, b, c)
            if not found[b]:  # nothing has come: all is as it was
                state.reports.count[b] = before
            elif not c.radio.to_head:
                leader = nearest_of_target(episode) if strange else _strongest_heard(episode, c)
                messages.take_over(leader, episode, c.radio)
        else:  # asked, all keep silent
            state.sensed[b] = 0
            state.reports.bitmap[b] = 0


@lean_piece
def _wake_all(episode, rows, found, c):
    """Wake-up call to all, sensing by those that slept.

    Args:
        rows, found: (B,) bool, which search, and which of them have found theirs.

    Returns: the living node with the strongest signal of the target, the first by number where signals are alike; -1:
    nobody detects it.
    """
    state, b, out = episode.state, episode.b, episode.out
    network, standing = state.network, state.network.row[b]
    positions, residual_j, members = network.positions[b], state.residual_j[b], network.members[b]
    target = target_of(state, b)
    call = reception(c.radio, c.radio.wakeup_bits)
    strange, strongest, best, j, count = in_doubt(episode, c), -1, -np.inf, 0, 0
    out.members = 0
    for node in range(len(residual_j)):
        while j < standing.n_members and members[j] < node:
            j += 1
        awake = node == standing.head or (j < standing.n_members and members[j] == node)
        if network.battery[b, node] <= 0.0:
            continue
        # Of those that are dead, unknown to the network, it reckons with the same: it cannot tell them from others.
        living = residual_j[node] > 0.0
        for row in range(episode.first, episode.first + episode.targets):
            awake |= row != b and (is_awake(node, network, row) or (row < b and rows[row]))
        woken = messages.spend(node, call, messages.SEARCH, episode) and living
        if not awake:
            living = residual_j[node] > 0.0
            woken = messages.spend(node, c.radio.awake_j, messages.SEARCH, episode) and living
        if not woken:
            continue
        out.members += 1
        sensor = node_at(positions, node)
        if residual_j[node] > 0.0 and strange:
            count = list_strange(sensor, count, rows, found, episode, c)
            continue
        occasion, x, y = what_is_sensed(state, b, sensor, True, target, c)
        if residual_j[node] > 0.0 and tells(c.measurement, occasion, sensor, x, y, c):
            strength = signal(c.measurement, occasion, sensor, x, y)
            if strength > best:
                strongest, best = node, strength
    return best_supported(count, episode, c) if strange else strongest


@lean_piece
def _strongest_heard(episode, c):
    """Of those that a sink has heard the one with the strongest signal, the first by number where signals are alike."""
    state, b = episode.state, episode.b
    target = target_of(state, b)
    strongest, best = np.int64(-1), -np.inf
    for k in range(state.reports.count[b]):
        node: Any = np.int64(state.reports.node[b, k])
        sensor = node_at(state.network.positions[b], node)
        occasion, x, y = what_is_sensed(state, b, sensor, True, target, c)
        strength = signal(c.measurement, occasion, sensor, x, y)
        if strength > best:
            strongest, best = node, strength
    return strongest


@lean_piece
def _restart_at_centroid(state, b, c):
    """Position belief about the centroid of the nodes heard of the target, sd r_s / sqrt(n); the velocity's stays.
    Returns whether any was."""
    reports, positions = state.reports, state.network.positions[b]
    heard, x, y = 0, 0.0, 0.0
    for k in range(reports.count[b]):
        if is_of_target(reports, b, k):
            heard, x, y = heard + 1, x + positions[reports.node[b, k], 0], y + positions[reports.node[b, k], 1]
    if heard == 0:
        return False
    mean, cov = state.belief.row[b].mean, state.belief.row[b].cov
    mean[0], mean[2] = x / heard, y / heard
    for axis in (0, 2):
        for other in range(4):
            cov[axis, other] = 0.0
            cov[other, axis] = 0.0
    cov[0, 0] = cov[2, 2] = c.radius_m * c.radius_m / heard
    state.row[b].log_miss = 0.0
    return True
