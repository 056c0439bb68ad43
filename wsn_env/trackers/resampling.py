"""Resampling: which particles live on, one row at a time."""

import numpy as np
from numba import int32, uint32

from wsn_env.compiling import lean_piece
from wsn_env.numerics import F

BLOCK = 8  # particles whose weights are summed apart
REACH = 16  # slots of the running maximum's widest window


@lean_piece
def resample(u, x, log_weights, weights, total, slots, states):
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
def inherit(u, weights, total, ended, recent, ancestors):
    """Find every slot's ancestor: the particle after the last one that ends before the slot.

    Ends ascend, so of the particles that end at one place the last to be written stays. What is left is a running
    maximum: over 4 slots, over 16, and over all in strides of 16, in vectors (one number after the other it would be a
    branch that nobody can foretell). Sums restart with every block, so that blocks need not wait for each other.

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
def draw(x, ancestors, states, drawn):
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
