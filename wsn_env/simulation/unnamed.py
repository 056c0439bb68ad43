"""Where no report says of which target it is: all that a node measures, of targets and of none."""

from typing import Any

import numpy as np

from wsn_env.compiled import draws
from wsn_env.compiled.elementary import exp
from wsn_env.compiled.kernels import lean_piece
from wsn_env.models.measurement.base import Occasion, news, node_at
from wsn_env.simulation import messages
from wsn_env.simulation.faults import DRAWS, target_not_there
from wsn_env.simulation.messages import Episode
from wsn_env.simulation.truth import memory_of, target_at

MOST_FALSE = 64  # false measurements, for which there are random numbers


@lean_piece
def in_doubt(episode: Episode, c: Any) -> bool:
    """Whether a report may be of something else than the row's target: it does not say it, and there is something."""
    return episode.state.reports.share.shape[1] > 0 and (episode.targets > 1 or c.clutter > 0.0)


@lean_piece
def sense_all(node: Any, head: Any, purpose: Any, episode: Episode, c: Any) -> None:
    """An awake node's period: it reports all that it measures, by the first number, in as many packets as it takes."""
    state, b, out = episode.state, episode.b, episode.out
    reports, sensor = state.reports, node_at(state.network.positions[b], node)
    start = reports.count[b]
    n, length = start, 0.0
    for k in range(episode.targets + false_measurements(node, episode, c)):
        there, occasion, x, y = sensed_thing(k, sensor, purpose == messages.SEARCH, episode, c)
        if there:
            measures, value, second, packets = news(c.measurement, memory_of(state, b), occasion, sensor, x, y, c)
            if measures:
                place = n
                while place > start and reports.value[b, place - 1, 0] > value:
                    reports.value[b, place, 0] = reports.value[b, place - 1, 0]
                    reports.value[b, place, 1] = reports.value[b, place - 1, 1]
                    place -= 1
                reports.value[b, place, 0], reports.value[b, place, 1] = value, second
                reports.node[b, n], reports.share[b, n] = node, 0.0
                n, length = n + 1, length + packets
    if n > start:
        out.detections += 1
        if messages.report(node, head, length, purpose, episode, c.radio):
            reports.count[b] = n
        else:
            forget(reports, b, start, n)


@lean_piece
def forget(reports: Any, b: int, start: int, stop: int) -> None:
    """Clear places of a row's list: what has not arrived nobody may read there."""
    for k in range(start, min(stop, reports.node.shape[1])):
        reports.node[b, k], reports.share[b, k] = 0, 0.0
        reports.value[b, k, 0], reports.value[b, k, 1] = 0.0, 0.0


@lean_piece
def false_measurements(node: Any, episode: Episode, c: Any) -> int:
    """How many a node makes in the period: Poisson's, but no more than there is room for."""
    if c.clutter <= 0.0:
        return 0
    state = episode.state
    room = min(state.reports.node.shape[1] // state.network.battery.shape[1] - episode.targets, MOST_FALSE)
    share = draws.uniform(_clutter_stream(episode), _first_draw(node))
    count, term = 0, exp(-c.clutter)
    below = term
    while share >= below and count < room:
        count += 1
        term *= c.clutter / count
        below += term
    return count


@lean_piece
def _clutter_stream(episode):
    return draws.stream(episode.state.key[episode.first], episode.state.row[episode.b].period, draws.CLUTTER)


@lean_piece
def _first_draw(node):
    return np.int64(node) * (MOST_FALSE * DRAWS + 1)


@lean_piece
def sensed_thing(k: int, sensor: Any, asked: bool, episode: Episode, c: Any) -> Any:
    """What a node may sense in a period: number k of the targets, then of the false ones.

    Targets that are too near to each other are one, the first of them, at their middle. All are where they are in the
    period of the episode's row: those of the others' rows may not have begun.

    Args:
        sensor: its Node.

    Returns: whether there is such a thing, an Occasion, its position (x, y) [m].
    """
    state, period, first = episode.state, episode.state.row[episode.b].period, episode.first
    if k >= episode.targets:
        draw = _first_draw(sensor.number) + 1 + (k - episode.targets) * DRAWS
        return target_not_there(_clutter_stream(episode), draw, sensor, asked, period, c)
    x, y, near = 0.0, 0.0, 0
    for s in range(k, episode.targets):
        if _one_with(s, episode, c) == k:
            at_x, at_y = target_at(state, first + s, period)
            x, y, near = x + at_x, y + at_y, near + 1
    return near > 0, Occasion(state.key[first + k], period, asked, period), x / max(near, 1), y / max(near, 1)


@lean_piece
def _one_with(s, episode, c):
    """The first target that target s is one with, by way of others; itself: none."""
    if c.resolution_m <= 0.0:
        return s
    state, first, period = episode.state, episode.first, episode.state.row[episode.b].period
    together, grown = 0, 1 << s  # sets of targets
    while grown != together:
        together = grown
        for a in range(episode.targets):
            for b in range(episode.targets):
                if together >> a & 1 and not together >> b & 1:
                    ax, ay = target_at(state, first + a, period)
                    bx, by = target_at(state, first + b, period)
                    if (ax - bx) ** 2 + (ay - by) ** 2 < c.resolution_m * c.resolution_m:
                        grown |= 1 << b
    lowest = 0
    while not together >> lowest & 1:
        lowest += 1
    return lowest
