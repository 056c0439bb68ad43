"""The best openly described methods at T = .5 s, in the place of Figs. 7-9, whose references are lost.

All of them locate the same targets from the same strengths. Those of one period only know that period.
"""

from __future__ import annotations

import numpy as np

from wsn_env.evaluation.intervals import standard_error
from wsn_env.filters.fingerprint import training_of
from wsn_env.papers.grnn.fixes import REFERENCES, USUAL_K, best_k, by_fingerprints, by_network, least_squares
from wsn_env.papers.grnn.strengths import Heard, filter_walk, likely_walk
from wsn_env.papers.grnn.systems import COMPARED_S, METHODS, Results, scenario_as_read
from wsn_env.papers.rollout import pooled_rms
from wsn_env.papers.sheet import Sheet

SHARES = (0.5, 0.9)  # of all periods of all runs
DRAWS = 100  # of runs, for the standard errors of these
FIRST, LAST, PAIRS = (f"least squares, {reference}" for reference in REFERENCES)
SMOOTHED = "GRNN on filtered strengths"
PARTICLE = "particle filter"
UNAIDED = "ICKF begun in the field's middle"


def errors_of_methods(results: Results, heard: Heard) -> dict[str, np.ndarray]:
    """Method: (R, K) error in every period [m]."""

    def off(points: np.ndarray) -> np.ndarray:
        return np.linalg.norm(points - heard.target_m, axis=-1)

    def played(method: str) -> np.ndarray:
        return np.sqrt(results.method(method, COMPARED_S).square_error())

    k = best_k(training_of(scenario_as_read("grnn")))
    filtered = filter_walk(heard.strengths, likely_walk(heard) * COMPARED_S**0.5)[0]
    errors = {f"least squares, {r}": off(least_squares(heard.strengths, r)) for r in REFERENCES}
    errors[METHODS["nonlinear_ls"]] = played("nonlinear_ls")
    errors |= {f"{n} nearest fingerprints": off(by_fingerprints(heard.strengths, n)) for n in (USUAL_K, k)}
    errors[METHODS["grnn"]] = played("grnn")
    errors[SMOOTHED] = off(by_network(filtered))
    errors |= {METHODS[method]: played(method) for method in ("grnn_kf", "ekf", "ukf", "ckf", "ickf")}
    errors[UNAIDED] = np.sqrt(results.unaided(COMPARED_S).square_error())
    errors[PARTICLE] = np.sqrt(results.particle.square_error())
    return errors


def compare(errors: dict[str, np.ndarray]) -> Sheet:
    """Mean, root mean square, and what 50 and 90 % of all errors do not exceed."""
    columns = ["method", "mean error m", "stderr_mean_m", "RMSE m", "stderr_rmse_m"]
    for share in SHARES:
        columns += [f"{100 * share:.0f} % of errors within m", f"stderr_{share:g}_m"]
    rows = []
    for name, error in errors.items():
        row = [name, float(error.mean()), standard_error(error.mean(axis=1)), *pooled_rms(error**2)]
        for share in SHARES:
            row += quantile(error, share)
        rows.append(tuple(row))
    return Sheet(tuple(columns), rows)


def quantile(error: np.ndarray, share: float) -> tuple[float, float]:
    """What this share of errors (R, K) does not exceed, and its standard error, by drawing runs anew (bootstrap)."""
    runs = np.random.default_rng(0).integers(len(error), size=(DRAWS, len(error)))
    drawn = [np.quantile(error[chosen], share) for chosen in runs]
    return float(np.quantile(error, share)), float(np.std(drawn, ddof=1))
