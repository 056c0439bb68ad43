"""The filter's motion: the target goes on, but for noise; at constant velocity (eqs. 6, 8), or walking in a room."""

from typing import Any

import numpy as np

from wsn_env.compiled.kernels import lean_piece, piece

ROUGHENING_M = 0.05  # what a walker's position is uncertain by beside its velocity


@piece
def advance(state: Any, period_s: float, ax: float, ay: float, out: np.ndarray) -> None:
    """Constant velocity with a constant acceleration over the period: F x + G a (eqs. 6, 8)."""
    half = 0.5 * period_s * period_s
    out[0] = state[0] + period_s * state[1] + half * ax
    out[1] = state[1] + period_s * ax
    out[2] = state[2] + period_s * state[3] + half * ay
    out[3] = state[3] + period_s * ay


@lean_piece
def predict_moments(
    mean: np.ndarray, cov: np.ndarray, t: Any, q: float, predicted_mean: np.ndarray, predicted_cov: np.ndarray
) -> None:
    """F x and F P F' + q^2 G G' (eq. 16).

    Differs from the paper: as printed, eq. 16 leaves out the spread of the particles, so that E would be constant.
    """
    for i in range(4):
        predicted_mean[i] = mean[i] + (t * mean[i + 1] if i % 2 == 0 else 0.0)
    predict_covariance(cov, t, q, predicted_cov)


@lean_piece
def predict_covariance(cov: np.ndarray, t: Any, q: float, predicted_cov: np.ndarray) -> None:
    """F P F' + q^2 G G'; also in place, since every entry is made of itself and of later ones."""
    for i in range(4):
        for j in range(4):
            p = cov[i, j]
            if i % 2 == 0:
                p += t * cov[i + 1, j]
            if j % 2 == 0:
                p += t * cov[i, j + 1]
                if i % 2 == 0:
                    p += t * t * cov[i + 1, j + 1]
            predicted_cov[i, j] = max(p, 0.0) if i == j else p
    gain = (0.5 * t * t, t)
    for axis in (0, 2):
        for i in range(2):
            for j in range(2):
                predicted_cov[axis + i, axis + j] += q * q * gain[i] * gain[j]


@lean_piece
def predict_walk(
    mean: np.ndarray, cov: np.ndarray, t: Any, predicted_mean: np.ndarray, predicted_cov: np.ndarray
) -> None:
    """F x and F P F' + Q of a walker: v' = a v + sd sqrt(1 - a^2) e, x' = x + T (v + v') / 2; without walls."""
    a, half = t.velocity_kept, 0.5 * t.period_s
    way = half * (1.0 + a)
    variance = (1.0 - a * a) * t.velocity_sd * t.velocity_sd
    noise = (half * half * variance + ROUGHENING_M * ROUGHENING_M, half * variance, variance)
    for axis in (0, 2):
        predicted_mean[axis] = mean[axis] + way * mean[axis + 1]
        predicted_mean[axis + 1] = a * mean[axis + 1]
        for other in (0, 2):
            pp, pv, vp, vv = cov[axis, other], cov[axis, other + 1], cov[axis + 1, other], cov[axis + 1, other + 1]
            predicted_cov[axis, other] = pp + way * (pv + vp) + way * way * vv
            predicted_cov[axis, other + 1] = a * (pv + way * vv)
            predicted_cov[axis + 1, other] = a * (vp + way * vv)
            predicted_cov[axis + 1, other + 1] = a * a * vv
        predicted_cov[axis, axis] += noise[0]
        predicted_cov[axis, axis + 1] += noise[1]
        predicted_cov[axis + 1, axis] += noise[1]
        predicted_cov[axis + 1, axis + 1] += noise[2]
