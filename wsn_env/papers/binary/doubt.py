"""Figures measured over runs, and their standard errors."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from wsn_env.papers.rollout import standard_error

RESAMPLES = 200


class Figure(NamedTuple):
    """A measured figure."""

    value: float
    stderr: float

    def __str__(self) -> str:
        return f"{self.value:.2f} ({self.stderr:.2f})"


def mean_of(runs: np.ndarray) -> Figure:
    """The mean of (R,) figures of independent runs."""
    return Figure(float(runs.mean()), standard_error(runs))


def bootstrap(statistic: Callable[[np.ndarray], float], runs: int) -> Figure:
    """A statistic of all runs; its standard error is its sd over sets of runs drawn with replacement.

    Args:
        statistic: of the runs by number, (R,); sets of which it is NaN are left out.
        runs: R.
    """
    rng = np.random.default_rng(0)
    values = np.array([statistic(rng.integers(runs, size=runs)) for _ in range(RESAMPLES)])
    values = values[np.isfinite(values)]
    return Figure(statistic(np.arange(runs)), float(values.std()) if len(values) > 1 else float("nan"))
