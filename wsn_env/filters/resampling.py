"""Resampling: which particles live on, and where their further copies go, one row at a time.

Systematic resampling copies a particle in proportion to its weight. Copies of one particle stay together until the
process noise parts them; where there is little, the cloud shrinks to a few points and the target is lost. The improved
resampling of patent CN103152791 sets the further copies about their parent instead, in pairs.
"""

from typing import Any

import numpy as np
from numba import int32, uint32

from wsn_env.compiled import draws
from wsn_env.compiled.draws import normal_pair32
from wsn_env.compiled.elementary import F
from wsn_env.compiled.kernels import lean_piece

BLOCK = 8  # particles whose weights are summed apart
REACH = 16  # slots of the running maximum's widest window


@lean_piece
def resample(
    u: float,
    x: np.ndarray,
    log_weights: np.ndarray,
    weights: np.ndarray,
    total: float,
    slots: np.ndarray,
    states: np.ndarray,
) -> None:
    """Systematic resampling in place, without a search.

    Args:
        u: U[0, 1), the common offset of the slots.
        weights: (P,) summing to `total`.
        slots: (3, P + 16) int32 scratch, the first 16 of each are zeros.
        states: (2, P) complex128 scratch.
    """
    inherit(u, weights, total, slots[0], slots[1], slots[2])
    draw(x, slots[2, REACH:], states[0], states[1])
    log_weights[:] = F(0)


@lean_piece
def inherit(u: float, weights: np.ndarray, total: float, ended: Any, recent: np.ndarray, ancestors: np.ndarray) -> None:
    """Find every slot's ancestor: the particle after the last one that ends before the slot.

    Ends ascend, so of the particles that end at one place the last to be written stays. What is left is a running
    maximum: over 4 slots, over 16, and over all in strides of 16, in vectors (one number after the other it would be a
    branch that nobody can predict). Sums restart with every block, so that blocks need not wait for each other.

    Args:
        ended, recent: (P + 16,) scratch; 0 or one more than the last particle that ends there, from 3 and 12 on.
        ancestors: (P + 16,) filled from 16 on; 0 before.
    """
    n = len(weights)
    for k in range(n + 4):
        ended[k] = 0
    scale = np.float64(n) / total
    base = 1.0 - u
    last = int32(n)
    whole = (n - 1) // BLOCK * BLOCK
    for o in range(0, whole, BLOCK):
        cumulated = 0.0
        for k in range(BLOCK):
            cumulated += np.float64(weights[o + k]) * scale
            ended[uint32(3) + uint32(min(int32(base + cumulated), last))] = int32(o + k + 1)
        base += cumulated
    for i in range(whole, n - 1):
        base += np.float64(weights[i]) * scale
        ended[uint32(3) + uint32(min(int32(base), last))] = int32(i + 1)
    for k in range(n):
        recent[k + 12] = max(max(ended[k], ended[k + 1]), max(ended[k + 2], ended[k + 3]))
    for k in range(n):
        here = max(max(recent[k], recent[k + 4]), max(recent[k + 8], recent[k + 12]))
        ancestors[k + REACH] = max(here, ancestors[k])


@lean_piece
def draw(x: np.ndarray, ancestors: np.ndarray, states: np.ndarray, drawn: np.ndarray) -> None:
    """Replace every particle by its ancestor; its four numbers move as one of 16 bytes."""
    n = x.shape[1]
    px, vx, py, vy = x[0], x[1], x[2], x[3]
    before, after = states.view(np.float32), drawn.view(np.float32)
    for i in range(n):
        before[4 * i] = px[i]
        before[4 * i + 1] = vx[i]
        before[4 * i + 2] = py[i]
        before[4 * i + 3] = vy[i]
    for k in range(n):
        drawn[k] = states[uint32(ancestors[k])]  # unsigned: no wrap-around to provide for
    for k in range(n):
        px[k] = after[4 * k]
        vx[k] = after[4 * k + 1]
        py[k] = after[4 * k + 2]
        vy[k] = after[4 * k + 3]


@lean_piece
def spread_copies(stream: Any, ancestors: np.ndarray, scale: float, cov: np.ndarray, x: np.ndarray) -> None:
    """Set the further copies of every particle about it, in pairs that leave the mean where it is.

        n = 2m + 1 copies    x, x +- j S, j = 1..m
        n = 2m               x, x, x +- j S, j = 1..m - 1

    with S = scale L u, L L' = cov and u ~ N(0, I) drawn for each parent. So 2n copies bring 2 (n - 1) new particles, as
    the patent says, and those of a parent have m (m + 1) / 3 or (m - 1)(2m - 1) / 6 times S S' about it.

    Differs from the patent, which has one S for all: `spread_copies_alike`.

    Args:
        ancestors: (P,) in ascending order.
        cov: (4, 4) of the cloud before it was resampled.
        x: (4, P) copies, spread in place.
    """
    root = lower_root(cov)
    n, start, size = x.shape[1], 0, F(scale)
    while start < n:
        parent = ancestors[start]
        stop = start + 1
        while stop < n and ancestors[stop] == parent:
            stop += 1
        pairs = (stop - start - 1) // 2
        if pairs > 0:
            _set_pairs(x, stop, pairs, size, correlated(stream, parent, root))
        start = stop


@lean_piece
def spread_copies_alike(ancestors: np.ndarray, scale: float, cov: np.ndarray, x: np.ndarray) -> None:
    """The same with one S for all parents, as the patent has it: scale times the sds of the four components.

    All further copies of a cloud then lie on parallel lines.

    Args:
        ancestors, cov, x: as for `spread_copies`.
    """
    n, start, size = x.shape[1], 0, F(scale)
    sds = F(np.sqrt(cov[0, 0])), F(np.sqrt(cov[1, 1])), F(np.sqrt(cov[2, 2])), F(np.sqrt(cov[3, 3]))
    while start < n:
        stop = start + 1
        while stop < n and ancestors[stop] == ancestors[start]:
            stop += 1
        _set_pairs(x, stop, (stop - start - 1) // 2, size, sds)
        start = stop


@lean_piece
def _set_pairs(x, stop, pairs, size, direction):
    """Move the last pairs of the copies that end at `stop` by +-1, 2, ... times `size` along a direction (4,)."""
    d0, d1, d2, d3 = direction
    for j in range(1, pairs + 1):
        far = size * F(j)
        for place, side in ((stop - 2 * j, far), (stop - 2 * j + 1, -far)):
            x[0, place] += side * d0
            x[1, place] += side * d1
            x[2, place] += side * d2
            x[3, place] += side * d3


@lean_piece
def lower_root(cov: np.ndarray) -> tuple[Any, ...]:
    """The ten entries, row by row, of the lower triangular L with L L' = cov (4, 4), in float32 (Cholesky).

    A direction in which the cloud has no extent, but for rounding, gets none.
    """
    l00, i0 = _pivot(cov[0, 0], cov[0, 0])
    l10, l20, l30 = cov[1, 0] * i0, cov[2, 0] * i0, cov[3, 0] * i0
    l11, i1 = _pivot(cov[1, 1] - l10 * l10, cov[1, 1])
    l21, l31 = (cov[2, 1] - l20 * l10) * i1, (cov[3, 1] - l30 * l10) * i1
    l22, i2 = _pivot(cov[2, 2] - l20 * l20 - l21 * l21, cov[2, 2])
    l32 = (cov[3, 2] - l30 * l20 - l31 * l21) * i2
    l33, _ = _pivot(cov[3, 3] - l30 * l30 - l31 * l31 - l32 * l32, cov[3, 3])
    return F(l00), F(l10), F(l11), F(l20), F(l21), F(l22), F(l30), F(l31), F(l32), F(l33)


@lean_piece
def _pivot(rest, variance):
    """Root of what is left of a variance, and its inverse; 0 and 0 where that is rounding."""
    if rest <= 1e-6 * variance or rest < 1e-30:
        return 0.0, 0.0
    root = np.sqrt(rest)
    return root, 1.0 / root


@lean_piece
def correlated(stream: Any, index: int, root: Any) -> tuple[Any, ...]:
    """L u with u ~ N(0, I), number `index` of a stream; four float32."""
    l00, l10, l11, l20, l21, l22, l30, l31, l32, l33 = root
    u0, u1 = normal_pair32(draws.bits(stream, 2 * index))
    u2, u3 = normal_pair32(draws.bits(stream, 2 * index + 1))
    return (
        l00 * u0,
        l10 * u0 + l11 * u1,
        l20 * u0 + l21 * u1 + l22 * u2,
        l30 * u0 + l31 * u1 + l32 * u2 + l33 * u3,
    )
