"""Which nodes are near: a grid of cells for every field."""

from typing import Any

import numpy as np

from wsn_env.compiled.kernels import lean_kernel, lean_piece, over_rows
from wsn_env.models.field import squared_distance
from wsn_env.models.state import network_at


@lean_piece
def index_nodes(positions: np.ndarray, grid: Any, b: int) -> None:
    """Sort the nodes (S, 2) of row b into cells, by their numbers within each: a counting sort."""
    place, starts, nodes = grid.row[b], grid.starts[b], grid.nodes[b]
    x0, x1, y0, y1 = np.inf, -np.inf, np.inf, -np.inf
    for i in range(len(positions)):
        x0, x1 = min(x0, positions[i, 0]), max(x1, positions[i, 0])
        y0, y1 = min(y0, positions[i, 1]), max(y1, positions[i, 1])
    place.x_m, place.y_m = x0, y0
    place.cell_m = max(x1 - x0, y1 - y0, 1e-9) / place.side
    starts[:] = 0
    for i in range(len(positions)):
        starts[_cell(positions, i, place) + 1] += 1
    for cell in range(1, len(starts)):
        starts[cell] += starts[cell - 1]
    for i in range(len(positions)):
        cell = _cell(positions, i, place)
        nodes[starts[cell]] = i
        starts[cell] += 1  # at last where the next cell starts
    for cell in range(len(starts) - 1, 0, -1):
        starts[cell] = starts[cell - 1]
    starts[0] = 0


@lean_piece
def _cell(positions, i, place):
    return _along(positions[i, 1] - place.y_m, place) * place.side + _along(positions[i, 0] - place.x_m, place)


@lean_piece
def _along(offset, place):
    """Column or line of the grid at an offset from its corner [m], the border's where it lies outside."""
    return int(min(max(offset / place.cell_m, 0.0), place.side - 1.0))


@lean_piece
def cells_within(place: Any, x: float, y: float, reach_m: float) -> tuple[Any, ...]:
    """First and last line, first and last column of the cells that hold every node nearer than this to (x, y)."""
    x, y = x - place.x_m, y - place.y_m
    lines = _along(y - reach_m, place), _along(y + reach_m, place)
    return lines[0], lines[1], _along(x - reach_m, place), _along(x + reach_m, place)


@lean_piece
def energy_about(network: Any, b: int, x: float, y: float, reach_m: float) -> float:
    """Energy in the batteries of row b about a point [J]: a node at the distance d counts as 1 - (d / reach)^2."""
    positions, battery, grid = network.positions[b], network.battery[b], network.grid
    place, starts, nodes = grid.row[b], grid.starts[b], grid.nodes[b]
    lines = cells_within(place, x, y, reach_m)
    total = 0.0
    for line in range(lines[0], lines[1] + 1):
        for slot in range(starts[line * place.side + lines[2]], starts[line * place.side + lines[3] + 1]):
            d2 = squared_distance(positions, nodes[slot], x, y)
            total += battery[nodes[slot]] * max(1.0 - d2 / (reach_m * reach_m), 0.0)
    return total


@lean_piece
def nearest_living(positions: np.ndarray, battery: np.ndarray, x: float, y: float) -> int:
    """The living node nearest to (x, y); the lower index wins a tie; -1: none is alive. Looks at all of them."""
    best, shortest = -1, np.inf
    for i in range(len(battery)):
        d2 = squared_distance(positions, i, x, y)
        if d2 < shortest and battery[i] > 0.0:
            best, shortest = i, d2
    return best


@lean_piece
def nearest_candidates(network: Any, b: int, x: float, y: float, nodes: np.ndarray, distances: np.ndarray) -> None:
    """The K living nodes of row b nearest to (x, y) in order of distance; the lower index wins a tie.

    Looks at rings of cells about the point until none further out can hold a nearer node, so that the time does not
    depend on the number of nodes.

    Args:
        nodes: (K,) filled with indices, -1 where fewer are alive.
        distances: (K,) filled with metres, inf where there is none.
    """
    positions, battery, grid = network.positions[b], network.battery[b], network.grid
    place, starts, sorted_nodes = grid.row[b], grid.starts[b], grid.nodes[b]
    side = place.side
    column, line = _along(x - place.x_m, place), _along(y - place.y_m, place)
    nodes[:] = -1
    distances[:] = np.inf
    last = min(len(nodes), network.row[b].alive) - 1
    for ring in range(side):
        for i in range(max(line - ring, 0), min(line + ring, side - 1) + 1):
            stride = 1 if abs(i - line) == ring else 2 * ring  # else only the ring's two ends are new
            for j in range(column - ring, column + ring + 1, stride):
                if 0 <= j < side:
                    for slot in range(starts[i * side + j], starts[i * side + j + 1]):
                        node: Any = np.int64(sorted_nodes[slot])
                        d2 = squared_distance(positions, node, x, y)
                        if d2 <= distances[-1] and battery[node] > 0.0:
                            _insert(node, d2, nodes, distances)
        if last < 0 or distances[last] < 0.999999 * _beyond(ring, column, line, x - place.x_m, y - place.y_m, place):
            break
    for k in range(len(nodes)):
        distances[k] = np.sqrt(distances[k])


@lean_piece
def _insert(node, d2, nodes, distances):
    """Into the list in order of distance, if it is nearer than the last."""
    k = len(nodes) - 1
    if d2 == distances[k] and node > nodes[k]:
        return
    while k > 0 and (distances[k - 1] > d2 or (distances[k - 1] == d2 and nodes[k - 1] > node)):
        distances[k] = distances[k - 1]
        nodes[k] = nodes[k - 1]
        k -= 1
    distances[k] = d2
    nodes[k] = node


@lean_piece
def _beyond(ring, column, line, x, y, place):
    """Squared distance [m^2] that every node outside the rings looked at keeps from the point (x, y), given from the
    grid's corner."""
    width = place.side * place.cell_m
    beside = (max(-x, x - width, 0.0), max(-y, y - width, 0.0))  # of a point outside the grid
    nearest = np.inf
    for at, centre, across in ((x, column, beside[1]), (y, line, beside[0])):
        if centre - ring > 0:
            nearest = min(nearest, max(at - (centre - ring) * place.cell_m, 0.0) ** 2 + across**2)
        if centre + ring < place.side - 1:
            nearest = min(nearest, max((centre + ring + 1) * place.cell_m - at, 0.0) ** 2 + across**2)
    return nearest


@lean_piece
def ring_candidates(
    network: Any, b: int, x: float, y: float, ring_m: float, nodes: np.ndarray, distances: np.ndarray
) -> None:
    """The K living nodes of row b nearest to a ring of this radius [m] about (x, y), in order of that; the lower index
    wins a tie. Looks at all nodes.

    Args:
        nodes, distances: as for `nearest_candidates`; distances are to the point.
    """
    positions, battery = network.positions[b], network.battery[b]
    nodes[:] = -1
    distances[:] = np.inf
    for node in range(len(battery)):
        offset = np.sqrt(squared_distance(positions, node, x, y)) - ring_m
        if battery[node] > 0.0 and offset * offset <= distances[-1]:
            _insert(node, offset * offset, nodes, distances)
    for k in range(len(nodes)):
        if nodes[k] >= 0:
            distances[k] = np.sqrt(squared_distance(positions, nodes[k], x, y))


@lean_kernel
def _nearest_rows(start, stop, network_handle, points, ring_m, nodes, distances):
    network = network_at(network_handle)
    for b in range(start, stop):
        find_candidates(network, b, points[b, 0], points[b, 1], ring_m, nodes[b], distances[b])


@lean_piece
def find_candidates(
    network: Any, b: int, x: float, y: float, ring_m: float, nodes: np.ndarray, distances: np.ndarray
) -> None:
    """`nearest_candidates` for a ring of radius 0, else `ring_candidates`."""
    if ring_m > 0.0:
        ring_candidates(network, b, x, y, ring_m, nodes, distances)
    else:
        nearest_candidates(network, b, x, y, nodes, distances)


@lean_kernel
def _index_rows(start, stop, network_handle):
    network = network_at(network_handle)
    for b in range(start, stop):
        index_nodes(network.positions[b], network.grid, b)


def index(network: Any) -> None:
    """Fill the grid of every row by the positions (B, S, 2)."""
    _index_rows(0, len(network.positions), network.handle)


def nearest(network: Any, points: np.ndarray, count: int, ring_m: float = 0.0, threads: int = 1) -> tuple[Any, ...]:
    """The living nodes nearest to a point, or to a ring about it, for every row.

    Args:
        network: with its grid.
        points: (B, 2) m.
        count: K.
        ring_m: radius of the ring; 0: the point itself.

    Returns: (B, K) indices in order of nearness, -1 where fewer are alive; (B, K) distances to the point [m], inf
    there.
    """
    rows = len(points)
    nodes, distances = np.empty((rows, count), np.int64), np.empty((rows, count))
    points = np.ascontiguousarray(points, np.float64)
    over_rows(_nearest_rows, rows, threads, network.handle, points, float(ring_m), nodes, distances)
    return nodes, distances


def distances_to(positions: np.ndarray, points: np.ndarray) -> Any:
    """Distances (B, S) in m of all nodes to one point a row (B, 2)."""
    dx = positions[..., 0] - points[:, None, 0]
    dy = positions[..., 1] - points[:, None, 1]
    return np.sqrt(dx * dx + dy * dy)
