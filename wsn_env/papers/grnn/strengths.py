"""The strengths of whole runs, and their smoothing by a Kalman filter for each anchor before the network sees them.

A strength is read as a random walk, r(k) = r(k-1) + w, w ~ N(0, s^2 T), heard with noise N(0, 3^2) dB^2; the text names
the filter but not its model. s is the most likely one of what was heard: the target's truth does not enter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wsn_env.evaluation.policies import make_policy
from wsn_env.evaluation.rollout import BLOCK, FIRST_SEED, episodes
from wsn_env.papers.grnn.systems import NOISE_DB, scenario_as_read
from wsn_env.simulation.world import World

WALKS_DB = tuple(float(s) for s in np.geomspace(0.25, 8.0, 21))  # per square root of a second


@dataclass(frozen=True, eq=False)
class Heard:
    """What the anchors heard; R runs, K periods, S anchors. The runs are those of `rollout.play`."""

    period_s: float
    target_m: np.ndarray  # (R, K, 2)
    strengths: np.ndarray  # (R, K, S) dBm


def listen(period_s: float, runs: int) -> Heard:
    """The strengths of every run."""
    scenario = scenario_as_read("particle", period_s)  # any tracker: none changes what is heard
    world, policy = World(scenario), make_policy("all", scenario)
    targets, strengths = [], []
    for start in range(0, runs, BLOCK):
        seeds = [FIRST_SEED + run for run in range(start, min(start + BLOCK, runs))]
        target, heard = [], []
        for state, outcome in episodes(policy, world, seeds):
            order = np.argsort(state.reports.node, axis=1)
            target.append(outcome.target_m.copy())
            heard.append(np.take_along_axis(state.reports.value[:, :, 0], order, axis=1))
        targets.append(np.stack(target, axis=1))
        strengths.append(np.stack(heard, axis=1))
    return Heard(period_s, np.concatenate(targets), np.concatenate(strengths))


def filter_walk(heard: np.ndarray, step_db: float, noise_db: float = NOISE_DB) -> tuple[np.ndarray, np.ndarray, float]:
    """Kalman's filter of a random walk along the last axis but one; it begins with the first value.

    Args:
        heard: (..., K, S) dBm.
        step_db: sd of the walk's step in a period.

    Returns: (..., K, S) estimates; (K,) their variances; the log likelihood of the values but the first, up to a
    constant.
    """
    estimate, variance, score = heard.copy(), np.full(heard.shape[-2], noise_db**2), 0.0
    for k in range(1, heard.shape[-2]):
        predicted = variance[k - 1] + step_db**2
        total = predicted + noise_db**2
        innovation = heard[..., k, :] - estimate[..., k - 1, :]
        estimate[..., k, :] = estimate[..., k - 1, :] + predicted / total * innovation
        variance[k] = predicted * noise_db**2 / total
        score -= 0.5 * float((innovation**2).sum() / total + innovation.size * np.log(total))
    return estimate, variance, score


def smooth_walk(estimate: np.ndarray, variance: np.ndarray, step_db: float) -> np.ndarray:
    """Rauch, Tung and Striebel's smoother of what `filter_walk` returns: each estimate from the whole run, the future's
    strengths as well."""
    smoothed = estimate.copy()
    for k in range(len(variance) - 2, -1, -1):
        gain = variance[k] / (variance[k] + step_db**2)
        smoothed[..., k, :] += gain * (smoothed[..., k + 1, :] - estimate[..., k, :])
    return smoothed


def likely_walk(heard: Heard) -> float:
    """The most likely sd of the walk, of WALKS_DB [dB per square root of a second]."""
    return max(WALKS_DB, key=lambda walk: filter_walk(heard.strengths, walk * heard.period_s**0.5)[2])
