"""Recordings, calibrations and maps as a scenario names them: by file."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from wsn_env.models.quantity import ScenarioError
from wsn_env.models.recordings.dataset import Track, read_track
from wsn_env.models.recordings.files import DatasetError, read_file
from wsn_env.models.recordings.receivers import DEVICES, PARAMETERS

CELL_M = 0.25  # of a residual map
MOST_DB = 100.0  # in it


def recorded(path: str | Path, period_s: float) -> Any:
    """A recording by periods: levels (K, S) [dBm], numbers of packets (K, S), positions (K, 2) [m].

    Raises:
        ScenarioError: names the file and the line where reading cannot go on.
    """
    with _named(path):
        return _read(str(path), *_stamps(path)).per_period(period_s)


def periods_of(path: str | Path, period_s: float) -> int:
    """Whole periods of a recording."""
    return len(recorded(path, period_s)[0])


def receivers_of(path: str | Path) -> Any:
    """Where the receivers of a recording stand: (S, 3) m."""
    with _named(path):
        return _read(str(path), *_stamps(path)).receivers.positions_m


@contextmanager
def _named(path: str | Path) -> Iterator[None]:
    try:
        yield
    except OSError as problem:
        raise ScenarioError(f"Replay.recording = {str(path)!r}: cannot be read: {problem}") from None
    except DatasetError as problem:
        raise ScenarioError(f"Replay.recording: {problem}") from None


def _stamps(path: str | Path) -> tuple[int, ...]:
    """Of the recording and of what says where its receivers stand: a file that has changed is read again."""
    beside = (Path(path).with_name(name) for name in (DEVICES, PARAMETERS))
    states = [Path(path).stat(), *(file.stat() for file in beside if file.exists())]
    return tuple(number for state in states for number in (state.st_mtime_ns, state.st_size))


@lru_cache(maxsize=32)
def _read(path: str, *stamps: int) -> Track:
    return read_track(path)


def map_cells(room_m: tuple[float, float]) -> tuple[int, int]:
    """(nx, ny) cells of a residual map; a calibration rounds the room's extents."""
    nx, ny = (math.ceil(round(extent, 6) / CELL_M) for extent in room_m)
    return nx, ny


def load_map(path: str | Path, receivers: int, room_m: tuple[float, float]) -> np.ndarray:
    """A residual map of `wsn calibrate --maps`: (S, nx, ny) float32 dB. Executes nothing.

    Raises:
        ScenarioError: names the file and what is wrong with it.
    """
    try:
        with np.load(io.BytesIO(read_file(path)), allow_pickle=False) as content:
            field, cell = content["residual_db"], content["cell_m"]
    except DatasetError as error:
        raise ScenarioError(f"residual_map = {str(path)!r}: {error}") from None
    except Exception as error:  # zip, its decompressors and NumPy raise what they like of a damaged file
        why = f"{type(error).__name__}: {' '.join(str(error).split()):.200}"
        raise ScenarioError(f"{path}: is no residual map: {why}") from None
    if cell.shape or cell != CELL_M:
        raise ScenarioError(f"{path}: cell_m = {cell!r:.60}: must be {CELL_M}")
    shape = (receivers, *map_cells(room_m))
    if field.shape != shape or field.dtype != np.float32 or not (np.abs(field) <= MOST_DB).all():
        kind = f"{field.dtype} of shape {field.shape}"
        raise ScenarioError(
            f"{path}: residual_db = {kind}: must be float32 of shape {shape}, for {receivers} receivers in a room of"
            f" {room_m[0]:g} x {room_m[1]:g} m, between -{MOST_DB:g} and {MOST_DB:g} dB"
        )
    return field
