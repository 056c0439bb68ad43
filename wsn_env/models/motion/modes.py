"""Ways to move between which a target may switch, as a filter that does not know its motion supposes.

Interacting multiple models (Blom & Bar-Shalom, 1988): in every period the target keeps its mode or draws another. A
mode is white acceleration of its own sd about a straight line or a turn of constant rate.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from wsn_env.compiled.kernels import lean_piece
from wsn_env.models.motion.prediction import predict_covariance

DRAWS = 32  # equally likely outcomes of a mode that is drawn anew
STEPS = 2**14  # to which probabilities of leaving a mode are rounded


class Mode(NamedTuple):
    """A way to move."""

    name: str
    acceleration: float  # sd, in units of the manoeuvring one's
    turn: float  # to the left in a period [rad]
    leaves: float  # probability that it ends in a period
    draws: int  # of DRAWS, in which it is drawn


MODES = (  # found by trial on straight, turning, stopping and recorded motion (docs/filters.md)
    Mode("quiet", 0.031, 0.0, 0.021, 13),
    Mode("varying", 0.34, 0.0, 0.045, 11),
    Mode("turning_left", 0.17, 0.08, 0.08, 1),
    Mode("turning_right", 0.17, -0.08, 0.08, 1),
    Mode("manoeuvring", 1.0, 0.0, 0.11, 6),
)
COUNT = len(MODES)

# The same as kernels read it.
ACCELERATION = np.array([mode.acceleration for mode in MODES], np.float32)
SIN = np.sin([mode.turn for mode in MODES]).astype(np.float32)
LEAVES = np.array([round(mode.leaves * STEPS / DRAWS) * DRAWS for mode in MODES], np.int32)  # of STEPS
BEFORE = np.cumsum([0, *(mode.draws for mode in MODES[:-1])]).astype(np.int32)  # where in DRAWN each begins
_LASTING = np.array([mode.draws / mode.leaves for mode in MODES])
LONG_RUN = _LASTING / _LASTING.sum()  # each one's share of all periods
DRAWN = np.array([number for number, mode in enumerate(MODES) for _ in range(mode.draws)], np.int8)


@lean_piece
def mode_at(share: float, probabilities: np.ndarray) -> int:
    """The mode at a share in [0, 1) of all probability (COUNT,)."""
    for k in range(COUNT - 1):
        share -= probabilities[k]
        if share < 0.0:
            return k
    return COUNT - 1


@lean_piece
def next_mode(mode: Any, leaves: float, draw: float) -> Any:
    """The mode of the next period; two numbers from [0, 1) say whether the target leaves its own, and for which."""
    return mode if leaves * STEPS >= LEAVES[mode] else np.int64(DRAWN[np.int64(draw * DRAWS)])


@lean_piece
def advance_in_mode(mode: int, state: np.ndarray, period_s: float, ax: float, ay: float, out: np.ndarray) -> None:
    """v' = R v + T a and x' = x + T (v + v') / 2, the acceleration in units of the manoeuvring mode's."""
    sin, step = SIN[mode], period_s * ACCELERATION[mode]
    cos = np.sqrt(1.0 - sin * sin)
    out[1] = cos * state[1] - sin * state[3] + step * ax
    out[3] = sin * state[1] + cos * state[3] + step * ay
    out[0] = state[0] + 0.5 * period_s * (state[1] + out[1])
    out[2] = state[2] + 0.5 * period_s * (state[3] + out[3])


@lean_piece
def predict_mixture(
    mean: np.ndarray, cov: np.ndarray, probabilities: np.ndarray, t: Any, predicted_mean: Any, predicted_cov: Any
) -> None:
    """Moments of the target in the next period, over its modes.

    sum_k p_k F_k x and F P F' + q^2 G G' + the spread of F_k x, with q^2 = sum_k p_k q_k^2 and F for straight motion;
    that some modes go with some states is left out.

    Args:
        mean, cov: (4,), (4, 4) of the present state.
        probabilities: (COUNT,) of the modes in which it goes on.
        t: the constants of tracking.
    """
    squares, cos, sin, sines = 0.0, 0.0, 0.0, 0.0
    for k in range(COUNT):
        squares += probabilities[k] * (t.manoeuvre_q * ACCELERATION[k]) ** 2
        cos += probabilities[k] * np.sqrt(1.0 - SIN[k] * SIN[k])
        sin += probabilities[k] * SIN[k]
        sines += probabilities[k] * SIN[k] * SIN[k]
    half, vx, vy = 0.5 * t.period_s, mean[1], mean[3]
    turned = cos * vx - sin * vy, sin * vx + cos * vy
    predicted_mean[0], predicted_mean[1] = mean[0] + half * (vx + turned[0]), turned[0]
    predicted_mean[2], predicted_mean[3] = mean[2] + half * (vy + turned[1]), turned[1]
    predict_covariance(cov, t.period_s, np.sqrt(squares), predicted_cov)
    spread = max(sines - sin * sin, 0.0)  # of the turn, which moves the velocity across itself
    across = (-half * vy, -vy, half * vx, vx)
    for i in range(4):
        for j in range(4):
            predicted_cov[i, j] += spread * across[i] * across[j]
