"""The fingerprint system's tables, for CSV files and for pages."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from wsn_env.evaluation.intervals import standard_error
from wsn_env.filters.fingerprint import training_of
from wsn_env.papers.grnn.claims import EXPECTED_RMSE_M, excess
from wsn_env.papers.grnn.comparison import SMOOTHED, UNAIDED
from wsn_env.papers.grnn.fixes import by_network
from wsn_env.papers.grnn.flies import Search, search_widths
from wsn_env.papers.grnn.strengths import Heard, filter_walk, likely_walk, smooth_walk
from wsn_env.papers.grnn.systems import (
    ANCHORS,
    EQUAL_INFORMATION,
    FILTERS,
    METHODS,
    PERIODS_S,
    STARTED,
    STARTS,
    Results,
    scenario_as_read,
)
from wsn_env.papers.rollout import Record, pooled_rms
from wsn_env.papers.sheet import Sheet, show_table

START_NAMES = {"field": "the field's middle", "fix": "the network's fix"}
AS_HEARD, LOOKS_AHEAD = "GRNN", "GRNN on smoothed strengths (looks ahead)"


def cell(figure: float, error: float) -> str:
    """A figure and its standard error."""
    return f"{figure:.2f} ({error:.2f})"


def mean_error(record: Record, axis: int | None = None) -> tuple[float, float]:
    """Mean distance, or distance along an axis, and its standard error [m]."""
    size = np.sqrt(record.square_error()) if axis is None else np.abs(record.offset_m[:, :, axis])
    return float(size.mean()), standard_error(size.mean(axis=1))


def played(results: Results) -> dict[str, Callable[[float], Record]]:
    """Every row of the main table: what was played at a sampling period."""
    rows: dict[str, Callable[[float], Record]] = {
        name: lambda t, method=method: results.method(method, t)  # type: ignore[misc]
        for method, name in METHODS.items()
    }
    return rows | {UNAIDED: results.unaided}


def errors(results: Results) -> Sheet:
    """The main table: root mean square and mean error over all runs and periods, radial and along each axis."""
    expected = {METHODS[method]: figures for method, figures in EXPECTED_RMSE_M.items()}
    rows = []
    for name, record_at in played(results).items():
        for i, period_s in enumerate(PERIODS_S):
            record = record_at(period_s)
            figures = [record.pooled_rms_m(), mean_error(record)]
            figures += [record.pooled_rms_m(axis) for axis in (0, 1)] + [mean_error(record, axis) for axis in (0, 1)]
            rows.append((name, period_s, expected[name][i] if name in expected else None, *sum(figures, ())))
    names = ("rmse", "mean_error", "rmse_x", "rmse_y", "mean_error_x", "mean_error_y")
    columns = [f"{name}{ending}" for name in names for ending in ("_m", "_stderr_m")]
    return Sheet(("method", "period_s", "expected_rmse_m", *columns), rows)


def show_errors(out: Path, sheet: Sheet, runs: int) -> None:
    """rmse.md, mean_error.md and axes.md."""
    columns = ("method", *(f"T = {t:g} s" for t in PERIODS_S))
    names = list(dict.fromkeys(row[0] for row in sheet.rows))
    rms, mean, axes = [], [], []
    for name in names:
        rows = [row for row in sheet.rows if row[0] == name]
        rms.append([name] + [(f"{row[2]:.1f} / " if row[2] else "") + cell(*row[3:5]) for row in rows])
        mean.append([name] + [cell(*row[5:7]) for row in rows])
        if name in [METHODS[method] for method in FILTERS]:
            axes += [[name, f"{row[1]:g}", *(cell(*row[i : i + 2]) for i in (7, 9, 11, 13))] for row in rows]
    caption = f"ring8, 3 dB, {runs} runs; expected / measured (standard error)"
    show_table(out / "rmse.md", "Root mean square error m", columns, rms, caption)
    show_table(out / "mean_error.md", "Mean error m", columns, mean)
    columns = ("method", "T s", "RMSE in x m", "RMSE in y m", "mean error in x m", "mean error in y m")
    show_table(out / "axes.md", "Errors in x and y", columns, axes)


def equal_information(results: Results) -> Sheet:
    """The same with noise sqrt(1 s / T) dB."""
    cases = [(method, t) for method in EQUAL_INFORMATION for t in PERIODS_S]
    rows = [(METHODS[m], t, t**-0.5, *results.equal_information(m, t).pooled_rms_m()) for m, t in cases]
    return Sheet(("method", "period_s", "noise_db", "rmse_m", "stderr_m"), rows)


def show_equal_information(out: Path, sheet: Sheet) -> None:
    """A row a method."""
    names = dict.fromkeys(row[0] for row in sheet.rows)
    rows = [[name] + [cell(*row[3:5]) for row in sheet.rows if row[0] == name] for name in names]
    columns = ("method", *(f"T = {t:g} s" for t in PERIODS_S))
    show_table(out / "equal_information.md", "RMSE m at an equal information rate", columns, rows)


def poor_start(results: Results) -> Sheet:
    """The first 5 s at T = .5 s and 0.5 dB, from the middle of the field and from a fix."""
    cases = [(anchors, start, method) for anchors in ANCHORS for start in STARTS for method in STARTED]
    rows = [(a, START_NAMES[s], METHODS[m], *results.start(m, a, s).pooled_rms_m()) for a, s, m in cases]
    return Sheet(("anchors", "start", "method", "rmse_m", "stderr_m"), rows)


def show_poor_start(out: Path, sheet: Sheet) -> None:
    """A row a start."""
    cases = dict.fromkeys(row[:2] for row in sheet.rows)
    rows = [[*case] + [cell(*row[3:5]) for row in sheet.rows if row[:2] == case] for case in cases]
    columns = ("anchors", "begun in", *(f"{METHODS[method]}: RMSE m" for method in STARTED))
    show_table(out / "poor_start.md", "The first 5 s, T = 0.5 s, 0.5 dB", columns, rows)


def iteration(results: Results) -> Sheet:
    """By how much ICKF's root mean square error exceeds CKF's where both begin with a fix, at 3 dB; paired by run."""
    rows = []
    for period_s in PERIODS_S:
        ickf, ckf = (results.method(method, period_s).rms_m() ** 2 for method in ("ickf", "ckf"))
        share, error = excess(ckf, ickf)
        rows.append((f"{period_s:g}", 100 * share, 100 * error))
    return Sheet(("T s", "ICKF's RMSE beyond CKF's %", "stderr_percent"), rows)


def smoothing(heard: dict[float, Heard]) -> Sheet:
    """The network on strengths as heard, filtered and smoothed."""
    rows = []
    for period_s, runs in heard.items():
        walk = likely_walk(runs)
        step = walk * period_s**0.5
        filtered, variance, _ = filter_walk(runs.strengths, step)
        smoothed = smooth_walk(filtered, variance, step)
        for name, strengths in ((AS_HEARD, runs.strengths), (SMOOTHED, filtered), (LOOKS_AHEAD, smoothed)):
            offset = np.linalg.norm(by_network(strengths) - runs.target_m, axis=-1)
            figures = *pooled_rms(offset**2), float(offset.mean()), standard_error(offset.mean(axis=1))
            rows.append((name, period_s, walk, *figures))
    return Sheet(("method", "period_s", "walk_db", "rmse_m", "stderr_rmse_m", "mean_error_m", "stderr_mean_m"), rows)


def show_smoothing(out: Path, sheet: Sheet) -> None:
    """A row a way to treat strengths, and what walk they are taken for."""
    columns = ("RMSE m of", *(f"T = {t:g} s" for t in PERIODS_S))
    names = list(dict.fromkeys(row[0] for row in sheet.rows))
    rows = [[name] + [cell(*row[3:5]) for row in sheet.rows if row[0] == name] for name in names]
    walks = [f"{row[2]:.2f}" for row in sheet.rows if row[0] == names[0]]
    rows.append(["most likely walk of a strength dB/√s", *walks])
    show_table(out / "smoothing.md", "Strengths filtered before the network", columns, rows)


def widths(runs: int) -> list[Search]:
    """Every search for the width; of those that draw, as many draws as runs, at most five."""
    trainings = [training_of(scenario_as_read("grnn", training_seed=seed)) for seed in range(6)]
    return search_widths(trainings, np.array(ANCHORS["ring8"]), draws=min(runs, 5))


def width_table(searches: list[Search]) -> Sheet:
    """Width and error, means over draws."""
    rows = []
    for s in searches:
        doubts = [standard_error(v) if s.draws > 1 else None for v in (s.width_db, s.error_m)]
        figures = (float(s.width_db.mean()), doubts[0], float(s.error_m.mean()), doubts[1], float(s.error_m.max()))
        rows.append((s.name, *figures, s.evaluations))
    columns = ("search", "width dB", "stderr_db", "error at the validation points m", "stderr_m", "in the worst draw m")
    return Sheet((*columns, "evaluations"), rows)


def show_measured(path: Path, title: str, sheet: Sheet) -> None:
    """A sheet's table, figures with two decimals; a column `stderr_...` in brackets behind the one before it."""
    shown = [i for i, name in enumerate(sheet.columns) if not name.startswith("stderr")]
    rows = []
    for row in sheet.rows:
        texts = [f"{v:.2f}" if isinstance(v, float) else str(v) for v in row]
        errors = {i - 1: f" ({texts[i]})" for i, v in enumerate(row) if i not in shown and v is not None}
        rows.append([texts[i] + errors.get(i, "") for i in shown])
    show_table(path, title, [sheet.columns[i] for i in shown], rows)
