"""What a picture tells of the periods before: tails, and energy and error so far."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wsn_env.models.state import OUTCOME, Outcome, State


@dataclass(eq=False)
class Trail:
    """The past of B rows. An environment keeps one only if it makes pictures.

    estimate_m (B, periods + 1, 2) and head (B, periods + 1) hold the periods up to the present one, energy_mj and
    squared_m2 (B,) their sums, and last what the present one brought.
    """

    estimate_m: np.ndarray
    head: np.ndarray
    energy_mj: np.ndarray
    squared_m2: np.ndarray  # of the periods that are scored
    last: Outcome
    unscored: int

    @classmethod
    def of(cls, state: State, unscored: int = 0) -> Trail:
        """An empty one for a batch of this shape; `unscored` periods at the start do not count as errors."""
        rows, periods = state.track.shape[:2]
        return cls(
            estimate_m=np.zeros((rows, periods, 2)),
            head=np.full((rows, periods), -1),
            energy_mj=np.zeros(rows),
            squared_m2=np.zeros(rows),
            last=Outcome(np.zeros(rows, OUTCOME), state.ledger.spent_j),
            unscored=unscored,
        )

    def begin(self, state: State, outcome: Outcome, rows: np.ndarray) -> None:
        """Episodes that begin in the rows marked (B,)."""
        self.last.row[rows] = outcome.row[rows]
        self.energy_mj[rows] = outcome.energy_mj[rows]
        self.squared_m2[rows] = 0.0
        self._record_estimate_and_head(state, np.flatnonzero(rows))

    def add(self, state: State, outcome: Outcome) -> None:
        """A period of all rows."""
        self.last.row[:] = outcome.row
        self.energy_mj += outcome.energy_mj
        self.squared_m2 += np.where(state.period > self.unscored, outcome.error_m**2, 0.0)
        self._record_estimate_and_head(state, np.arange(state.rows))

    def _record_estimate_and_head(self, state: State, rows: np.ndarray) -> None:
        period = np.minimum(state.period[rows], self.head.shape[1] - 1)
        self.estimate_m[rows, period] = self.last.estimate_m[rows]
        self.head[rows, period] = state.network.head[rows]

    def rms_m(self, state: State, row: int) -> float:
        """Root of the mean squared error so far; NaN before a period is scored."""
        scored = state.period[row] - self.unscored
        return (self.squared_m2[row] / scored) ** 0.5 if scored > 0 else np.nan
