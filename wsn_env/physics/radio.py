"""What talking costs: sender and receiver pay for every try, a node gives no more than it has.

Reports may be lost and are tried again (assumption d of Xiang & Guo, 2013); control packets always arrive.
"""

import numpy as np

from wsn_env import draws
from wsn_env.compiling import lean_piece, piece
from wsn_env.physics.field import squared_distance

SENSING, HANDOVER, INVITATION, REPORT, BROADCAST, SEARCH = range(6)


@lean_piece
def spend(node, joules, purpose, battery, spent, energy):
    """Charge a node; what it cannot pay empties it. Returns whether it could pay in full."""
    before = battery[node]
    battery[node] = max(before - joules, 0.0)
    paid = before - battery[node]
    spent[node] += paid
    energy[purpose] += paid
    return before >= joules


@lean_piece
def transmission(bits, squared, c):
    """Energy of sending `bits` over a squared distance [J]: bits (e1 + e2 d^2), eq. 5."""
    return bits * (c.tx_j_per_bit + c.amplifier_j_per_bit_m2 * squared)


@lean_piece
def send(sender, receiver, bits, purpose, positions, battery, spent, energy, c):
    """One packet from node to node (eq. 5). Returns whether both could pay, so that it arrived if not lost."""
    squared = squared_distance(positions, sender, positions[receiver, 0], positions[receiver, 1])
    if battery[sender] <= 0.0 or not spend(sender, transmission(bits, squared, c), purpose, battery, spent, energy):
        return False
    return battery[receiver] > 0.0 and spend(receiver, bits * c.rx_j_per_bit, purpose, battery, spent, energy)


@lean_piece
def report(key, period, node, head, purpose, positions, battery, spent, energy, c):
    """A member's report with its retries. Returns whether the head has it; the head's own is free."""
    if node == head:
        return True
    stream = draws.stream(key, period, draws.SEARCH_PACKET if purpose == SEARCH else draws.PACKET)
    for attempt in range(c.tries):
        if not send(node, head, c.report_bits, purpose, positions, battery, spent, energy, c):
            return False
        if draws.uniform(stream, 16 * node + attempt) < c.packet_success:
            return True
    return False


@lean_piece
def broadcast(head, nodes, count, positions, battery, spent, energy, c):
    """The head's word to resample: one transmission as far as the farthest living member, who all pay to hear it."""
    farthest = -1.0
    for k in range(count):
        if battery[nodes[k]] > 0.0:
            squared = squared_distance(positions, nodes[k], positions[head, 0], positions[head, 1])
            farthest = max(farthest, squared)
    if farthest < 0.0 or battery[head] <= 0.0:
        return
    if spend(head, transmission(c.broadcast_bits, farthest, c), BROADCAST, battery, spent, energy):
        for k in range(count):
            if battery[nodes[k]] > 0.0:
                spend(nodes[k], c.broadcast_bits * c.rx_j_per_bit, BROADCAST, battery, spent, energy)


@piece
def standing_members(members, battery):
    """The chosen members in ascending order, each once and alive: moved to the front of `members`; their number.

    Entries of -1 are empty. Anything else that falls away is counted as dropped by the caller.
    """
    ordered = True
    last = np.int32(-1)
    for k in range(len(members)):
        if 0 <= members[k] <= last:
            ordered = False
            break
        last = max(last, members[k])
    if not ordered:
        members[:] = np.sort(members)
    count = 0
    last = np.int32(-1)
    for k in range(len(members)):
        node = members[k]
        if last < node < len(battery) and battery[node] > 0.0:
            members[count] = node
            count += 1
            last = node
    return count


@lean_piece
def form(head, chosen, count, network, b, spent, energy, c):
    """Make the chosen cluster the standing one: handover from the old head, invitations to new members.

    Only members that hear their invitation join.

    Args:
        head: the new head, alive.
        chosen: (M,) its first `count` entries are living members in ascending order, the head left out. Overwritten.

    Returns: whether the head's role was handed over.
    """
    positions, battery = network.positions[b], network.battery[b]
    old, members = network.head[b], network.members[b]
    changed = old != head
    handed = changed and old >= 0 and send(old, head, c.handover_bits, HANDOVER, positions, battery, spent, energy, c)
    n, j = 0, 0
    for k in range(count):
        node = chosen[k]
        while j < network.n_members[b] and members[j] < node:
            j += 1
        stands = not changed and j < network.n_members[b] and members[j] == node
        if stands or send(head, node, c.invitation_bits, INVITATION, positions, battery, spent, energy, c):
            chosen[n] = node  # n <= k: what is overwritten has been read
            n += 1
    for k in range(n):
        members[k] = chosen[k]
    network.head[b] = head
    network.n_members[b] = n
    return handed
