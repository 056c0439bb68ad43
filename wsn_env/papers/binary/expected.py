"""Figures that an independent implementation of our reading of Zhou, Cheng & Xing (2009) gave, beside ours."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from wsn_env.evaluation.intervals import Measured
from wsn_env.papers.binary.readings import PAIRS, SHIFTS, boundary_nodes, detecting_nodes, even_period_s
from wsn_env.papers.binary.results import Results
from wsn_env.papers.binary.study import Study
from wsn_env.papers.binary.systems import FLIP, NODES, RADII_M, Setting
from wsn_env.papers.claim import Expectation

DOUBT = 4.0  # standard errors that a figure of a sweep may be off
DEFAULTS = (  # quantity of a system at the defaults, expected, tolerance
    ("raw", "mean", 3.27, 0.35),
    ("raw", "median", 2.38, 0.16),
    ("paper", "mean", 3.87, 0.9),
    ("mid", "mean", 1.48, 0.25),
    ("ekf", "rms", 0.94, 0.10),
    ("centroid", "mean", 7.29, 0.5),
    ("centroid", "rms", 8.23, 0.5),
)
OVER_NODES = {
    "centroid": (9.10, 8.06, 7.29, 6.75, 6.36),
    "raw": (5.63, 4.11, 3.28, 2.70, 2.35),
    "boundary nodes": (5.44, 6.79, 8.14, 9.49, 10.85),
    "detecting nodes": (18.19, 22.73, 27.27, 31.77, 36.31),
}
OVER_RADII = {
    "centroid": (7.54, 7.41, 7.29, 7.25, 7.29),
    "raw": (5.27, 4.19, 3.28, 2.76, 2.30),
    "boundary nodes": (5.44, 6.80, 8.14, 9.51, 10.89),
    "detecting nodes": (12.11, 18.98, 27.27, 37.08, 48.48),
}
OVER_PERIODS = dict(zip((1.0, 2.0, 3.0, 4.0, 5.0), (8.14, 16.17, 23.99, 31.40, 38.31), strict=True))
PAIRS_RMS_M = dict(zip(PAIRS, (3.89, 4.65, 4.48), strict=True))
HALF_WAY_M = np.hypot(10.0, 10.0) / 2
SHIFT_BIAS_M = dict(zip(SHIFTS, (0.0, -HALF_WAY_M, -2 * HALF_WAY_M, -HALF_WAY_M, -HALF_WAY_M), strict=True))
FLIPPED_RMS_M = {"raw": 98.8, "paper": 66.7, "mid": 63.2}
ANTNP = {"paper": (8.14, 0.3), "centroid": (27.2, 1.0)}  # expected, tolerance
PAPER_RMS_M = {3.0: (6.1, 1.3), 4.0: (9.9, 1.0)}  # of paper by T
PAPER_CROSSING_S = 3.57  # where it and the centroid have the same RMS
PRINTED_RMS_M = 192.0
REPORTERS = {"boundary nodes": "raw", "detecting nodes": "centroid"}


def list_expectations(study: Study) -> list[Expectation]:
    """Every expected figure."""
    return [*_closed_forms(), *_defaults(study.results), *_sweeps(study.results), *_readings(study)]


def _closed_forms() -> Iterator[Expectation]:
    yield Expectation("closed form of the boundary nodes of a period", 8.127, 5e-4, boundary_nodes())
    yield Expectation("closed form of the nodes that detect", 27.14, 5e-3, detecting_nodes())
    yield Expectation("closed form of the T [s] at which both are as many", 3.428, 5e-4, even_period_s())


def _defaults(results: Results) -> Iterator[Expectation]:
    for name, figures in ANTNP.items():
        yield Expectation(f"ANTNP of {name}", *figures, Measured.mean(results.reporting(Setting(name))).value)
    for name, quantity, value, tolerance in DEFAULTS:
        measure = {"mean": results.mean_m, "median": results.median_m, "rms": results.rms_m}[quantity]
        yield Expectation(f"{quantity} error [m] of {name}", value, tolerance, measure(Setting(name)).value)
    for period_s, figures in PAPER_RMS_M.items():
        measured = results.rms_m(Setting("paper", period_s=period_s)).value
        yield Expectation(f"rms error [m] of paper at T = {period_s:g} s", *figures, measured)
    crossing = results.crossing_s("paper").value
    yield Expectation("T [s] at which paper crosses the centroid", PAPER_CROSSING_S, 0.3, crossing)
    particle = results.rms_m(Setting("particle", flip=FLIP)).value
    yield Expectation("rms error [m] of particle with flips", 1.15, 0.25, particle)
    for name, value in FLIPPED_RMS_M.items():
        yield _with_doubt(f"rms error [m] of {name} with flips", value, results.rms_m(Setting(name, flip=FLIP)))


def _sweeps(results: Results) -> Iterator[Expectation]:
    for table, unit, values, keyword in ((OVER_NODES, "N", NODES, "nodes"), (OVER_RADII, "R", RADII_M, "radius_m")):
        for what, row in table.items():
            for value, figure in zip(values, row, strict=True):
                changes: dict[str, Any] = {keyword: value}
                setting = Setting(REPORTERS.get(what, what), **changes)
                runs = results.reporting(setting) if what in REPORTERS else results.run_error_m(setting)
                label = f"ANTNP, {what}" if what in REPORTERS else f"mean error [m] of {what}"
                yield _with_doubt(f"{label}, {unit} = {value:g}", figure, Measured.mean(runs))
    for period_s, figure in OVER_PERIODS.items():
        runs = results.reporting(Setting("paper", period_s=period_s))
        yield _with_doubt(f"ANTNP, boundary nodes, T = {period_s:g}", figure, Measured.mean(runs))


def _readings(study: Study) -> Iterator[Expectation]:
    for name, value in PAIRS_RMS_M.items():
        yield _with_doubt(f"rms error [m] of {name}", value, study.rms_m(name))
    for name, value in SHIFT_BIAS_M.items():
        yield _with_doubt(f"bias [m] along the track, shift {name}", value, study.bias_m(name))
    yield Expectation("rms error [m] with eqs. 12-13 as printed", PRINTED_RMS_M, 4.0, study.printed_rms_m().value)


def _with_doubt(quantity: str, value: float, measured: Measured) -> Expectation:
    return Expectation(quantity, value, DOUBT * measured.stderr, measured.value)
