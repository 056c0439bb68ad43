"""How a search finds a lost target where no report says of which target it is: among others, and among false ones."""

from typing import Any

import numpy as np

from wsn_env.compiled.elementary import log
from wsn_env.compiled.kernels import lean_piece
from wsn_env.models.association.base import is_of_target
from wsn_env.models.association.fit import (
    GOLDEN_COS,
    GOLDEN_SIN,
    LOST,
    POINTS,
    cell_variance,
    false_density,
    fit,
)
from wsn_env.models.detection.base import MOST, probability
from wsn_env.models.field import squared_distance
from wsn_env.models.measurement.base import PositionBelief, news, node_at
from wsn_env.simulation.geometry import cells_within
from wsn_env.simulation.messages import Episode
from wsn_env.simulation.truth import memory_of
from wsn_env.simulation.unnamed import false_measurements, forget, sensed_thing


@lean_piece
def list_strange(sensor: Any, count: int, rows: np.ndarray, found: np.ndarray, episode: Episode, c: Any) -> int:
    """In a search, add to a list what a node measures and no other target explains.

    The list stands where the reports will: nodes, values, and for shares the densities of false measurements there.

    Args:
        sensor: its Node.
        count: how long the list is.
        rows, found: (B,) bool, which search, and which of them have found theirs.

    Returns: how long it is then.
    """
    state, b = episode.state, episode.b
    reports = state.reports
    for k in range(episode.targets + false_measurements(sensor.number, episode, c)):
        there, occasion, x, y = sensed_thing(k, sensor, True, episode, c)
        if there:
            measures, value, second, _ = news(c.measurement, memory_of(state, b), occasion, sensor, x, y, c)
            reports.value[b, count, 0], reports.value[b, count, 1] = value, second
            if measures and _is_strange(sensor, reports.value[b, count], rows, found, episode, c):
                reports.node[b, count] = sensor.number
                reports.share[b, count] = _density_of_false(sensor, reports.value[b, count], c)
                count += 1
    return count


@lean_piece
def _is_strange(sensor, value, rows, found, episode, c):
    """Whether a measurement fits no other target of the field, of those that are not lost."""
    for row in range(episode.first, episode.first + episode.targets):
        if row != episode.b and (found[row] or not rows[row]):
            mean, cov = episode.state.belief.row[row].mean, episode.state.belief.row[row].cov
            track = PositionBelief(mean[0], mean[2], cov[0, 0], cov[0, 2], cov[2, 2])
            if fit(sensor, value, track, c).squares <= c.association_sds * c.association_sds:
                return False
    return True


@lean_piece
def _density_of_false(sensor, value, c):
    return (c.clutter + LOST) * false_density(sensor, value, c)


@lean_piece
def best_supported(count: int, episode: Episode, c: Any) -> Any:
    """Of the nodes in a list the one next to which a target would explain most of it; -1: the list is empty.

    What is true is measured by several nodes alike, what is false by one. The list is cleared.
    """
    state, b = episode.state, episode.b
    best, most = np.int64(-1), -np.inf
    for k in range(count):
        node: Any = np.int64(state.reports.node[b, k])
        if k == 0 or node != state.reports.node[b, k - 1]:
            support, _, _ = _best_point(node, count, episode, c)
            if support > most:
                best, most = node, support
    forget(state.reports, b, 0, count + 1)  # one more has been tried
    return best


@lean_piece
def mark_supported(head: Any, rows: np.ndarray, found: np.ndarray, episode: Episode, c: Any) -> None:
    """Of all that has been reported after a search, the target's is what the best point next to the new head explains
    and no other target does, of each node one measurement at most."""
    state, b = episode.state, episode.b
    reports, positions = state.reports, state.network.positions[b]
    for k in range(reports.count[b]):
        sensor, value = node_at(positions, reports.node[b, k]), reports.value[b, k]
        strange = _is_strange(sensor, value, rows, found, episode, c)
        reports.share[b, k] = _density_of_false(sensor, value, c) if strange else np.inf
    _, x, y = _best_point(head, reports.count[b], episode, c)
    start = 0
    while start < reports.count[b]:
        stop, odds, best, highest = start, 0.0, start, -1.0
        while stop < reports.count[b] and reports.node[b, stop] == reports.node[b, start]:
            own = _odds(stop, x, y, episode, c)
            odds += own
            if own > highest:
                best, highest = stop, own
            reports.share[b, stop] = 0.0
            stop += 1
        if odds > 1.0:
            reports.share[b, best] = 1.0
        start = stop


@lean_piece
def nearest_of_target(episode: Episode) -> Any:
    """Of the nodes whose reports are the target's the one nearest to the estimate."""
    state, b = episode.state, episode.b
    mean, nearest, least = state.belief.row[b].mean, np.int64(-1), np.inf
    for k in range(state.reports.count[b]):
        if is_of_target(state.reports, b, k):
            node: Any = np.int64(state.reports.node[b, k])
            squared = squared_distance(state.network.positions[b], node, mean[0], mean[2])
            if squared < least:
                nearest, least = node, squared
    return nearest


@lean_piece
def _best_point(node, count, episode, c):
    """Of points within a node's sensing radius that where a target best explains a list, and the silence of who is not
    in it: log of the odds, x, y [m]."""
    place, reports = episode.state.network.positions[episode.b, node], episode.state.reports
    best, best_x, best_y, cos, sin = -np.inf, place[0], place[1], 1.0, 0.0
    for i in range(POINTS):
        far = c.radius_m * np.sqrt((i + 0.5) / POINTS)
        x, y = place[0] + far * cos, place[1] + far * sin
        support, odds = _log_silence(x, y, episode, c), 0.0
        for k in range(count):
            if k > 0 and reports.node[episode.b, k] != reports.node[episode.b, k - 1]:
                support, odds = support + log(1.0 + odds), 0.0
            odds += _odds(k, x, y, episode, c)  # a node measures a target once at most
        support += log(1.0 + odds)
        if support > best:
            best, best_x, best_y = support, x, y
        cos, sin = cos * GOLDEN_COS - sin * GOLDEN_SIN, sin * GOLDEN_COS + cos * GOLDEN_SIN
    return best, best_x, best_y


@lean_piece
def _log_silence(x, y, episode, c):
    """Log of the probability that no node would detect a target at a point."""
    network, b, total = episode.state.network, episode.b, 0.0
    place, starts, nodes = network.grid.row[b], network.grid.starts[b], network.grid.nodes[b]
    first, last, left, right = cells_within(place, x, y, c.radius_m)
    for line in range(first, last + 1):
        for slot in range(starts[line * place.side + left], starts[line * place.side + right + 1]):
            squared = squared_distance(network.positions[b], nodes[slot], x, y)
            if squared <= c.radius_m * c.radius_m and network.battery[b, nodes[slot]] > 0.0:
                total += log(1.0 - min(probability(c.detection, c.measurement, np.sqrt(squared)), MOST))
    return total


@lean_piece
def _odds(k, x, y, episode, c):
    """How much likelier entry k of a list is of a target at a point than of none, over its node's silence.

    The density of false ones stands in its share.
    """
    reports, positions, b = episode.state.reports, episode.state.network.positions[episode.b], episode.b
    squared = squared_distance(positions, reports.node[b, k], x, y)
    if squared > c.radius_m * c.radius_m:
        return 0.0
    sensor, variance = node_at(positions, reports.node[b, k]), cell_variance(c)
    density = fit(sensor, reports.value[b, k], PositionBelief(x, y, variance, 0.0, variance), c).density
    seen = min(probability(c.detection, c.measurement, np.sqrt(squared)), MOST)
    return seen / (1.0 - seen) * density / max(reports.share[b, k], 1e-300)
