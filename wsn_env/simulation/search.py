"""The search for a lost target: every living node wakes for the period, and those that detect it tell where it is."""

import numpy as np

from wsn_env.compiled.kernels import lean_kernel, lean_piece
from wsn_env.models.physics import radio, sensing
from wsn_env.models.physics.field import squared_distance
from wsn_env.simulation.period import sense, target_of, wake


@lean_kernel
def search(start, stop, cs, rows, found, state, outcome):
    """Every living node wakes for the period; the belief's position restarts at the centroid of those that detect.

    Args:
        rows: (B,) bool, where.
        found: (B,) bool, set where a node was heard.
    """
    c = cs[0]
    for b in range(start, stop):
        if not rows[b]:
            continue
        outcome.row[b].searched = True
        state.row[b].last_search = state.row[b].period
        strongest = _wake_all(state, outcome, b, c)
        if strongest >= 0:
            # The new head takes over (the velocity is handed to it) and hears the others.
            if radio.take_over(strongest, state, outcome, b, c):
                outcome.row[b].handover = True
            outcome.row[b].detections = 0
            state.reports.count[b] = 0
            for node in range(state.network.battery.shape[1]):
                sense(node, strongest, radio.SEARCH, target_of(state, b), state, outcome, b, c)
            found[b] = _restart_at_centroid(state, b, c)
        elif c.model == sensing.BINARY:  # asked, all keep silent
            state.sensed[b] = 0
            state.reports.bitmap[b] = 0


@lean_piece
def _wake_all(state, outcome, b, c):
    """Wake-up call to all, sensing by those that slept.

    Returns: the living node with the strongest signal of the target: the one that measured the greatest strength, the
    nearest that detects it where nodes report positions, the first by number where they report one bit; -1: nobody.
    """
    network, standing = state.network, state.network.row[b]
    positions, battery, members = network.positions[b], network.battery[b], network.members[b]
    key, period, target = state.key[b], state.row[b].period, target_of(state, b)
    call = c.wakeup_bits * c.rx_j_per_bit
    strongest, best, j = -1, -np.inf, 0
    outcome.row[b].members = 0
    for node in range(len(battery)):
        while j < standing.n_members and members[j] < node:
            j += 1
        awake = node == standing.head or (j < standing.n_members and members[j] == node)
        if battery[node] <= 0.0 or not radio.spend(node, call, radio.SEARCH, state, outcome, b):
            continue
        if not awake and not wake(node, radio.SEARCH, state, outcome, b, c):
            continue
        outcome.row[b].members += 1
        squared = squared_distance(positions, node, target[0], target[1])
        if battery[node] > 0.0 and sensing.tells(key, period, node, squared, c):
            if c.model == sensing.POSITION:
                signal = -squared
            elif c.model == sensing.BINARY:  # one bit has no strength: the first by number
                signal = 0.0
            else:
                signal = sensing.measured_strength(key, period, node, squared, c)
            if signal > best:
                strongest, best = node, signal
    return strongest


@lean_piece
def _restart_at_centroid(state, b, c):
    """Position belief about the centroid of the nodes heard, sd r_s / sqrt(n); the velocity's stays. Returns whether
    any was heard."""
    heard, positions = state.reports.count[b], state.network.positions[b]
    if heard == 0:
        return False
    x, y = 0.0, 0.0
    for k in range(heard):
        x += positions[state.reports.node[b, k], 0]
        y += positions[state.reports.node[b, k], 1]
    mean, cov = state.belief.row[b].mean, state.belief.row[b].cov
    mean[0], mean[2] = x / heard, y / heard
    for axis in (0, 2):
        for other in range(4):
            cov[axis, other] = 0.0
            cov[other, axis] = 0.0
    cov[0, 0] = cov[2, 2] = c.radius_m * c.radius_m / heard
    state.row[b].log_miss = 0.0
    return True
