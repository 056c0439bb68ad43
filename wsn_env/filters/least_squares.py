"""Least squares in closed form: a Kalman update with one number, and the centre of a circle through nodes."""

from typing import Any

import numpy as np

from wsn_env.compiled.kernels import lean_piece

SINGULAR = 1e6  # condition number from which nodes stand in a line


@lean_piece
def scalar_update(mean: np.ndarray, cov: np.ndarray, h: Any, residual: float, variance: float) -> None:
    """Kalman update with one number z = h x + noise: K = P h / (h P h + r), x + K (z - h x), (I - K h) P.

    Args:
        mean, cov: (4,), (4, 4) updated in place.
        h: four numbers.
        residual: z - h x.
        variance: r of the noise, above 0.
    """
    g = _times(cov, 0, h), _times(cov, 1, h), _times(cov, 2, h), _times(cov, 3, h)
    s = h[0] * g[0] + h[1] * g[1] + h[2] * g[2] + h[3] * g[3] + variance
    for i in range(4):
        mean[i] += g[i] * residual / s
        for j in range(i, 4):
            cov[i, j] -= g[i] * g[j] / s
            cov[j, i] = cov[i, j]
        cov[i, i] = max(cov[i, i], 0.0)


@lean_piece
def _times(cov, i, h):
    return cov[i, 0] * h[0] + cov[i, 1] * h[1] + cov[i, 2] * h[2] + cov[i, 3] * h[3]


@lean_piece
def circle_centre(positions: np.ndarray, nodes: np.ndarray, radii_m: np.ndarray) -> tuple[Any, ...]:
    """Least-squares centre of circles of these radii about nodes: eqs. 3-8 over all pairs.

        x = 1/2 M^-1 sum (p_i - pbar) (|p_i|^2 - R_i^2),  M = sum (p_i - pbar) (p_i - pbar)'

    What all R_i^2 have in common drops out: equal radii need not be known.

    Differs from the paper only in form: this is the solution of its equations over all pairs, in one sum over nodes.

    Args:
        positions: (S, 2) m.
        nodes: (n,) which, n > 0.
        radii_m: (n,) R of each.

    Returns: x, y [m], the condition number of eq. 5's matrix, and the entries xx, xy, yy of M^-1 [1/m^2]; in a line the
        mean of the nodes, inf and zeros.
    """
    x, y = 0.0, 0.0
    for node in nodes:
        x += positions[node, 0] / len(nodes)
        y += positions[node, 1] / len(nodes)
    xx, xy, yy, u, v = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(len(nodes)):
        dx, dy = positions[nodes[i], 0] - x, positions[nodes[i], 1] - y
        square = dx * dx + dy * dy - (radii_m[i] * radii_m[i] - radii_m[0] * radii_m[0])
        xx += dx * dx
        xy += dx * dy
        yy += dy * dy
        u += dx * square
        v += dy * square
    determinant = xx * yy - xy * xy
    largest = 0.5 * (xx + yy) + np.sqrt(0.25 * (xx - yy) ** 2 + xy * xy)
    if determinant * SINGULAR**2 <= largest * largest:
        return x, y, np.inf, (0.0, 0.0, 0.0)
    inverse = yy / determinant, -xy / determinant, xx / determinant
    x += 0.5 * (inverse[0] * u + inverse[1] * v)
    y += 0.5 * (inverse[1] * u + inverse[2] * v)
    return x, y, largest / np.sqrt(determinant), inverse
