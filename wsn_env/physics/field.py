"""Where the nodes stand, and which are near."""

import numpy as np

from wsn_env import draws
from wsn_env.compiling import lean_kernel, lean_piece, piece


@piece
def scatter(stream, side_m, positions):
    """Draw the positions (S, 2) uniformly in the square [m]."""
    for i in range(len(positions)):
        positions[i, 0] = side_m * draws.uniform(stream, 2 * i)
        positions[i, 1] = side_m * draws.uniform(stream, 2 * i + 1)


@lean_piece
def squared_distance(positions, i, x, y):
    """Squared distance of node i to (x, y) [m^2]."""
    dx = positions[i, 0] - x
    dy = positions[i, 1] - y
    return dx * dx + dy * dy


@lean_piece
def nearest_living(positions, battery, x, y):
    """The living node nearest to (x, y); the lower index wins a tie; -1: none is alive."""
    best, shortest = -1, np.inf
    for i in range(len(battery)):
        d2 = squared_distance(positions, i, x, y)
        if d2 < shortest and battery[i] > 0.0:
            best, shortest = i, d2
    return best


@lean_piece
def nearest_candidates(positions, battery, x, y, nodes, distances):
    """The K living nodes nearest to (x, y) in order of distance.

    Args:
        nodes: (K,) filled with indices, -1 where fewer are alive.
        distances: (K,) filled with metres, inf where there is none.
    """
    size = len(nodes)
    nodes[:] = -1
    distances[:] = np.inf
    for i in range(len(battery)):
        d2 = squared_distance(positions, i, x, y)
        if d2 < distances[size - 1] and battery[i] > 0.0:
            k = size - 1
            while k > 0 and distances[k - 1] > d2:
                distances[k] = distances[k - 1]
                nodes[k] = nodes[k - 1]
                k -= 1
            distances[k] = d2
            nodes[k] = i
    for k in range(size):
        distances[k] = np.sqrt(distances[k])


@lean_kernel
def _nearest_rows(start, stop, positions, battery, points, nodes, distances):
    for b in range(start, stop):
        nearest_candidates(positions[b], battery[b], points[b, 0], points[b, 1], nodes[b], distances[b])


def nearest(positions, battery, points, count: int):
    """The living nodes nearest to a point, for every row.

    Args:
        positions: (B, S, 2) m.
        battery: (B, S) J.
        points: (B, 2) m.
        count: K.

    Returns: (B, K) indices in order of distance, -1 where fewer are alive; (B, K) distances in m, inf there.
    """
    rows = len(positions)
    nodes, distances = np.empty((rows, count), np.int64), np.empty((rows, count))
    _nearest_rows(0, rows, positions, battery, np.ascontiguousarray(points, np.float64), nodes, distances)
    return nodes, distances


def distances_to(positions, points):
    """Distances (B, S) in m of all nodes to one point a row (B, 2)."""
    dx = positions[..., 0] - points[:, None, 0]
    dy = positions[..., 1] - points[:, None, 1]
    return np.sqrt(dx * dx + dy * dy)
