"""The parts of a period, a row at a time; `World.step` puts them together."""

import numpy as np

from wsn_env.compiled import draws
from wsn_env.compiled.elementary import expected_error, log
from wsn_env.compiled.kernels import kernel, lean_kernel, lean_piece
from wsn_env.filters.kernels import filter_row, redraw_row, scratch
from wsn_env.filters.levels import foretell
from wsn_env.models.physics import radio, sensing
from wsn_env.models.physics.field import nearest_living, squared_distance
from wsn_env.models.physics.motion import predict_moments, predict_walk
from wsn_env.simulation.state import KEEP_CLUSTER, KEEP_HEAD, NOBODY, Outcome, state_of


@kernel
def run(start, stop, cs, maps, heads, chosen, lost, outcomes, *arrays):
    """A period with the particle filter at the head, up to where some rows must search; returns how many."""
    state = state_of(arrays)
    outcome = Outcome(outcomes, state.ledger.spent_j)
    room = scratch(state.belief.particles.shape[2])
    count = 0
    for b in range(start, stop):
        _sense_and_report(heads[b], chosen[b], state, outcome, b, cs[0])
        key, period = state.key[b], state.row[b].period
        if cs[0].redraw and outcome.row[b].handover:
            redraw_row(key, period, state.belief, b)
        resampled = filter_row(key, period, state.belief, state.network, state.reports, b, cs[0], maps, room)
        lost[b] = _conclude(resampled, state, outcome, b, cs[0])
        count += lost[b]
        if cs[0].model == sensing.BEACON:
            foretell(state.belief, state.network.positions[b], b, cs[0], maps, room[0])
    return count


@kernel
def foretell_rows(start, stop, cs, rows, maps, belief, positions):
    """What the receivers of a beacon should report next, in the rows marked."""
    room = np.empty(belief.particles.shape[2], np.float32)
    for b in range(start, stop):
        if rows[b]:
            foretell(belief, positions[b], b, cs[0], maps, room)


@lean_kernel
def sense_and_report(start, stop, cs, heads, chosen, state, outcome):
    """What comes before the correction, for a tracker that is not compiled."""
    for b in range(start, stop):
        _sense_and_report(heads[b], chosen[b], state, outcome, b, cs[0])


@lean_kernel
def conclude(start, stop, cs, resampled, lost, state, outcome):
    """What comes after it; returns how many rows must search."""
    count = 0
    for b in range(start, stop):
        lost[b] = _conclude(resampled[b], state, outcome, b, cs[0])
        count += lost[b]
    return count


@lean_piece
def target_of(state, b):
    """The true position (x, y) in the present period [m]."""
    k = min(state.row[b].period, state.track.shape[1] - 1)
    return state.track[b, k, 0], state.track[b, k, 2]


@lean_piece
def _sense_and_report(head, chosen, state, outcome, b, c):
    """From the choice to the reports: cluster, target, detections, packets, and what was missed.

    A head that dies of what it receives still corrects with what it has heard until then.
    """
    network, reports = state.network, state.reports
    radio.close_books(state.ledger, b)
    _take_choice(head, chosen, state, outcome, b, c)  # handover, invitations [J]
    state.row[b].period += 1
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
            if wake(node, radio.SENSING, state, outcome, b, c):
                sense(node, head, radio.REPORT, target, state, outcome, b, c)
    if c.asleep_j > 0.0:
        _sleep(state, outcome, b, c)
    _remember_miss(state, b, c)


@lean_piece
def _take_choice(head, chosen, state, outcome, b, c):
    """Drop what cannot serve, then form the cluster."""
    network, out = state.network, outcome.row[b]
    standing, battery, predicted = network.row[b], network.battery[b], state.belief.row[b].predicted_mean
    stands = standing.head >= 0 and battery[standing.head] > 0.0
    if head == KEEP_CLUSTER and stands:
        out.members = 1 + standing.n_members
        return
    if head == NOBODY and c.receiver != radio.TO_HEAD:
        standing.head = -1
        standing.n_members = 0
        return
    wanted = 0
    for node in chosen:
        wanted += node != -1
    if head < 0 or head >= len(battery) or battery[head] <= 0.0:
        out.dropped += head != KEEP_HEAD and head != KEEP_CLUSTER
        head = standing.head if stands else nearest_living(network.positions[b], battery, predicted[0], predicted[2])
    wished = state.reports.node[b]  # room for a list: the last period's reports have done their service
    count = _list_living(chosen, battery, wished)
    out.dropped += wanted - count
    if head < 0:  # nobody is alive
        standing.head = -1
        standing.n_members = 0
        return
    kept = 0
    for k in range(count):
        if wished[k] != head:
            if radio.in_one_hop(wished[k], head, network.positions[b], c):
                wished[kept] = wished[k]
                kept += 1
            else:
                out.dropped += 1
    out.handover = radio.form(head, wished, kept, state, outcome, b, c)
    out.members = 1 + standing.n_members


@lean_piece
def _list_living(chosen, battery, found):
    """The living among the chosen in ascending order, each once, in `found`; their number.

    Sorts by insertion: the chosen are few, or sorted.
    """
    count = 0
    for node in chosen:
        if not 0 <= node < len(battery) or battery[node] <= 0.0:
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
def wake(node, purpose, state, outcome, b, c):
    """A node pays for being awake in this period. Returns whether it could."""
    return state.network.battery[b, node] > 0.0 and radio.spend(node, c.awake_j, purpose, state, outcome, b)


@lean_piece
def _sleep(state, outcome, b, c):
    """All living nodes outside the cluster pay for the period, too."""
    network, standing = state.network, state.network.row[b]
    battery, members, j = network.battery[b], network.members[b], 0
    for node in range(len(battery)):
        while j < standing.n_members and members[j] < node:
            j += 1
        awake = node == standing.head or (j < standing.n_members and members[j] == node)
        if not awake and battery[node] > 0.0:
            radio.spend(node, c.asleep_j, radio.SENSING, state, outcome, b)


@lean_piece
def sense(node, head, purpose, target, state, outcome, b, c):
    """An awake node's period: detect, measure, report."""
    positions, battery, reports = state.network.positions[b], state.network.battery[b], state.reports
    key, period = state.key[b], state.row[b].period
    if battery[node] <= 0.0:
        return
    if c.model == sensing.BEACON:
        _pass_on(node, head, purpose, state, outcome, b, c)
        return
    squared = squared_distance(positions, node, target[0], target[1])
    value = sensing.tells(key, period, node, squared, c)
    has_news, changed = value, False
    if c.model == sensing.BINARY:
        has_news, changed = _update_state(node, value, purpose, state, b, c)
    if not has_news:
        return
    outcome.row[b].detections += 1
    if radio.report(node, head, 1.0, purpose, state, outcome, b, c):
        slot = reports.count[b]
        reports.node[b, slot] = node
        if c.model == sensing.BINARY:
            reports.value[b, slot, 0] = value
            reports.value[b, slot, 1] = changed
            reports.bitmap[b, node] = value
        else:
            sensing.measure(key, period, node, positions, target, c, reports.value[b, slot])
        reports.count[b] += 1


@lean_piece
def _pass_on(node, head, purpose, state, outcome, b, c):
    """A receiver's period: it reports the packets that it has heard."""
    reports, heard = state.reports, state.packets[b, min(state.row[b].period, state.packets.shape[1] - 1), node]
    if heard[1] > 0.0:
        outcome.row[b].detections += 1
        if radio.report(node, head, np.float64(heard[1]), purpose, state, outcome, b, c):
            slot = reports.count[b]
            reports.node[b, slot] = node
            reports.value[b, slot, 0] = heard[0]
            reports.value[b, slot, 1] = heard[1]
            reports.count[b] += 1


@lean_piece
def _update_state(node, value, purpose, state, b, c):
    """A binary sensor compares what it senses with what it sensed last. Returns whether it has to report, and
    whether its state has changed.

    In a search everybody is asked, and silence means 0; so it does where every presence is reported.
    """
    changed = value != (state.sensed[b, node] != 0)
    state.sensed[b, node] = value
    if c.every_presence or purpose == radio.SEARCH:
        state.reports.bitmap[b, node] = 0
        return value, changed
    return changed or (c.refresh > 0 and state.row[b].period % c.refresh == 0), changed


@lean_piece
def _remember_miss(state, b, c):
    """How improbable the silence since the last report is, seen from the belief."""
    if _hears_of_target(state, b, c):
        state.row[b].log_miss = 0.0
    elif c.model == sensing.BEACON:  # a receiver hears it anywhere
        standing = state.network.row[b]
        awake = standing.n_members + (standing.head >= 0)
        state.row[b].log_miss += awake * log(max(1.0 - c.heard, 1e-12))
    else:
        network, belief = state.network, state.belief.row[b]
        standing = network.row[b]
        state.row[b].log_miss += sensing.log_miss_probability(
            belief.predicted_mean,
            belief.predicted_cov,
            network.positions[b],
            network.members[b],
            standing.n_members,
            standing.head,
            c,
        )


@lean_piece
def _hears_of_target(state, b, c):
    """Whether a report came in; of binary sensors, whose state often stays, whether any that is awake is known to
    detect."""
    if c.model != sensing.BINARY:
        return state.reports.count[b] > 0
    standing, members, bitmap = state.network.row[b], state.network.members[b], state.reports.bitmap[b]
    found = standing.head >= 0 and bitmap[standing.head] != 0
    for k in range(standing.n_members):
        found |= bitmap[members[k]] != 0
    return found


@lean_piece
def _conclude(resampled, state, outcome, b, c):
    """After the correction: the broadcast, and the end of the period unless a search must come first; returns
    whether it must."""
    if resampled and state.network.row[b].head >= 0:
        outcome.row[b].resampled = True
        if c.receiver == radio.TO_HEAD:
            radio.broadcast(state, outcome, b, c)
    lost = _is_lost(state, b, c)
    if not lost:
        _settle(state, outcome, b, c)
    return lost


@lean_piece
def _is_lost(state, b, c):
    """The search rule: too long a silence, or a belief wider than a node's radius; not twice within the gap."""
    cov, row = state.belief.row[b].cov, state.row[b]
    wide = max(cov[0, 0], cov[2, 2]) > c.radius_m * c.radius_m
    rested = row.period - row.last_search >= c.search_gap
    someone = state.network.row[b].alive > 0
    return c.search != 0 and rested and someone and (wide or row.log_miss < c.log_search_miss)


@lean_kernel
def settle(start, stop, cs, rows, state, outcome):
    """The end of the period in the rows marked."""
    for b in range(start, stop):
        if rows[b]:
            _settle(state, outcome, b, cs[0])


@lean_piece
def _settle(state, outcome, b, c):
    """The dead, the costs, and the prediction for the next period (eq. 16)."""
    belief, out, target = state.belief.row[b], outcome.row[b], target_of(state, b)
    mean, cov = belief.mean, belief.cov
    _bury(state.network, b, c)
    total = 0.0
    for joules in out.energy_j:
        total += joules
    out.energy_mj = 1e3 * total
    out.target_m[0], out.target_m[1] = target[0], target[1]
    out.estimate_m[0], out.estimate_m[1] = mean[0], mean[2]
    out.error_m = np.sqrt((mean[0] - target[0]) ** 2 + (mean[2] - target[1]) ** 2)
    out.posterior_rms_m = np.sqrt(cov[0, 0] + cov[2, 2])
    out.believed_error_m = expected_error(cov[0, 0], cov[0, 2], cov[2, 2])
    out.n_eff = belief.n_eff
    out.delivered = state.reports.count[b]
    out.alive = state.network.row[b].alive
    luck = draws.bits(draws.stream(state.key[b], state.row[b].period, draws.POLICY), 0)
    state.row[b].luck = np.uint32(luck >> np.uint64(32))
    if c.walks:
        predict_walk(mean, cov, c, belief.predicted_mean, belief.predicted_cov)
    else:
        predict_moments(mean, cov, c.period_s, c.q, belief.predicted_mean, belief.predicted_cov)


@lean_piece
def _bury(network, b, c):
    """Take the dead out of the cluster. It ends with its head, unless the head is a node like the others."""
    standing, battery, members = network.row[b], network.battery[b], network.members[b]
    if standing.head >= 0 and battery[standing.head] <= 0.0:
        standing.head = -1
        if c.receiver == radio.TO_HEAD:
            standing.n_members = 0
    living = 0
    for k in range(standing.n_members):
        if battery[members[k]] > 0.0:
            if standing.head < 0:
                standing.head = members[k]
            else:
                members[living] = members[k]
                living += 1
    standing.n_members = living
