"""Particles that switch between motion modes, so that the filter finds out how the target moves.

Each particle has a mode of its own, which it keeps or draws anew in every period; weights and resampling decide which
modes live on (McGinnity & Irwin, Multiple model bootstrap filter for maneuvering target tracking, 2000).
"""

from typing import Any

import numpy as np
from numba import int32, uint64

from wsn_env.compiled import draws
from wsn_env.compiled.draws import normal_pair32
from wsn_env.compiled.elementary import F
from wsn_env.compiled.kernels import lean_piece
from wsn_env.models.motion.modes import ACCELERATION, BEFORE, COUNT, DRAWN, DRAWS, LEAVES, SIN

WHOLE = 2**30  # all weights together at most


@lean_piece
def predict_by_mode(stream: Any, x: np.ndarray, modes: np.ndarray, t: Any) -> None:
    """Every particle goes on in its mode, v' = R v + T a and x' = x + T (v + v') / 2, and gets that of the next period.

    Args:
        x: (4, P), moved in place.
        modes: (P,) int8, theirs.
        t: the constants of tracking.
    """
    px, vx, py, vy = x[0], x[1], x[2], x[3]
    step, half = F(t.period_s * t.manoeuvre_q), F(0.5 * t.period_s)
    for i in range(x.shape[1]):
        h = draws.bits(stream, i)
        ax, ay = normal_pair32(h)
        mode, leaves, q, sin = int32(modes[i]), int32(0), F(0), F(0)
        for k in range(COUNT):  # selects: a table would have to be read number by number
            leaves += LEAVES[k] * int32(mode == k)
            q += ACCELERATION[k] * F(mode == k)
            sin += SIN[k] * F(mode == k)
        cos = F(1) - F(0.5) * sin * sin * (F(1) + F(0.25) * sin * sin)
        nx = cos * vx[i] - sin * vy[i] + step * q * ax
        ny = sin * vx[i] + cos * vy[i] + step * q * ay
        px[i] += half * (vx[i] + nx)
        py[i] += half * (vy[i] + ny)
        vx[i] = nx
        vy[i] = ny
        u = int32((h >> uint64(24)) & uint64(0xFF)) | (int32(h >> uint64(58)) << int32(8))  # bits that the pair leaves
        another = int32(-1)
        for k in range(COUNT):
            another += int32((u & int32(DRAWS - 1)) >= BEFORE[k])
        modes[i] = np.int8(mode + (another - mode) * int32(u < leaves))


@lean_piece
def note_modes(modes: np.ndarray, weights: np.ndarray, probabilities: np.ndarray) -> None:
    """Fill in the probabilities (COUNT,) of the modes in which the target goes on, from the particles' weights.

    Left as they are where particles have no modes.
    """
    n, least = len(modes), 1.0 / WHOLE
    scale = F(WHOLE // max(n, 1))  # as whole numbers weights add up in any order
    for k in range(COUNT if n > 0 else 0):
        mass = int32(0)
        for i in range(n):
            mass += int32(weights[i] * scale) * int32(modes[i] == k)
        probabilities[k] = np.float64(mass) * least
    total = 0.0
    for k in range(COUNT):
        total += probabilities[k]
    for k in range(COUNT if n > 0 and total > 0.0 else 0):
        probabilities[k] /= total


@lean_piece
def inherit_modes(modes: np.ndarray, ancestors: np.ndarray, scratch: np.ndarray) -> None:
    """Give every particle its ancestor's mode.

    Args:
        scratch: (P,) int32.
    """
    for i in range(len(modes)):
        scratch[i] = modes[ancestors[i]]
    for i in range(len(modes)):
        modes[i] = np.int8(scratch[i])


@lean_piece
def allot_modes(modes: np.ndarray, probabilities: np.ndarray) -> None:
    """Of a target of which nothing is known: as if every particle's were drawn, in turn."""
    for k in range(COUNT if len(modes) > 0 else 0):
        probabilities[k] = 0.0
    for i in range(len(modes)):
        modes[i] = DRAWN[(13 * i) % DRAWS]
        probabilities[modes[i]] += 1.0 / len(modes)
