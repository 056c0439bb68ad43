"""Do the implementations compute the same posterior? Checked before any of them is timed."""

from __future__ import annotations

import contextlib
import random
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
from scipy import stats

from benchmarks.filters import Absent, Problem, enter, kind_of
from benchmarks.filters.exact import estimates, kalman, largest_difference

STRICT = "wsn_env, strict"
FALSE_ALARM = 1e-4  # probability that an implementation that computes the same is taken for another, over all its


def noiseless_difference(name: str, measurement: str, particles: int = 1000, periods: int = 5, rows: int = 2) -> float:
    """Largest difference to wsn_env's kernel in mean and covariance [m, m/s and squares] and N_eff (as a share).

    Same particles and reports, no process noise and no resampling, so that nothing is random.
    """
    problem = Problem.draw(measurement, particles, rows, q=0.0, resampling=False)
    ours = estimates(enter(STRICT, problem), periods)
    return largest_difference(estimates(enter(name, problem), periods), ours)


def noisy_differences(
    name: str, measurement: str, particles: int = 2000, rows: int = 24, seed: int = 1
) -> dict[str, float]:
    """Differences to wsn_env's kernel and, for positions, to the exact Kalman filter, each in its own standard errors.

    Every filter draws its own noise and resamples in every period. A filter that strays stays away for some periods:
    only rows, each with a target, reports and cloud of its own, are independent, and their spread gives the error.
    """
    problem = Problem.draw(measurement, particles, rows, seed)
    kernel = estimates(enter(STRICT, problem))
    with seed_global_generators(seed):
        own = estimates(enter(name, replace(problem, keys=~problem.keys)))
    found = _differences("kernel", own, kernel)
    found["kernel, N_eff"] = _standard_errors(np.log(own[2] / kernel[2]).mean(axis=0))
    if measurement == "position":
        means, covs = kalman(problem)
        found |= _differences("kalman", own, (means, covs[:, None], np.full_like(own[2], np.inf)))
    return found


def _differences(to: str, own, other) -> dict[str, float]:
    """Of the means in posterior sds, and of the logarithms of the variances; means over a row's periods.

    A sample of N_eff has a variance that is small by 1 / N_eff, and its logarithm is small by as much again.
    """
    variances, others = (np.diagonal(covs, axis1=-2, axis2=-1) for covs in (own[1], other[1]))
    logs, other_logs = (np.log(v) + 2 / n_eff[..., None] for v, n_eff in ((variances, own[2]), (others, other[2])))
    rows = {"mean": (own[0] - other[0]) / np.sqrt(others), "variance": logs - other_logs}
    return {
        f"{to}, {what} of {coordinate}": _standard_errors(values[:, :, i].mean(axis=0))
        for what, values in rows.items()
        for i, coordinate in enumerate(("x", "vx", "y", "vy"))
    }


def _standard_errors(values: np.ndarray) -> float:
    """Student's t of the mean of independent values."""
    return float(values.mean() / (values.std(ddof=1) / len(values) ** 0.5 + 1e-12))


def limit(figures: int, rows: int) -> float:
    """Standard errors that none of so many figures exceeds, but with probability FALSE_ALARM."""
    return float(stats.t.isf(FALSE_ALARM / (2 * figures), rows - 1))


@contextlib.contextmanager
def seed_global_generators(seed: int) -> Iterator[None]:
    """The global generators, from which most packages resample, from a seed; afterwards as they were."""
    states = random.getstate(), np.random.get_state()
    random.seed(seed)
    np.random.seed(seed)
    try:
        yield
    finally:
        random.setstate(states[0])
        np.random.set_state(states[1])


def check_agreement(
    names: Iterable[str], measurement: str, short: bool = False
) -> tuple[dict[str, dict[str, float]], dict[str, str]]:
    """Figures of the implementations that are here, and why others are not. Raises if one computes something else.

    Args:
        short: be content with fewer rows and particles, which take a tenth of the time and find grosser errors only.
    """
    particles, rows = (500, 10) if short else (2000, 24)
    figures, absent = {}, {}
    for name in names:
        try:
            exactly = noiseless_difference(name, measurement)
            found = noisy_differences(name, measurement, particles, rows)
            tolerance = kind_of(name).tolerance
        except Absent as reason:
            absent[name] = str(reason)
            continue
        most = max(map(abs, found.values()))
        figures[name] = {"noiseless": exactly, "noisy": most}
        if not (exactly <= tolerance and most <= limit(len(found), rows)):  # NaN is no agreement either
            raise SystemExit(f"{name} does not compute the same posterior for {measurement}: {exactly:.2g}, {found}")
    return figures, absent
