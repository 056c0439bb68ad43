"""Do the contestants compute the same posterior? Checked before any of them is timed."""

from __future__ import annotations

from collections.abc import Iterable

from benchmarks.filters import Absent, Problem, enter, kind_of
from benchmarks.filters.exact import deviation, estimates, kalman, largest_difference

STRICT = "wsn_env, strict"
DEVIATIONS = 8  # own noise: means may differ by so many P**-0.5 posterior sds (root mean square; about 5 are found)


def noiseless_difference(name: str, measurement: str, particles: int = 1000, periods: int = 5, rows: int = 2) -> float:
    """Largest difference to wsn_env's kernel in mean and covariance [m, m/s and squares] and N_eff (as a share).

    Same particles and reports, no process noise and no resampling, so that nothing is random.
    """
    problem = Problem.draw(measurement, particles, rows, q=0.0, resampling=False)
    ours = estimates(enter(STRICT, problem), periods)
    return largest_difference(estimates(enter(name, problem), periods), ours)


def noisy_deviations(name: str, measurement: str, particles: int = 2000, rows: int = 4) -> dict[str, float]:
    """Root mean square difference of the means, in posterior sds, times P**0.5: to wsn_env's kernel and, for positions,
    to the exact Kalman filter. Every filter draws its own noise and resamples in every period."""
    problem = Problem.draw(measurement, particles, rows, seed=1)
    means, covs, _ = estimates(enter(STRICT, problem))
    own, _, _ = estimates(enter(name, problem))
    found = {"kernel": deviation(own, means, covs)}
    if measurement == "position":
        exact_means, exact_covs = kalman(problem)
        found["kalman"] = deviation(own, exact_means, exact_covs[:, None])
    return {key: value * particles**0.5 for key, value in found.items()}


def check(names: Iterable[str], measurement: str) -> tuple[dict[str, dict[str, float]], dict[str, str]]:
    """Figures of the contestants that are here, and why others are not. Raises if one computes something else."""
    figures, absent = {}, {}
    for name in names:
        try:
            found = {"noiseless": noiseless_difference(name, measurement)} | noisy_deviations(name, measurement)
            tolerance = kind_of(name).tolerance
        except Absent as reason:
            absent[name] = str(reason)
            continue
        if found["noiseless"] > tolerance or max(found["kernel"], found.get("kalman", 0.0)) > DEVIATIONS:
            raise SystemExit(f"{name} does not compute the same posterior for {measurement}: {found}")
        figures[name] = found
    return figures, absent
