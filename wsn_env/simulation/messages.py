"""What talking costs: sender and receiver pay for every try, a node gives no more than it has.

A radio reaches every node at a price that grows with distance (eq. 5); a modem sends over one hop at one price. Reports
may be lost and are tried again (assumption d of Xiang & Guo, 2013); control packets always arrive. A sink in the middle
of the field and the target's own node have energy of their own, so that only the network's side counts: who reports to
them pays for sending, who is called by them pays for hearing it. `r` are the radio's constants.
"""

from typing import Any, NamedTuple

import numpy as np

from wsn_env.compiled import draws
from wsn_env.compiled.kernels import lean_piece
from wsn_env.models.field import squared_distance
from wsn_env.models.radio.base import reception, relayed, transmission
from wsn_env.simulation.faults import try_success

# NumPy's numbers: for each of Python's own Numba would compile a function of its own.
SENSING, HANDOVER, INVITATION, REPORT, BROADCAST, SEARCH = np.arange(6)


class Episode(NamedTuple):
    """A target of one of a batch of episodes, in a period."""

    state: Any  # State of all of them
    b: int  # its row
    out: Any  # its OUTCOME
    first: int  # the rows from this one on, so many as there are targets, are of its field: they share nodes, batteries
    targets: int


@lean_piece
def spend(node: Any, joules: float, purpose: Any, episode: Episode) -> bool:
    """Charge a node for what the network sees it do; what it cannot pay empties it. Returns whether it paid in full."""
    note_spent(node, joules, episode)
    return _charge(node, joules, purpose, episode)


@lean_piece
def _charge(node, joules, purpose, episode):
    """Charge a node without telling the network."""
    state, b, out = episode.state, episode.b, episode.out
    ledger, before = state.ledger, state.residual_j[b, node]
    left = max(before - joules, 0.0)
    paid = before - left
    if paid > 0.0:
        for row in range(episode.first, episode.first + episode.targets):
            state.residual_j[row, node] = left
            state.living[row] -= left == 0.0
        if ledger.spent_j[b, node] == 0.0:
            ledger.charged[b, ledger.count[b]] = node
            ledger.count[b] += 1
        ledger.spent_j[b, node] += paid
        out.energy_j[purpose] += paid
    return before >= joules


@lean_piece
def note_spent(node: Any, joules: float, episode: Episode) -> None:
    """The network has seen a node spend so much."""
    _note_battery(node, max(episode.state.network.battery[episode.b, node] - joules, 0.0), episode)


@lean_piece
def note_residual(node: Any, episode: Episode) -> None:
    """The network learns what a node has left: from its report, or nothing, since it does not answer."""
    _note_battery(node, episode.state.residual_j[episode.b, node], episode)


@lean_piece
def _note_battery(node, left_j, episode):
    network = episode.state.network
    before = network.battery[episode.b, node]
    for row in range(episode.first, episode.first + episode.targets):
        network.row[row].alive -= before > 0.0 and left_j == 0.0
        network.row[row].left_j = max(network.row[row].left_j - (before - left_j), 0.0)  # a sum: rounded
        network.battery[row, node] = left_j


@lean_piece
def clear_ledger(ledger: Any, b: int) -> None:
    """Forget the last period's payments."""
    for k in range(ledger.count[b]):
        ledger.spent_j[b, ledger.charged[b, k]] = 0.0
    ledger.count[b] = 0


@lean_piece
def in_one_hop(node: Any, other: Any, positions: np.ndarray, r: Any) -> bool:
    """Whether a packet goes from node to node at once."""
    return squared_distance(positions, node, positions[other, 0], positions[other, 1]) <= r.hop_m * r.hop_m


@lean_piece
def send(sender: Any, receiver: Any, bits: float, purpose: Any, episode: Episode, r: Any) -> bool:
    """One packet from node to node (eq. 5). Returns whether both could pay, so that it arrived if not lost."""
    state, b = episode.state, episode.b
    positions, residual_j = state.network.positions[b], state.residual_j[b]
    squared = squared_distance(positions, sender, positions[receiver, 0], positions[receiver, 1])
    if residual_j[sender] <= 0.0 or not spend(sender, transmission(r, bits, squared), purpose, episode):
        return False
    return residual_j[receiver] > 0.0 and spend(receiver, reception(r, bits), purpose, episode)


@lean_piece
def outside(mean: np.ndarray, r: Any) -> tuple[float, float]:
    """Where a receiver outside the network stands, as far as the network knows: the sink in the middle of the field,
    the target where it is predicted. (A price of the true way would tell the target's distance through batteries.)"""
    return (mean[0], mean[2]) if r.to_target else (r.sink_x, r.sink_y)


@lean_piece
def report(node: Any, head: Any, packets: float, purpose: Any, episode: Episode, r: Any) -> bool:
    """A node's report with its retries. Returns whether it was received; to the head its own is free.

    Lost tries cost energy, too, but who sent them is not known: it would tell who has detected the target. Beyond one
    hop nothing is sent: after a search the new head may lie so far, for a modem.

    Args:
        packets: how many it is long.
    """
    state, b = episode.state, episode.b
    positions, residual_j = state.network.positions[b], state.residual_j[b]
    if r.to_head:
        x, y = positions[head, 0], positions[head, 1]
        if residual_j[head] <= 0.0:
            return False
        if node == head:
            return True
    else:
        x, y = outside(state.belief.row[b].predicted_mean, r)
    squared, bits = squared_distance(positions, node, x, y), packets * r.report_bits
    if squared > r.hop_m * r.hop_m:
        return False
    packet = draws.SEARCH_PACKET if purpose == SEARCH else draws.PACKET
    stream = draws.stream(state.key[b], state.row[b].period, packet)
    success = try_success(state, b, node, r.packet_success)
    for attempt in range(r.tries):
        sent = residual_j[node] > 0.0 and _charge(node, transmission(r, bits, squared), purpose, episode)
        if r.to_head:
            sent = sent and residual_j[head] > 0.0 and _charge(head, reception(r, bits), purpose, episode)
        if not sent:
            return False
        if draws.uniform(stream, 16 * node + attempt) < success:
            note_residual(node, episode)  # what arrives also says what its sender has left, and how often it was tried
            if r.to_head:
                for _ in range(attempt + 1):  # one by one, as they were charged: with the same rounding
                    note_spent(head, reception(r, bits), episode)
            return True
    return False


@lean_piece
def broadcast(episode: Episode, r: Any) -> None:
    """The head's word to resample: one transmission as far as the farthest living member, who all pay to hear it."""
    state, b = episode.state, episode.b
    network = state.network
    head, nodes, count = network.row[b].head, network.members[b], network.row[b].n_members
    positions, residual_j = network.positions[b], state.residual_j[b]
    farthest = -1.0
    for k in range(count):
        if residual_j[nodes[k]] > 0.0:
            squared = squared_distance(positions, nodes[k], positions[head, 0], positions[head, 1])
            farthest = max(farthest, squared)
    if farthest < 0.0 or residual_j[head] <= 0.0:
        return
    if spend(head, transmission(r, r.broadcast_bits, farthest), BROADCAST, episode):
        for k in range(count):
            if residual_j[nodes[k]] > 0.0:
                spend(np.int64(nodes[k]), reception(r, r.broadcast_bits), BROADCAST, episode)


@lean_piece
def _hand_over(old, head, episode, r):
    """The old head's packet to the new one; beyond one hop it is relayed, and the old head pays for its relays.

    Returns: as `send`.
    """
    state, b = episode.state, episode.b
    positions, residual_j = state.network.positions[b], state.residual_j[b]
    squared = squared_distance(positions, old, positions[head, 0], positions[head, 1])
    if residual_j[old] <= 0.0 or not spend(old, relayed(r, r.handover_bits, squared), HANDOVER, episode):
        return False
    return residual_j[head] > 0.0 and spend(head, reception(r, r.handover_bits), HANDOVER, episode)


@lean_piece
def take_over(head: Any, episode: Episode, r: Any) -> bool:
    """An awake node leads, alone as yet. Returns whether the head's role was handed over: a sink or the target needs no
    head, so that the node is one like the others there."""
    state, b = episode.state, episode.b
    standing = state.network.row[b]
    old = standing.head
    standing.head = head
    standing.n_members = 0
    return r.to_head and old >= 0 and old != head and _hand_over(old, head, episode, r)


@lean_piece
def form(head: Any, chosen: np.ndarray, count: int, episode: Episode, r: Any) -> bool:
    """Make the chosen cluster the standing one: handover from the old head, invitations to new members.

    Only members that hear their invitation join. A new head invites all of them. A sink or the target calls only who
    has slept, the head like the others; its sending is not counted.

    Args:
        head: the new head, alive.
        chosen: its first `count` entries are living members in ascending order, the head left out. Overwritten.

    Returns: whether the head's role was handed over.
    """
    state, b = episode.state, episode.b
    standing, members = state.network.row[b], state.network.members[b]
    old, old_count = standing.head, standing.n_members
    heads_call = r.to_head
    handed = take_over(head, episode, r)
    price = reception(r, r.invitation_bits)
    called = not heads_call and head != old
    for k in range(old_count):
        called &= members[k] != head
    if called:
        spend(head, price, INVITATION, episode)
    n, j = 0, 0
    for k in range(count):
        node = np.int64(chosen[k])
        while j < old_count and members[j] < node:
            j += 1
        awake = node == old or (j < old_count and members[j] == node)
        if heads_call:
            joins = (awake and head == old) or send(head, node, r.invitation_bits, INVITATION, episode, r)
        else:
            joins = awake or spend(node, price, INVITATION, episode)
        if joins:
            chosen[n] = node  # n <= k: what is overwritten has been read
            n += 1
    for k in range(n):
        members[k] = chosen[k]
    standing.n_members = n
    return handed
