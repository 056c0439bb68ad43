"""Recorded tracks from CSV files."""

import csv
from typing import Any

import numpy as np

from wsn_env.models.quantity import ScenarioError


def read_track(path: str, span_m: float | None, scenario: Any) -> np.ndarray:
    """A recorded track (periods + 1, 4), resampled linearly to the horizon, scaled and centred on request.

    Args:
        span_m: scaled so that the longer side is so long, and centred; None: as recorded.
        path: CSV with a header naming at least t, x, y [s, m, m]; times must increase.

    Raises:
        ScenarioError: names the file, the line and what is allowed.
    """
    times: list[float] = []
    points: list[tuple[float, float]] = []
    try:
        with open(path, newline="", encoding="utf-8-sig") as file:
            table = csv.DictReader(file, skipinitialspace=True)
            missing = [name for name in "txy" if name not in (table.fieldnames or ())]
            if missing:
                raise ScenarioError(
                    f"{path}: column {missing[0]!r} is missing: the header must name t, x, y; it is {table.fieldnames}"
                )
            for row in table:
                try:
                    t, x, y = (float(row[name]) for name in "txy")
                except (TypeError, ValueError):
                    raise ScenarioError(f"{path}, line {table.line_num}: {row} must be numbers t, x, y") from None
                if not np.isfinite((t, x, y)).all():
                    raise ScenarioError(f"{path}, line {table.line_num}: t={t}, x={x}, y={y} must be finite")
                if times and t <= times[-1]:
                    raise ScenarioError(f"{path}, line {table.line_num}: t={t} must be later than {times[-1]}")
                times.append(t)
                points.append((x, y))
    except (OSError, UnicodeDecodeError, csv.Error) as problem:
        raise ScenarioError(f"track {path!r} cannot be read: {problem}") from None
    if len(times) < 2:
        raise ScenarioError(f"{path}: has {len(times)} points: at least 2 are needed")
    return _resampled(path, np.array(times), np.array(points), span_m, scenario)


def _resampled(path, times, points, span_m: float | None, scenario) -> np.ndarray:
    side, span = scenario.field.side_m, span_m
    if span is not None:
        low, high = points.min(axis=0), points.max(axis=0)
        extent = (high - low).max()
        if extent == 0:
            raise ScenarioError(f"{path}: the target does not move: cannot scale to span_m = {span}")
        points = side / 2 + (points - (low + high) / 2) * min(span, side) / extent
    elif points.min() < 0 or points.max() > side:
        raise ScenarioError(
            f"{path}: spans {points.min()}..{points.max()} m: must lie in the field 0..{side} m, or give span_m"
        )
    if not np.isfinite(points).all():
        raise ScenarioError(f"{path}: coordinates as large as this cannot be scaled to span_m = {span}")
    at = np.linspace(times[0], times[-1], scenario.periods + 1)
    track = np.empty((scenario.periods + 1, 4))
    for axis in (0, 1):
        track[:, 2 * axis] = np.interp(at, times, points[:, axis])
        track[:, 2 * axis + 1] = np.gradient(track[:, 2 * axis], scenario.period_s)
    return track
