"""An awake node's period: what it senses, and the reports that its head gets."""

from typing import Any

import numpy as np

from wsn_env.compiled.kernels import lean_piece
from wsn_env.models.measurement.base import news, node_at, take_note
from wsn_env.simulation import messages
from wsn_env.simulation.faults import hold_back, what_is_sensed
from wsn_env.simulation.messages import Episode
from wsn_env.simulation.truth import memory_of
from wsn_env.simulation.unnamed import in_doubt, sense_all


@lean_piece
def wake(node: Any, purpose: Any, episode: Episode, r: Any) -> bool:
    """A node pays for being awake in this period, once for all targets. Returns whether it could."""
    state, b = episode.state, episode.b
    if state.residual_j[b, node] <= 0.0:
        return False
    for row in range(episode.first, b):  # whose periods have begun
        if is_awake(node, state.network, row):
            return True
    return messages.spend(node, r.awake_j, purpose, episode)


@lean_piece
def is_awake(node: Any, network: Any, row: int) -> bool:
    """Whether a node is in the standing cluster of a row."""
    found = node == network.row[row].head
    for k in range(network.row[row].n_members):
        found |= node == network.members[row, k]
    return found


@lean_piece
def sense(node: Any, head: Any, purpose: Any, target: Any, episode: Episode, c: Any) -> None:
    """An awake node's period: it reports what it has to tell, if anything."""
    state, b, out = episode.state, episode.b, episode.out
    if state.residual_j[b, node] <= 0.0:
        return
    if in_doubt(episode, c):
        sense_all(node, head, purpose, episode, c)
        return
    sensor = node_at(state.network.positions[b], node)
    occasion, x, y = what_is_sensed(state, b, sensor, purpose == messages.SEARCH, target, c)
    has_news, value, second, packets = news(c.measurement, memory_of(state, b), occasion, sensor, x, y, c)
    if not has_news:
        return
    out.detections += 1
    is_heads = c.radio.to_head and node == head
    sends, report = hold_back(state, b, node, (value, second, packets), is_heads)
    if sends and messages.report(node, head, report[2], purpose, episode, c.radio):
        _take_report(state.reports.count[b], node, report, episode, c)


@lean_piece
def _take_report(slot, node, report, episode, c):
    """The head has a report, which stands at a place in the list."""
    state, b = episode.state, episode.b
    reports, (value, second, _) = state.reports, report
    reports.node[b, slot] = node
    reports.value[b, slot, 0] = value
    reports.value[b, slot, 1] = second
    if reports.share.shape[1] > 0:
        reports.share[b, slot] = 1.0
    reports.count[b] += 1
    take_note(c.measurement, memory_of(state, b), node, value)


@lean_piece
def send_late(head: Any, episode: Episode, c: Any) -> None:
    """What has waited since the last period is sent, by nodes that have made nothing newer; each to its place."""
    state, b = episode.state, episode.b
    condition, reports, slot = state.condition[b], state.reports, 0
    for number in range(len(condition)):
        own, node = condition[number], np.int64(number)
        while slot < reports.count[b] and reports.node[b, slot] < node:
            slot += 1
        waits = own.waiting > 0 and own.waiting == state.row[b].period - 1 and state.residual_j[b, node] > 0.0
        if waits:
            own.waiting = 0
        if waits and messages.report(node, head, own.packets, messages.REPORT, episode, c.radio):
            for k in range(reports.count[b], slot, -1):
                reports.node[b, k] = reports.node[b, k - 1]
                reports.value[b, k, 0] = reports.value[b, k - 1, 0]
                reports.value[b, k, 1] = reports.value[b, k - 1, 1]
            _take_report(slot, node, (own.value[0], own.value[1], own.packets), episode, c)
