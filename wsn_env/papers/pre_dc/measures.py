"""What is read off the records for the tables and claims."""

from __future__ import annotations

import numpy as np

from wsn_env.evaluation.intervals import Measured
from wsn_env.papers.pre_dc.systems import SYSTEMS, Results
from wsn_env.papers.rollout import Record, pooled_rms

WINDOW, LOST_M = 50, 10.0  # a network fails when the mean error of so many periods exceeds the sensing radius

STATIC_ENERGY = {  # how the static system's energy is read
    "reports": "reports alone",
    "all": "all awake, invitations too",
    "cluster": "static cluster, one tracker",
}


def difference(larger: np.ndarray, smaller: np.ndarray) -> tuple[float, float]:
    """Paired: mean over the same runs and its standard error, to a tenth of a millimetre [m]."""
    mean, error = Measured.mean(larger - smaller)
    return round(mean, 4), round(error, 4)


def quarters(record: Record) -> list[tuple[float, float]]:
    """RMS over runs and periods of each quarter of the horizon, and its standard error [m]."""
    return [pooled_rms(part) for part in np.array_split(record.square_error(), 4, axis=1)]


def sd_over_periods_m(record: Record, heard_only: bool = False) -> np.ndarray:
    """(R,) standard deviation of a run's error over its periods [m]."""
    return np.nanstd(np.sqrt(record.square_error(heard_only)), axis=1, ddof=1)


def system_sd_m(results: Results, name: str) -> np.ndarray:
    """(R,) the same of a system of Table 2 at 225 nodes."""
    return sd_over_periods_m(results.system(name), SYSTEMS[name].heard_only)


def periods_tracked(record: Record) -> np.ndarray:
    """(R,) periods until the mean error of the last WINDOW of them exceeds LOST_M; all of them where it never does."""
    total = np.cumsum(np.sqrt(record.square_error()), axis=1)
    late = total[:, WINDOW - 1 :] - np.pad(total[:, :-WINDOW], ((0, 0), (1, 0)))
    lost = late > WINDOW * LOST_M
    return np.where(lost.any(axis=1), lost.argmax(axis=1) + WINDOW, total.shape[1])


def static_energy_mj(results: Results, reading: str, nodes: int) -> np.ndarray:
    """(R,) mean energy of a period of the static system, read as one of STATIC_ENERGY, in the runs of Pre-DC [mJ]."""
    record = results.same_tracker("static_cluster", nodes) if reading == "cluster" else results.system("static", nodes)
    energy = record.report_mj if reading == "reports" else record.energy_mj
    return energy[: results.runs].mean(axis=1)
