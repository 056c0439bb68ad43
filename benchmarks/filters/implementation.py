"""What an implementation is: a filter that walks through a problem's periods, again and again."""

from __future__ import annotations

import numpy as np

from benchmarks.filters.problem import PERIODS, Problem


class Absent(Exception):
    """An implementation cannot take part here; the text says why."""


class Implementation:
    """One filter step of every row a call: predict, weigh m reports, mean and covariance, N_eff, resample.

    Subclasses define `restart`, `advance` and `estimate`, and hold what they may prepare once.
    """

    package: str | None = None  # the distribution whose version the page names
    batches = False  # filters several rows in one call; without, `Looped` calls it for each
    tolerance = 1e-3  # of mean and covariance [m, m/s and squares] for the same particles and reports

    def __init__(self, problem: Problem):
        self.problem = problem
        self.period = 0
        self.restart()

    def restart(self) -> None:
        """Back to the prior cloud."""
        raise NotImplementedError

    def advance(self, period: int) -> None:
        """The filter step of a period 0..PERIODS - 1; done when it returns."""
        raise NotImplementedError

    def estimate(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Mean (B, 4), covariance (B, 4, 4) and N_eff (B,) of the last step, before its resampling."""
        raise NotImplementedError

    def step(self) -> None:
        """The next period; after the last one, the first."""
        if self.period == PERIODS:
            self.restart()
            self.period = 0
        self.advance(self.period)
        self.period += 1


class Looped(Implementation):
    """An implementation without a batch form: one filter a row, in a Python loop."""

    def __init__(self, kind: type[Implementation], problem: Problem):
        self.problem = problem
        self.rows = [kind(problem.row(row)) for row in range(problem.rows)]

    def step(self) -> None:
        """The next period of every row."""
        for row in self.rows:
            row.step()

    def estimate(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Those of the rows."""
        return tuple(np.concatenate(parts) for parts in zip(*(row.estimate() for row in self.rows)))
