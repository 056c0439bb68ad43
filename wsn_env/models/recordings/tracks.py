"""Recorded tracks from CSV files."""

import csv
import io
from collections.abc import Iterator
from typing import Any

import numpy as np

from wsn_env.models.quantity import ScenarioError
from wsn_env.models.recordings.files import DatasetError, parse_number, read_text, shown
from wsn_env.models.recordings.receivers import OUTSIDE_M, in_room

COLUMNS = ("t", "x", "y")
LONGEST_STEP = 0.95  # of a track's time between two of its points, unless they are fewer than `FEWEST`
FEWEST = 10


def read_track(path: str, span_m: float | None, scenario: Any) -> np.ndarray:
    """A recorded track (periods + 1, 4), resampled linearly to the horizon, scaled and centred on request.

    Times count from the first to the last, whatever their unit, as long as it is one. Nothing is left out.

    Args:
        span_m: scaled so that the longer side is so long, and centred; None: as recorded.
        path: CSV with a header naming at least t, x, y [s, m, m]; times must increase.

    Raises:
        ScenarioError: names the file, the line and what is allowed.
    """
    try:
        rows = np.array(list(_numbers(path, read_text(path)))).reshape(-1, 4)
    except DatasetError as problem:
        raise ScenarioError(f"track {problem}") from None
    if len(rows) < 2:
        raise ScenarioError(f"{path}: has {len(rows)} points: at least 2 are needed")
    lines, times = rows[:, 0], rows[:, 1]
    with np.errstate(over="ignore", invalid="ignore"):
        steps = np.diff(times) / (times[-1] - times[0])
        longest = int(steps.argmax())
        if len(rows) >= FEWEST and steps[longest] > LONGEST_STEP:
            raise ScenarioError(
                f"{path}, line {lines[longest + 1]:.0f}: t={times[longest + 1]:g} comes after t={times[longest]:g},"
                f" {steps[longest]:.1%} of the whole track: must be in the same unit"
            )
        track = _resampled(path, times, rows[:, 2:], span_m, scenario)
    if not np.isfinite(track).all():
        raise ScenarioError(f"{path}: times or coordinates up to {np.abs(rows).max():g} are too large to be resampled")
    return track


def _numbers(path: str, text: str) -> Iterator[tuple[int, float, float, float]]:
    """Line, t, x, y of every row."""
    records = _records(path, text)
    _, header = next(records, (1, []))
    names = [name.strip() for name in header]
    for name in COLUMNS:
        if names.count(name) != 1:
            what = "missing" if name not in names else "there twice"
            raise ScenarioError(
                f"{path}: column {name!r} is {what}: the header must name t, x, y with commas between them; it is"
                f" {shown(','.join(names))}"
            )
    places = [names.index(name) for name in COLUMNS]
    before = -np.inf
    for line, fields in records:
        if len(fields) < len(names) or any(fields[len(names) :]):
            raise ScenarioError(
                f"{path}, line {line}: has {len(fields)} fields: must be {len(names)}, as in the header, with commas"
                " between them and none in numbers"
            )
        values = []
        for name, place in zip(COLUMNS, places):
            try:
                values.append(parse_number(fields[place]))
            except ValueError as problem:
                raise ScenarioError(f"{path}, line {line}: {name}: {problem}") from None
        t, x, y = values
        if not np.isfinite(values).all():
            raise ScenarioError(f"{path}, line {line}: t={t}, x={x}, y={y} must be finite")
        if t <= before:
            raise ScenarioError(f"{path}, line {line}: t={t} must be later than {before}")
        before = t
        yield line, t, x, y


def _records(path: str, text: str) -> Iterator[tuple[int, list[str]]]:
    """Line and fields of what is not blank; nothing may go on in the next line, as after a stray quote."""
    table = csv.reader(io.StringIO(text, newline=""), skipinitialspace=True, strict=True)
    while True:
        line = table.line_num + 1
        try:
            fields = next(table, None)
        except csv.Error as problem:
            raise ScenarioError(f"{path}, line {line}: cannot be read: {problem}: is there a stray quote?") from None
        if fields is None:
            return
        if table.line_num > line:
            raise ScenarioError(f"{path}, line {line}: goes on to line {table.line_num}: is there a stray quote?")
        if fields:
            yield line, fields


def _resampled(path: str, times: np.ndarray, points: np.ndarray, span_m: float | None, scenario: Any) -> np.ndarray:
    room = np.array(scenario.field.room_m)
    if span_m is not None:
        low, high = points.min(axis=0), points.max(axis=0)
        extent = (high - low).max()
        if extent == 0:
            raise ScenarioError(f"{path}: the target does not move: cannot scale to span_m = {span_m}")
        points = room / 2 + (points - (low + high) / 2) * min(span_m, room.min()) / extent
    elif not in_room(points[:, 0], points[:, 1], scenario.field.room_m).all():
        raise ScenarioError(
            f"{path}: spans {points.min()}..{points.max()} m: must lie in the field of {room[0]:g} x {room[1]:g} m, or"
            f" at most {OUTSIDE_M:g} m outside, or give span_m"
        )
    at = np.linspace(times[0], times[-1], scenario.periods + 1)
    track = np.empty((scenario.periods + 1, 4))
    for axis in (0, 1):
        track[:, 2 * axis] = np.interp(at, times, points[:, axis])
        track[:, 2 * axis + 1] = np.gradient(track[:, 2 * axis], scenario.period_s)
    return track
