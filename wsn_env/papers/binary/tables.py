"""What the experiments of Zhou, Cheng & Xing (2009) show, as tables; each figure with its standard error."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from wsn_env.evaluation.intervals import Measured
from wsn_env.papers.binary.expected import (
    ANTNP,
    DEFAULTS,
    OVER_NODES,
    OVER_PERIODS,
    OVER_RADII,
    PAIRS_RMS_M,
    PAPER_CROSSING_S,
    PAPER_RMS_M,
    PRINTED_RMS_M,
    SHIFT_BIAS_M,
)
from wsn_env.papers.binary.readings import even_period_s, transmitting_nodes
from wsn_env.papers.binary.results import Results
from wsn_env.papers.binary.study import Study
from wsn_env.papers.binary.systems import (
    FAULTED,
    FLIP,
    GATE_M,
    NODES,
    PERIODS_S,
    RADII_M,
    REFRESHES,
    SPREADS,
    SUCCESS,
    SWEPT,
    SYSTEMS,
    UNEQUAL,
    Setting,
    vary,
)
from wsn_env.papers.sheet import Sheet, by_period

MEANINGS = {
    "raw": "the fix, v given",
    "paper": "recursive least squares over fixes, its own v fed back",
    "paper_inside": "the same, started inside",
    "mid": "the fix as the position half a period ago",
    "ekf": "each boundary node a range of R",
    "particle": "particle filter on the bitmap",
    "centroid": "mean of all that detect",
    "centroid_rls": "the same, filtered",
}
SWEEPS: dict[str, tuple[str, tuple[float, ...], str]] = {  # file: field of a setting, its values, heading
    "nodes": ("nodes", NODES, "number of nodes N"),
    "radius": ("radius_m", RADII_M, "sensing radius R m"),
    "period": ("period_s", PERIODS_S, "sampling period T s"),
}
EXPECTED: dict[str, dict[str, Any]] = {  # by file and column, in the order of the values
    "nodes": OVER_NODES,
    "radius": OVER_RADII,
    "period": {
        "paper": [PAPER_RMS_M.get(period_s, (None,))[0] for period_s in PERIODS_S],
        "boundary nodes": [OVER_PERIODS.get(period_s) for period_s in PERIODS_S],
    },
}


def systems(results: Results) -> Sheet:
    """Every system at the defaults."""
    known = {(name, quantity): value for name, quantity, value, _ in DEFAULTS}
    measures = {"mean": results.mean_m, "median": results.median_m, "rms": results.rms_m}
    columns = ["system"]
    for heading in ("mean error m", "median error m", "RMS error m", "transmitting nodes"):
        columns += [f"expected {heading}", heading, "stderr"]
    rows = []
    for name in SYSTEMS:
        cells: list[Any] = [f"{name}: {MEANINGS[name]}"]
        for quantity, measure in measures.items():
            cells += [known.get((name, quantity)), *measure(Setting(name))]
        counts, energy = (Measured.mean(of(Setting(name))) for of in (results.reporting, results.energy_mj))
        rows.append((*cells, ANTNP["centroid" if name.startswith("centroid") else "paper"][0], *counts, *energy))
    return Sheet((*columns, "energy mJ a period", "stderr"), rows)


def sweep(results: Results, name: str) -> Sheet:
    """Error of the systems over a quantity: the mean, over sampling periods the RMS."""
    field, values, heading = SWEEPS[name]
    what, measure = ("RMS", results.rms_m) if name == "period" else ("mean error", results.mean_m)
    columns: list[str] = [heading]
    cells: list[Sequence[Any]] = [[f"{value:g}" for value in values]]
    for system in (*SWEPT, "paper_inside") if name == "period" else SWEPT:
        if system in EXPECTED[name]:
            columns.append(f"{system}, expected")
            cells.append(EXPECTED[name][system])
        columns += [f"{system} {what} m", "stderr"]
        cells += zip(*map(measure, vary(system, field, values)), strict=True)
    return Sheet(tuple(columns), list(zip(*cells, strict=True)))


def counts(results: Results, name: str) -> Sheet:
    """How many nodes transmit in a period (ANTNP) over a quantity: expected, measured and in closed form."""
    field, values, heading = SWEEPS[name]
    columns: list[str] = [heading]
    cells: list[Sequence[Any]] = [[f"{value:g}" for value in values]]
    for kind, system in (("boundary nodes", "paper"), ("detecting nodes", "centroid")):
        if kind in EXPECTED[name]:
            columns.append(f"{kind}, expected")
            cells.append(EXPECTED[name][kind])
        columns += [kind, "stderr", f"{kind}, closed form"]
        settings = vary(system, field, values)
        cells += zip(*(Measured.mean(results.reporting(setting)) for setting in settings), strict=True)
        cells.append([transmitting_nodes(setting) for setting in settings])
    return Sheet(tuple(columns), list(zip(*cells, strict=True)))


def crossings(results: Results) -> Sheet:
    """From which sampling period on the centroid is as good, or as frugal."""
    rows = [
        ("RMS: paper, started at the edge, against centroid", PAPER_CROSSING_S, results.crossing_s("paper")),
        ("RMS: paper, started inside, against centroid", None, results.crossing_s("paper_inside")),
        ("RMS: raw against centroid", None, results.crossing_s("raw")),
        ("transmitting nodes: boundary against centroid", even_period_s(), results.even_s()),
    ]
    return Sheet(("crossing of", "expected T s", "T s", "stderr"), [(*row[:2], *_or_none(row[2])) for row in rows])


def readings(study: Study) -> Sheet:
    """The readings tried: RMS and bias along the track of fixes with the true velocity."""
    rows: list[Any] = [
        (name, PAIRS_RMS_M.get(name), *study.rms_m(name), SHIFT_BIAS_M.get(name), *study.bias_m(name))
        for name in study.offsets
    ]
    rows.append(("eqs. 12-13 as printed", PRINTED_RMS_M, *study.printed_rms_m(), None, None, None))
    columns = (
        "expected RMS m",
        "RMS m",
        "stderr",
        "expected bias along the track m",
        "bias along the track m",
        "stderr",
    )
    return Sheet(("reading", *columns), rows)


def faults(results: Results) -> Sheet:
    """Mean error with misread states, with and without a gate; with lost reports, with and without a refresh."""
    misread, lost = f"{FLIP:.1%} of the states misread", f"{1 - SUCCESS:.0%} of the reports lost"
    cases: list[tuple[str, dict[str, Any]]] = [
        ("none", {}),
        (misread, dict(flip=FLIP)),
        (f"{misread}, gate_m={GATE_M:g}", dict(flip=FLIP, gate_m=GATE_M)),
        *((f"{lost}, refresh={refresh}", dict(success=SUCCESS, refresh=refresh)) for refresh in REFRESHES),
    ]
    columns = [*_pairs(f"{name} m" for name in FAULTED), "transmitting nodes", "stderr", "energy mJ a period", "stderr"]
    rows = []
    for label, fault in cases:
        setting = Setting("paper", **fault)
        cost = *Measured.mean(results.reporting(setting)), *Measured.mean(results.energy_mj(setting))
        rows.append((label, *_mean_errors(results, FAULTED, fault), *cost))
    return Sheet(("fault", *columns), rows)


def unequal_radii(results: Results) -> Sheet:
    """Mean error where each node has a sensing radius of its own, known to the tracker or not."""
    cases: list[tuple[str, str, dict[str, Any]]] = [("all R", "R", {})]
    for spread in SPREADS:
        label = f"uniform within R ± {spread:.0%}"
        cases += [(label, knows, dict(spread=spread, knows=knows)) for knows in ("R", "the spread", "each radius")]
    rows = []
    for label, knows, case in cases:
        able = ("particle",) if knows == "the spread" else UNEQUAL
        rows.append((label, knows, *_mean_errors(results, UNEQUAL, case, able)))
    return Sheet(("radii", "the tracker knows", *_pairs(f"{name} m" for name in UNEQUAL)), rows)


def error_over_time(results: Results, names: Iterable[str]) -> Sheet:
    """Mean error over the runs at each second; no entry before a system starts."""
    columns = []
    for name in names:
        setting = Setting(name)
        error = np.sqrt(results.records[setting].square_error()).mean(axis=0)
        columns.append(np.concatenate([np.full(round(setting.begin_s), np.nan), error]))
    return by_period([f"{name} m" for name in names], columns, "time s")


def _pairs(headings: Iterable[str]) -> list[str]:
    return [column for heading in headings for column in (heading, "stderr")]


def _mean_errors(
    results: Results, names: Iterable[str], case: dict[str, Any], able: Iterable[str] | None = None
) -> list[float | None]:
    cells: list[float | None] = []
    for name in names:
        cells += [None, None] if able is not None and name not in able else results.mean_m(Setting(name, **case))
    return cells


def _or_none(figure: Measured) -> tuple[float | None, ...]:
    return tuple(value if np.isfinite(value) else None for value in figure)
