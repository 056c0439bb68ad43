"""The parts of a period, a row at a time; `World.step` puts them together."""

from typing import Any

import numpy as np

from wsn_env.compiled import draws
from wsn_env.compiled.elementary import expected_error
from wsn_env.compiled.kernels import kernel, lean_kernel, lean_piece
from wsn_env.filters.kernels import filter_row, make_scratch, redraw_row
from wsn_env.filters.surprise import note_surprise
from wsn_env.models.association.base import heard_of_target, nodes_heard
from wsn_env.models.measurement.base import AtHead, finds_target, log_miss, predict_reports
from wsn_env.models.motion.modes import predict_mixture
from wsn_env.models.motion.prediction import predict_moments, predict_walk
from wsn_env.models.state import KEEP_CLUSTER, KEEP_HEAD, NOBODY, belief_at, state_at
from wsn_env.simulation import messages
from wsn_env.simulation.faults import fail_nodes
from wsn_env.simulation.geometry import nearest_living
from wsn_env.simulation.lifetime import count_dead, count_life
from wsn_env.simulation.messages import Episode
from wsn_env.simulation.sensing import is_awake, send_late, sense, wake
from wsn_env.simulation.truth import memory_of, target_of


@kernel
def run(
    start: int, stop: int, cs: Any, handle: np.ndarray, maps: np.ndarray, cluster: Any, outcomes: np.ndarray
) -> int:
    """A period with the particle filter at the head, up to where some rows must search.

    Args:
        maps: of the measurement's `residual_maps`.
        cluster: heads (B,) and members (B, M).
        outcomes: (B,) OUTCOME; `searched` is set where a search must follow.

    Returns: how many rows must search.
    """
    heads, chosen = cluster
    state, c = state_at(handle), cs[0]
    scratch, resampled = make_scratch(state.belief.particles.shape[2]), np.zeros(c.targets, np.bool_)
    count = 0
    for first in range(start, stop, c.targets):
        for b in range(first, first + c.targets):
            out = outcomes[b]
            _sense_and_report(heads[b], chosen[b], Episode(state, b, out, first, c.targets), c)
            key, period = state.key[b], state.row[b].period
            if c.tracking.redraw and out.handover:
                redraw_row(key, period, state.belief, b)
            head = AtHead(state.belief, state.network, state.reports, b)
            resampled[b - first] = filter_row(key, period, head, c, maps, scratch)
            _remember_miss(state, b, c)
        for b in range(first, first + c.targets):
            episode = Episode(state, b, outcomes[b], first, c.targets)
            count += _conclude(resampled[b - first], episode, c.radio, c.tracking)
            predict_reports(c.measurement, state.belief, state.network.positions[b], b, c, maps, scratch.weights)
    return count


@kernel
def predict_reports_of_rows(
    start: int, stop: int, cs: Any, rows: np.ndarray, maps: np.ndarray, belief_handle: np.ndarray, positions: np.ndarray
) -> None:
    """What each node should report next, in the rows marked, where the measurement says so."""
    belief, c = belief_at(belief_handle), cs[0]
    weights = np.empty(belief.particles.shape[2], np.float32)
    for b in range(start, stop):
        if rows[b]:
            predict_reports(c.measurement, belief, positions[b], b, c, maps, weights)


@lean_kernel
def sense_and_report(
    start: int, stop: int, cs: Any, heads: np.ndarray, chosen: np.ndarray, outcomes: np.ndarray, handle: np.ndarray
) -> None:
    """What comes before the correction, for a tracker that is not compiled."""
    state = state_at(handle)
    for b in range(start, stop):
        _sense_and_report(
            heads[b], chosen[b], Episode(state, b, outcomes[b], b - b % cs[0].targets, cs[0].targets), cs[0]
        )
        _remember_miss(state, b, cs[0])


@lean_kernel
def conclude(start: int, stop: int, cs: Any, resampled: np.ndarray, outcomes: np.ndarray, handle: np.ndarray) -> int:
    """What comes after it; returns how many rows must search."""
    state, c, count = state_at(handle), cs[0], 0
    for b in range(start, stop):
        count += _conclude(
            resampled[b], Episode(state, b, outcomes[b], b - b % c.targets, c.targets), c.radio, c.tracking
        )
    return count


@lean_piece
def _sense_and_report(head, chosen, episode, c):
    """From the choice to the reports: cluster, target, detections, packets, and what was missed.

    A head that dies of what it receives still corrects with what it has heard until then.
    """
    state, b = episode.state, episode.b
    network, reports = state.network, state.reports
    messages.clear_ledger(state.ledger, b)
    _take_choice(head, chosen, episode, c.radio)  # handover, invitations [J]
    state.row[b].period += 1
    fail_nodes(state, b)
    target = target_of(state, b)  # moves
    reports.count[b] = 0
    head, n, members = network.row[b].head, network.row[b].n_members, network.members[b]
    if head >= 0:
        # In the order of their numbers, the head in its place among the members.
        place = 0
        while place < n and members[place] < head:
            place += 1
        for k in range(n + 1):
            node = head if k == place else members[k - (k > place)]
            if wake(node, messages.SENSING, episode, c.radio):
                sense(node, head, messages.REPORT, target, episode, c)
    if head >= 0 or not c.radio.to_head:
        send_late(head, episode, c)
    if head >= 0 and state.residual_j[b, head] <= 0.0:
        messages.note_residual(head, episode)
    if c.radio.asleep_j > 0.0 and b + 1 == episode.first + episode.targets:
        _sleep(episode, c.radio)


@lean_piece
def _take_choice(head, chosen, episode, r):
    """Drop what cannot serve, then form the cluster."""
    state, b, out = episode.state, episode.b, episode.out
    network = state.network
    standing, residual_j, predicted = network.row[b], state.residual_j[b], state.belief.row[b].predicted_mean
    stands = standing.head >= 0 and residual_j[standing.head] > 0.0
    if head == KEEP_CLUSTER and stands:
        out.members = 1 + standing.n_members
        return
    if head == NOBODY and not r.to_head:
        standing.head = -1
        standing.n_members = 0
        return
    asked_for = 0
    for node in chosen:
        asked_for += node != -1
        if 0 <= node < len(residual_j) and residual_j[node] <= 0.0:
            messages.note_residual(np.int64(node), episode)  # it does not answer
    if 0 <= head < len(residual_j) and residual_j[head] <= 0.0:
        messages.note_residual(np.int64(head), episode)
    if head < 0 or head >= len(residual_j) or residual_j[head] <= 0.0:
        out.dropped += head != KEEP_HEAD and head != KEEP_CLUSTER
        head = standing.head if stands else nearest_living(network.positions[b], residual_j, predicted[0], predicted[2])
    others = state.reports.node[b]  # room for a list: the last period's reports have done their service
    count = _list_living(chosen, residual_j, others)
    out.dropped += asked_for - count
    if head < 0:  # nobody is alive
        standing.head = -1
        standing.n_members = 0
        return
    kept: Any = np.int64(0)  # not a literal: for one Numba would compile `form` once more
    for k in range(count):
        if others[k] != head:
            if messages.in_one_hop(others[k], head, network.positions[b], r):
                others[kept] = others[k]
                kept += 1
            else:
                out.dropped += 1
    out.handover = messages.form(head, others, kept, episode, r)
    out.members = 1 + standing.n_members


@lean_piece
def _list_living(chosen, residual_j, found):
    """The living among the chosen in ascending order, each once, in `found`; their number.

    Sorts by insertion: the chosen are few, or sorted.
    """
    count = 0
    for node in chosen:
        if not 0 <= node < len(residual_j) or residual_j[node] <= 0.0:
            continue
        k = count
        while k > 0 and found[k - 1] > node:
            k -= 1
        if k > 0 and found[k - 1] == node:
            continue
        for j in range(count, k, -1):
            found[j] = found[j - 1]
        found[k] = node
        count += 1
    return count


@lean_piece
def _sleep(episode, r):
    """All nodes outside the field's clusters that are taken for alive pay for the period, too."""
    state, b = episode.state, episode.b
    network, standing = state.network, state.network.row[b]
    battery, members, j = network.battery[b], network.members[b], 0
    for node in range(len(battery)):
        while j < standing.n_members and members[j] < node:
            j += 1
        awake = node == standing.head or (j < standing.n_members and members[j] == node)
        for row in range(episode.first, b):
            awake |= is_awake(node, network, row)
        if not awake and battery[node] > 0.0:
            messages.spend(node, r.asleep_j, messages.SENSING, episode)


@lean_piece
def _remember_miss(state, b, c):
    """How improbable the silence since the last report is, seen from the belief."""
    network, belief = state.network, state.belief.row[b]
    head, members = network.row[b].head, network.members[b, : network.row[b].n_members]
    if finds_target(c.measurement, memory_of(state, b), heard_of_target(state.reports, b), head, members):
        state.row[b].log_miss = 0.0
    else:
        mean, cov = belief.predicted_mean, belief.predicted_cov
        state.row[b].log_miss += log_miss(c.measurement, mean, cov, network.positions[b], head, members, c)


@lean_piece
def _conclude(resampled, episode, r, t):
    """After the correction: the broadcast, and the end of the period unless a search must come first; returns
    whether it must, as the outcome's `searched` does."""
    state, b, out = episode.state, episode.b, episode.out
    if resampled and state.network.row[b].head >= 0:
        out.resampled = True
        if r.to_head:
            messages.broadcast(episode, r)
    out.searched = _is_lost(state, b, t)
    if not out.searched:
        _settle(episode, r, t)
    return out.searched


@lean_piece
def _is_lost(state, b, t):
    """The search rule: too long a silence, or a belief wider than a node's radius; not twice within the gap."""
    cov, row = state.belief.row[b].cov, state.row[b]
    wide = max(cov[0, 0], cov[2, 2]) > t.radius_m * t.radius_m
    rested = row.period - row.last_search >= t.search_gap
    someone = state.network.row[b].alive > 0
    return t.search != 0 and rested and someone and (wide or row.log_miss < t.log_search_miss)


@lean_kernel
def settle(start: int, stop: int, cs: Any, rows: np.ndarray, outcomes: np.ndarray, handle: np.ndarray) -> None:
    """The end of the period in the rows marked."""
    state, c = state_at(handle), cs[0]
    for b in range(start, stop):
        if rows[b]:
            _settle(Episode(state, b, outcomes[b], b - b % c.targets, c.targets), c.radio, c.tracking)


@lean_piece
def _settle(episode, r, t):
    """The dead, the costs, and the prediction for the next period (eq. 16)."""
    state, b, out = episode.state, episode.b, episode.out
    belief, target = state.belief.row[b], target_of(state, b)
    mean, cov = belief.mean, belief.cov
    _remove_dead_nodes(episode, r)
    if state.living[b] < state.residual_j.shape[1]:  # a node that dies leaves the clusters of other targets, too
        for row in range(episode.first, episode.first + episode.targets):
            if row != b:
                _remove_dead_nodes(Episode(state, row, out, episode.first, episode.targets), r)
                count_dead(state, row)
    if state.row[b].period > 0 and state.reports.count[b] > 0:  # in period 0 nothing was predicted
        note_surprise(belief)
    total = 0.0
    for joules in out.energy_j:
        total += joules
    out.energy_mj = 1e3 * total
    out.target_m[0], out.target_m[1] = target[0], target[1]
    out.estimate_m[0], out.estimate_m[1] = mean[0], mean[2]
    out.error_m = np.sqrt((mean[0] - target[0]) ** 2 + (mean[2] - target[1]) ** 2)
    count_life(state, b, out.error_m, t)
    out.posterior_rms_m = np.sqrt(cov[0, 0] + cov[2, 2])
    out.believed_error_m = expected_error(cov[0, 0], cov[0, 2], cov[2, 2])
    out.n_eff = belief.n_eff
    out.delivered = nodes_heard(state.reports, b)
    out.alive = state.living[b]
    bits = draws.bits(draws.stream(state.key[b], state.row[b].period, draws.POLICY), 0)
    state.row[b].random_bits = np.uint32(bits >> np.uint64(32))
    if t.walks:
        predict_walk(mean, cov, t, belief.predicted_mean, belief.predicted_cov)
    elif t.switches:
        predict_mixture(mean, cov, belief.mode_probabilities, t, belief.predicted_mean, belief.predicted_cov)
    else:
        predict_moments(mean, cov, t.period_s, t.q, belief.predicted_mean, belief.predicted_cov)


@lean_piece
def _remove_dead_nodes(episode, r):
    """Take the dead out of the cluster. It ends with its head, unless the head is a node like the others."""
    network, b, residual_j = episode.state.network, episode.b, episode.state.residual_j[episode.b]
    standing, members = network.row[b], network.members[b]
    if standing.head >= 0 and residual_j[standing.head] <= 0.0:
        messages.note_residual(standing.head, episode)
        standing.head = -1
        if r.to_head:
            standing.n_members = 0
    living = 0
    for k in range(standing.n_members):
        if residual_j[members[k]] <= 0.0:
            messages.note_residual(np.int64(members[k]), episode)
        else:
            if standing.head < 0:
                standing.head = members[k]
            else:
                members[living] = members[k]
                living += 1
    standing.n_members = living
