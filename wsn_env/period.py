"""The parts of a period, a row at a time; `World.step` puts them together."""

import numpy as np

from wsn_env import draws
from wsn_env.compiling import lean_kernel, lean_piece
from wsn_env.physics import radio, sensing
from wsn_env.physics.field import nearest_living, squared_distance


@lean_piece
def _target(state, b):
    """The true position (x, y) in the present period [m]."""
    k = min(state.period[b], state.track.shape[1] - 1)
    return state.track[b, k, 0], state.track[b, k, 2]


@lean_kernel
def sense_and_report(start, stop, cs, heads, chosen, state, outcome):
    """From the choice to the reports: cluster, target, detections, packets, and what was missed.

    A head that dies of what it receives still corrects with what it has heard until then.
    """
    c = cs[0]
    network, reports = state.network, state.reports
    for b in range(start, stop):
        state.period[b] += 1
        _take_choice(heads[b], chosen[b], network, state.belief, outcome, b, c)  # handover, invitations [J]
        target = _target(state, b)  # moves
        reports.count[b] = 0
        head = network.head[b]
        if head >= 0:
            # In the order of their numbers, the head in its place among the members.
            members, n = network.members[b], network.n_members[b]
            place = 0
            while place < n and members[place] < head:
                place += 1
            for k in range(n + 1):
                node = head if k == place else members[k - (k > place)]
                if _wake(node, radio.SENSING, network, outcome, b, c):
                    _detect_and_report(node, head, radio.REPORT, target, state, outcome, b, c)
        _remember_miss(state, b, c)


@lean_piece
def _take_choice(head, chosen, network, belief, outcome, b, c):
    """Drop what cannot serve, then form the cluster."""
    battery = network.battery[b]
    wanted = 0
    for node in chosen:
        wanted += node != -1
    valid_head = 0 <= head < len(battery) and battery[head] > 0.0
    if not valid_head:
        outcome.dropped[b] += head != -1
        head = network.head[b]
        if head < 0 or battery[head] <= 0.0:
            head = nearest_living(
                network.positions[b], battery, belief.predicted_mean[b, 0], belief.predicted_mean[b, 2]
            )
    count = radio.standing_members(chosen, battery)
    outcome.dropped[b] += wanted - count
    if head < 0:  # nobody is alive
        network.head[b] = -1
        network.n_members[b] = 0
        return
    kept = 0
    for k in range(count):
        if chosen[k] != head:
            chosen[kept] = chosen[k]
            kept += 1
    handed = radio.form(head, chosen, kept, network, b, outcome.spent_j[b], outcome.energy_j[b], c)
    outcome.handover[b] = handed
    outcome.members[b] = 1 + network.n_members[b]


@lean_piece
def _wake(node, purpose, network, outcome, b, c):
    """A node pays for sensing in this period. Returns whether it could."""
    battery = network.battery[b]
    return battery[node] > 0.0 and radio.spend(
        node, c.sensing_j, purpose, battery, outcome.spent_j[b], outcome.energy_j[b]
    )


@lean_piece
def _detect_and_report(node, head, purpose, target, state, outcome, b, c):
    """An awake node's period: detect, measure, report."""
    network, reports = state.network, state.reports
    positions, battery = network.positions[b], network.battery[b]
    spent, energy = outcome.spent_j[b], outcome.energy_j[b]
    key, period = state.key[b], state.period[b]
    distance = np.sqrt(squared_distance(positions, node, target[0], target[1]))
    if battery[node] <= 0.0 or not sensing.detects(key, period, node, distance, c):
        return
    outcome.detections[b] += 1
    if battery[head] > 0.0 and radio.report(key, period, node, head, purpose, positions, battery, spent, energy, c):
        slot = reports.count[b]
        reports.node[b, slot] = node
        sensing.measure(key, period, node, positions, target, c, reports.value[b, slot])
        reports.count[b] += 1


@lean_piece
def _remember_miss(state, b, c):
    """How improbable the silence since the last report is, seen from the belief."""
    network, belief = state.network, state.belief
    if state.reports.count[b] > 0:
        state.log_miss[b] = 0.0
    else:
        state.log_miss[b] += sensing.log_miss_probability(
            belief.predicted_mean[b],
            belief.predicted_cov[b],
            network.positions[b],
            network.members[b],
            network.n_members[b],
            network.head[b],
            c,
        )


@lean_kernel
def conclude(start, stop, cs, resampled, lost, state, outcome):
    """After the correction: the broadcast, and the end of the period unless a search must come first.

    Args:
        resampled: (B,) bool.
        lost: (B,) bool, filled: which rows have to search.
    """
    c = cs[0]
    network = state.network
    for b in range(start, stop):
        head = network.head[b]
        if resampled[b] and head >= 0:
            outcome.resampled[b] = 1
            members, count = network.members[b], network.n_members[b]
            spent, energy = outcome.spent_j[b], outcome.energy_j[b]
            radio.broadcast(head, members, count, network.positions[b], network.battery[b], spent, energy, c)
        lost[b] = _is_lost(state, b, c)
        if not lost[b]:
            _settle(state, outcome, b, c)


@lean_piece
def _is_lost(state, b, c):
    """The search rule: too long a silence, or a belief wider than a node's radius; not twice within the gap."""
    cov = state.belief.cov[b]
    wide = max(cov[0, 0], cov[2, 2]) > c.radius_m * c.radius_m
    rested = state.period[b] - state.last_search[b] >= c.search_gap
    someone = state.network.alive[b] > 0
    return c.search != 0 and rested and someone and (wide or state.log_miss[b] < c.log_search_miss)


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
        outcome.searched[b] = 1
        state.last_search[b] = state.period[b]
        strongest = _wake_all(state, outcome, b, c)
        if strongest >= 0:
            # The new head takes over (the velocity is handed to it) and hears the others.
            network, spent, energy = state.network, outcome.spent_j[b], outcome.energy_j[b]
            nobody = network.members[b, :0]
            outcome.handover[b] |= radio.form(strongest, nobody, 0, network, b, spent, energy, c)
            outcome.detections[b] = 0
            state.reports.count[b] = 0
            for node in range(len(network.battery[b])):
                _detect_and_report(node, strongest, radio.SEARCH, _target(state, b), state, outcome, b, c)
            found[b] = _restart_at_centroid(state, b, c)


@lean_piece
def _wake_all(state, outcome, b, c):
    """Wake-up call to all, sensing by those that slept.

    Returns: the living node with the strongest signal of the target, which is the nearest that detects it, or the one
    that measured the greatest strength; -1: nobody detects it.
    """
    network = state.network
    positions, battery = network.positions[b], network.battery[b]
    spent, energy = outcome.spent_j[b], outcome.energy_j[b]
    members, head, n = network.members[b], network.head[b], network.n_members[b]
    key, period, target = state.key[b], state.period[b], _target(state, b)
    call = c.wakeup_bits * c.rx_j_per_bit
    strongest, best, j = -1, -np.inf, 0
    outcome.members[b] = 0
    for node in range(len(battery)):
        while j < n and members[j] < node:
            j += 1
        awake = node == head or (j < n and members[j] == node)
        if battery[node] <= 0.0 or not radio.spend(node, call, radio.SEARCH, battery, spent, energy):
            continue
        if not awake and not _wake(node, radio.SEARCH, network, outcome, b, c):
            continue
        outcome.members[b] += 1
        squared = squared_distance(positions, node, target[0], target[1])
        if battery[node] > 0.0 and sensing.detects(key, period, node, np.sqrt(squared), c):
            signal = -squared if c.model == 0 else sensing.measured_strength(key, period, node, squared, c)
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
    mean, cov = state.belief.mean[b], state.belief.cov[b]
    mean[0], mean[2] = x / heard, y / heard
    for axis in (0, 2):
        for other in range(4):
            cov[axis, other] = 0.0
            cov[other, axis] = 0.0
    cov[0, 0] = cov[2, 2] = c.radius_m * c.radius_m / heard
    state.log_miss[b] = 0.0
    return True


@lean_kernel
def settle(start, stop, cs, rows, state, outcome):
    """The end of the period in the rows marked."""
    for b in range(start, stop):
        if rows[b]:
            _settle(state, outcome, b, cs[0])


@lean_piece
def _settle(state, outcome, b, c):
    """The dead, the costs, and the prediction for the next period (eq. 16)."""
    network, belief = state.network, state.belief
    _bury(network, outcome, b)
    mean, cov, target = belief.mean[b], belief.cov[b], _target(state, b)
    outcome.target_m[b, 0], outcome.target_m[b, 1] = target[0], target[1]
    outcome.estimate_m[b, 0], outcome.estimate_m[b, 1] = mean[0], mean[2]
    outcome.error_m[b] = np.sqrt((mean[0] - target[0]) ** 2 + (mean[2] - target[1]) ** 2)
    outcome.posterior_rms_m[b] = np.sqrt(cov[0, 0] + cov[2, 2])
    outcome.delivered[b] = state.reports.count[b]
    outcome.alive[b] = network.alive[b]
    luck = draws.bits(draws.stream(state.key[b], state.period[b], draws.POLICY), 0)
    state.luck[b] = np.uint32(luck >> np.uint64(32))
    predict_moments(mean, cov, c.period_s, c.q, belief.predicted_mean[b], belief.predicted_cov[b])


@lean_piece
def _bury(network, outcome, b):
    """Count who died of this period's costs, and take the dead out of the cluster."""
    battery = network.battery[b]
    if not outcome.energy_j[b].any():
        return
    for node in range(len(battery)):
        network.alive[b] -= outcome.spent_j[b, node] > 0.0 and battery[node] <= 0.0
    if network.head[b] >= 0 and battery[network.head[b]] <= 0.0:
        network.head[b] = -1
        network.n_members[b] = 0
    network.n_members[b] = radio.standing_members(network.members[b, : network.n_members[b]], battery)


@lean_piece
def predict_moments(mean, cov, t, q, predicted_mean, predicted_cov):
    """F x and F P F' + q^2 G G' (eq. 16).

    Differs from the paper: as printed, eq. 16 leaves out the spread of the particles, so that E would be constant.
    """
    for i in range(4):
        predicted_mean[i] = mean[i] + (t * mean[i + 1] if i % 2 == 0 else 0.0)
        for j in range(4):
            p = cov[i, j]
            if i % 2 == 0:
                p += t * cov[i + 1, j]
            if j % 2 == 0:
                p += t * cov[i, j + 1]
                if i % 2 == 0:
                    p += t * t * cov[i + 1, j + 1]
            predicted_cov[i, j] = max(p, 0.0) if i == j else p
    gain = (0.5 * t * t, t)
    for axis in (0, 2):
        for i in range(2):
            for j in range(2):
                predicted_cov[axis + i, axis + j] += q * q * gain[i] * gain[j]
