"""What the text of Zhou, Cheng & Xing (2009) leaves open, tried in NumPy on the fields and tracks of the world.

Which pairs of boundary nodes eqs. 3-8 are written for, which sign the half-period shift has, and what the recursion of
eqs. 9-13 does as printed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from wsn_env.compiled import draws
from wsn_env.evaluation.rollout import FIRST_SEED
from wsn_env.papers.binary.systems import SIDE_M, SYSTEMS, VELOCITY_MS, Setting
from wsn_env.simulation.world import World

V = np.array(VELOCITY_MS)
CONDITION = 5.0  # snapshots that are worse conditioned say nothing about a reading
P0 = 1e4
SHIFTS = {  # signs of (T/2) v for nodes entered and left
    "+ entered, + left": (1, 1),
    "no shift": (0, 0),
    "- entered, - left": (-1, -1),
    "+ entered, - left": (1, -1),
    "- entered, + left": (-1, 1),
}


# --- how many nodes report ----------------------------------------------------------------------------------


def lens_m2(d: float, radius_m: float) -> float:
    """Area that two discs of this radius share whose centres lie d apart [m]."""
    if d >= 2 * radius_m:
        return 0.0
    return 2 * radius_m**2 * np.arccos(d / (2 * radius_m)) - d / 2 * np.sqrt(4 * radius_m**2 - d**2)


def detecting_nodes(nodes: int = 600, radius_m: float = 60.0) -> float:
    """Expected number of nodes that detect: rho pi R^2."""
    return nodes / SIDE_M**2 * np.pi * radius_m**2


def boundary_nodes(nodes: int = 600, radius_m: float = 60.0, period_s: float = 1.0) -> float:
    """Expected number of nodes that change their state in a period: 2 rho (pi R^2 - lens(|v| T))."""
    way = np.hypot(*V) * period_s
    return 2 * nodes / SIDE_M**2 * (np.pi * radius_m**2 - lens_m2(way, radius_m))


def transmitting_nodes(setting: Setting) -> float:
    """Expected number of nodes that transmit in a period, in closed form."""
    if SYSTEMS[setting.system].reports == "presence":
        return detecting_nodes(setting.nodes, setting.radius_m)
    return boundary_nodes(setting.nodes, setting.radius_m, setting.period_s)


def even_period_s(radius_m: float = 60.0) -> float:
    """The sampling period at which as many nodes change their state as detect."""
    return brentq(lambda t: boundary_nodes(1, radius_m, t) - detecting_nodes(1, radius_m), 0.1, radius_m / np.hypot(*V))


# --- snapshots ----------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Snapshots:
    """The fields and tracks of the runs, and which nodes the target is within reach of."""

    positions: np.ndarray  # (R, S, 2) m
    target: np.ndarray  # (R, K + 1, 2) m
    within: np.ndarray  # (R, K + 1, S) bool
    steady: np.ndarray  # (K,) bool, of periods 1..K

    def changed(self, run: int, k: int) -> tuple[np.ndarray, np.ndarray]:
        """The boundary nodes (n, 2) of period k, and which were entered (n,)."""
        now, before = self.within[run, k], self.within[run, k - 1]
        return self.positions[run][now != before], now[now != before]


def take_snapshots(runs: int) -> Snapshots:
    """Those of the systems' runs: same seeds, same fields."""
    setting = Setting("paper")
    keys = [draws.key_of_seed(FIRST_SEED + run) for run in range(runs)]
    state = World(setting.trial(runs).scenario).reset(keys)
    target = state.track[:, :, ::2]
    squared = ((target[:, :, None] - state.network.positions[:, None]) ** 2).sum(axis=-1)
    return Snapshots(state.network.positions, target, squared <= setting.radius_m**2, setting.steady)


Pairs = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]  # nodes (n, 2) -> indices i, j of the pairs


def all_pairs(p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Indices i < j of every pair of the nodes (n, 2)."""
    return np.triu_indices(len(p), 1)


def consecutive_pairs(p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Each node and the next."""
    return np.arange(len(p) - 1), np.arange(1, len(p))


def pairs_with_first(p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The first node and each other."""
    return np.zeros(len(p) - 1, int), np.arange(1, len(p))


PAIRS = {"all pairs": all_pairs, "consecutive pairs": consecutive_pairs, "one reference node": pairs_with_first}


def solve_pairs(p: np.ndarray, pairs: Pairs = all_pairs) -> tuple[np.ndarray, float]:
    """Eqs. 3-8: 2 (p_j - p_i)' x = |p_j|^2 - |p_i|^2 by least squares; the solution (2,) and the condition number.

    Differs from the paper: the last row of eq. 6 reads x_n^2 - x_{n-1}^2 + y_n^2 - y_{n-1}^2.
    """
    i, j = pairs(p)
    squared = (p**2).sum(axis=1)
    x, _, _, sizes = np.linalg.lstsq(2 * (p[j] - p[i]), squared[j] - squared[i], rcond=None)
    return x, float(sizes[0] / sizes[-1]) if sizes[-1] > 0 else np.inf


def compare_readings(snapshots: Snapshots) -> dict[str, list[np.ndarray]]:
    """Offsets from the target (n, 2) [m] of each run's fixes, by reading; the same snapshots serve all readings."""
    half = 0.5 * V
    found: dict[str, list[np.ndarray]] = {}
    for run in range(len(snapshots.positions)):
        offsets: dict[str, list[np.ndarray]] = {}
        for k in (np.flatnonzero(snapshots.steady) + 1).tolist():
            p, entered = snapshots.changed(run, k)
            if len(p) < 4 or solve_pairs(p)[1] > CONDITION:
                continue
            target = snapshots.target[run, k]
            for name, pairs in PAIRS.items():
                offsets.setdefault(name, []).append(solve_pairs(p + half, pairs)[0] - target)
            for name, (sign_in, sign_out) in SHIFTS.items():
                signs = np.where(entered, sign_in, sign_out)[:, None]
                offsets.setdefault(name, []).append(solve_pairs(p + signs * half)[0] - target)
        for name, values in offsets.items():
            found.setdefault(name, []).append(np.array(values))
    return found


def along(offsets: np.ndarray) -> np.ndarray:
    """(n,) component of offsets (n, 2) along the velocity [m]."""
    return offsets @ V / np.hypot(*V)


def follow_as_printed(snapshots: Snapshots) -> np.ndarray:
    """(R, K') error [m] of the recursion with eqs. 12-13 as printed, P = (I - K H) P without F P F'.

    No covariance between position and velocity ever arises, so that the velocity's gain stays 0 and the position is the
    mean of all fixes so far.
    """
    errors = np.empty((len(snapshots.positions), snapshots.steady.sum()))
    f = np.eye(4) + np.diag([1.0, 0.0, 1.0], 1)
    h = np.eye(4)[::2]
    for run, positions in enumerate(snapshots.positions):
        x: np.ndarray | None = None
        p, track = P0 * np.eye(4), []
        for k in range(1, len(snapshots.steady) + 1):
            x = None if x is None else f @ x
            nodes, within = snapshots.changed(run, k)[0], positions[snapshots.within[run, k]]
            z: np.ndarray | None = within.mean(axis=0) if len(within) else None
            if len(nodes) >= 4:
                z = solve_pairs(nodes)[0] + (0.0 if x is None else 0.5 * x[1::2])
            if z is not None and x is None:
                x = np.array([z[0], 0.0, z[1], 0.0])
            elif z is not None and x is not None:
                gain = p @ h.T @ np.linalg.inv(np.eye(2) + h @ p @ h.T)
                x, p = x + gain @ (z - h @ x), (np.eye(4) - gain @ h) @ p
            track.append(np.full(2, np.nan) if x is None else x[::2])
        offsets = np.array(track) - snapshots.target[run, 1:]
        errors[run] = np.hypot(*offsets[snapshots.steady].T)
    return errors
