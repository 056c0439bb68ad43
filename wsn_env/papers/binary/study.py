"""The systems that were played, and the readings that were tried beside them."""

from __future__ import annotations

import numpy as np

from wsn_env.evaluation.intervals import Measured, standard_error
from wsn_env.papers.binary.readings import Snapshots, along, compare_readings, follow_as_printed, take_snapshots
from wsn_env.papers.binary.results import Results
from wsn_env.papers.rollout import pooled_rms


class Study:
    """Everything that tables, pictures and claims are made of."""

    def __init__(self, results: Results) -> None:
        self.results: Results = results
        snapshots: Snapshots = take_snapshots(results.runs)
        self.offsets: dict[str, list[np.ndarray]] = compare_readings(snapshots)
        self.printed_m: np.ndarray = follow_as_printed(snapshots)

    def rms_m(self, reading: str) -> Measured:
        """RMS of a reading's fixes [m]."""
        squares = [(offsets**2).sum(axis=1) for offsets in self.offsets[reading]]
        rms = float(np.sqrt(np.concatenate(squares).mean()))
        return Measured(rms, standard_error(np.array([square.mean() for square in squares])) / (2 * rms))

    def bias_m(self, reading: str) -> Measured:
        """Mean offset along the velocity [m]."""
        runs = [along(offsets) for offsets in self.offsets[reading]]
        return Measured(float(np.concatenate(runs).mean()), standard_error(np.array([run.mean() for run in runs])))

    def printed_rms_m(self) -> Measured:
        """RMS of the recursion as printed [m]."""
        return pooled_rms(self.printed_m**2)
