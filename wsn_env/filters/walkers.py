"""Particles of a target that walks in a room: its velocity is an Ornstein-Uhlenbeck process, and walls reflect it."""

from typing import Any

import numpy as np

from wsn_env.compiled import draws
from wsn_env.compiled.draws import normal_pair32
from wsn_env.compiled.elementary import F
from wsn_env.compiled.kernels import lean_piece
from wsn_env.models.motion.prediction import ROUGHENING_M


@lean_piece
def scatter_walkers(
    stream: Any, x: np.ndarray, log_weights: np.ndarray, sd_ms: float, side_m: float, depth_m: float
) -> None:
    """Particles anywhere in the room, with any velocity."""
    n = x.shape[1]
    for i in range(n):
        x[0, i] = F(side_m * draws.uniform(stream, 4 * i))
        x[2, i] = F(depth_m * draws.uniform(stream, 4 * i + 1))
        vx, vy = normal_pair32(draws.bits(stream, 4 * i + 2))
        x[1, i], x[3, i] = F(sd_ms) * vx, F(sd_ms) * vy
    log_weights[:] = F(0)


@lean_piece
def walk(stream: Any, x: np.ndarray, t: Any) -> None:
    """One period of a walk: v' = a v + sd sqrt(1 - a^2) e, x' = x + T (v + v') / 2, reflected at the walls."""
    kept = F(t.velocity_kept)
    fresh = F(t.velocity_sd * np.sqrt(1.0 - t.velocity_kept * t.velocity_kept))
    half, rough = F(0.5 * t.period_s), F(ROUGHENING_M)
    n = x.shape[1]
    for axis in (0, 2):
        place, velocity = x[axis], x[axis + 1]
        wall = F(t.side_m if axis == 0 else t.depth_m)
        for i in range(n):
            e, shift = normal_pair32(draws.bits(stream, axis * n + i))
            before = velocity[i]
            after = kept * before + fresh * e
            moved = place[i] + half * (before + after) + rough * shift
            inside = min(max(moved if moved >= F(0) else -moved, F(0)), F(2) * wall)
            inside = F(2) * wall - inside if inside > wall else inside
            place[i] = inside
            velocity[i] = after if inside == moved else -after
