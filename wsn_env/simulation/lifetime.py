"""How long a network lasts: deaths, the functional lifetime, and the energy that is left over.

A network is *functional* until the mean error of WINDOW periods first exceeds a sensing radius; errors count as at most
the scenario's `error_cap_m`. (Dietrich & Dressler, 2009, list such definitions.) What has not happened by the horizon
counts as happening at it, so that means are lower bounds.
"""

from typing import Any

import numpy as np

from wsn_env.compiled.kernels import lean_kernel, lean_piece
from wsn_env.models.state import State, state_at

METRICS = ("first_death", "half_dead", "functional", "tracked", "stranded_mj", "stranded_sd")


@lean_piece
def clear_life(state: Any, b: int) -> None:
    """Nothing has happened yet."""
    life = state.life[b]
    life.first_death, life.half_dead, life.functional, life.tracked, life.window_m = 0, 0, 0, 0, 0.0
    state.recent_m[b] = 0.0


@lean_piece
def count_life(state: Any, b: int, error_m: float, t: Any) -> None:
    """A period of row b with this error [m].

    Args:
        t: the scenario's constants of tracking.
    """
    period, life, recent_m = state.row[b].period, state.life[b], state.recent_m[b]
    if period == 0:
        return
    slot, counted = (period - 1) % len(recent_m), min(error_m, t.error_cap_m)
    life.window_m += counted - recent_m[slot]
    recent_m[slot] = counted
    if life.functional == 0 and period >= len(recent_m) and life.window_m > len(recent_m) * t.radius_m:
        life.functional = period
    life.tracked += error_m <= t.radius_m
    count_dead(state, b)


@lean_piece
def count_dead(state: Any, b: int) -> None:
    """Note the period, if in it the first node, or half of them, have died."""
    period, life = state.row[b].period, state.life[b]
    nodes, living = state.residual_j.shape[1], state.living[b]
    if period > 0 and life.first_death == 0 and living < nodes:
        life.first_death = period
    if period > 0 and life.half_dead == 0 and 2 * living <= nodes:
        life.half_dead = period


def lifetimes(state: State, periods: int) -> dict[str, np.ndarray]:
    """What an episode's end tells of its network, by name, (B,) each.

    Args:
        state: at the end.
        periods: the horizon.

    Returns: METRICS: the periods in which the first node, and half of them, had died, and in which the network ceased
        to be functional (the horizon, where it has not happened); the share of the periods whose error was at most a
        sensing radius; the energy left in all nodes together [mJ], and the standard deviation over the nodes of the
        share of their batteries.
    """
    life = state.life
    found = {name: np.where(life[name] > 0, life[name], periods) for name in METRICS[:3]}
    found["tracked"] = life["tracked"] / np.maximum(state.period, 1)
    left_j, sd_j = np.empty((2, state.rows))
    _take_stock(0, state.rows, state.handle, left_j, sd_j)
    return found | {"stranded_mj": 1e3 * left_j, "stranded_sd": sd_j / state.full_j}


@lean_kernel
def _take_stock(start: int, stop: int, handle: np.ndarray, left_j: np.ndarray, sd_j: np.ndarray) -> None:
    """Fill in the sum and the standard deviation of what is left in the nodes of each row."""
    state = state_at(handle)
    for b in range(start, stop):
        residual_j = state.residual_j[b]
        left_j[b] = _sum_of_powers(residual_j, 0.0, False)
        mean = left_j[b] / len(residual_j)
        sd_j[b] = np.sqrt(_sum_of_powers(residual_j, mean, True) / len(residual_j))


@lean_piece
def _sum_of_powers(values, centre, squared):
    """Of (value - centre), or of its square; in four sums, for a single one would wait for itself."""
    first, second, third, fourth = 0.0, 0.0, 0.0, 0.0
    n = len(values) // 4 * 4
    for i in range(0, n, 4):
        a, b, c, d = values[i] - centre, values[i + 1] - centre, values[i + 2] - centre, values[i + 3] - centre
        first += a * a if squared else a
        second += b * b if squared else b
        third += c * c if squared else c
        fourth += d * d if squared else d
    for i in range(n, len(values)):
        a = values[i] - centre
        first += a * a if squared else a
    return (first + second) + (third + fourth)
