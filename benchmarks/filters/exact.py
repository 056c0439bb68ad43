"""What the implementations ought to find: the Kalman filter, exact for positions; and how far one is from it."""

from __future__ import annotations

import numpy as np

from benchmarks.filters.implementation import Implementation
from benchmarks.filters.problem import PERIODS, Problem, constant_velocity


def kalman(problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Posterior means (PERIODS, B, 4) and covariances (PERIODS, 4, 4) for reported positions.

    m reports of a position with sd r are one of their mean with sd r / sqrt(m).
    """
    if problem.measurement != "position":
        raise ValueError(f"measurement {problem.measurement!r}: must be 'position', a strength is not linear")
    transition, gain = constant_velocity(problem.period_s)
    process = problem.q**2 * gain @ gain.T
    reports = problem.values.mean(axis=2)
    noise = problem.noise**2 / problem.values.shape[2] * np.eye(2)
    observe = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0]])
    mean, cov = problem.prior_mean, problem.prior_cov
    means, covs = [], []
    for k in range(PERIODS):
        mean, cov = mean @ transition.T, transition @ cov @ transition.T + process
        kalman_gain = cov @ observe.T @ np.linalg.inv(observe @ cov @ observe.T + noise)
        mean = mean + (reports[:, k] - mean @ observe.T) @ kalman_gain.T
        cov = cov - kalman_gain @ observe @ cov
        means.append(mean)
        covs.append(cov)
    return np.array(means), np.array(covs)


def estimates(implementation: Implementation, periods: int = PERIODS) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Means (periods, B, 4), covariances (periods, B, 4, 4), N_eff (periods, B) of an implementation from its start."""
    found = []
    for _ in range(periods):
        implementation.step()
        found.append([np.array(part) for part in implementation.estimate()])
    return tuple(np.array(part) for part in zip(*found))


def largest_difference(left, right) -> float:
    """Of two sets of estimates: mean and covariance [m, m/s and squares], and N_eff as a share of itself."""
    difference = max(np.abs(a - b).max() for a, b in zip(left[:2], right[:2]))
    return float(max(difference, np.abs(left[2] / right[2] - 1).max()))


def deviation(means, reference_means, covs) -> float:
    """Root mean square difference of the means, in posterior standard deviations (covs: (..., 4, 4)).

    The Monte Carlo error of P particles makes it a few times P**-0.5.
    """
    variances = np.diagonal(covs, axis1=-2, axis2=-1)
    return float(np.sqrt(np.mean((means - reference_means) ** 2 / variances)))
