"""Recordings, calibrations and maps as a scenario names them: by file."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from wsn_env.models.quantity import ScenarioError
from wsn_env.models.recordings.dataset import Track, read_track
from wsn_env.models.recordings.receivers import DEVICES, PARAMETERS, DatasetError

CELL_M = 0.25  # of a residual map
CALIBRATED = (  # quantities of a calibration, all of them
    "positions side_m depth_m heights_m beacon_m at_1m_db exponents field_db field_m drift_db drift_s main_db"
    " main_sd_db fade_share fade_db fade_sd_db loss loss_after_loss interval_s bias_s"
).split()


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
    return Path(path).stat().st_mtime_ns, *(file.stat().st_mtime_ns for file in beside if file.exists())


@lru_cache(maxsize=32)
def _read(path: str, *stamps: int) -> Track:
    return read_track(path)


def read_quantities(path: str | Path) -> dict[str, Any]:
    """The scenario quantities of a file that `wsn calibrate` wrote.

    Raises:
        ScenarioError: names the file and what is wrong with it.
    """
    try:
        plain = json.loads(Path(path).read_text(encoding="utf-8"))
        quantities = plain["quantities"]
        if not isinstance(quantities, dict):
            raise TypeError("its 'quantities' must be a table")
        missing = [name for name in CALIBRATED if name not in quantities]
        if missing:
            raise KeyError(f"its 'quantities' lack {', '.join(missing)}")
    except (OSError, ValueError, KeyError, TypeError) as problem:
        raise ScenarioError(f"calibration = {str(path)!r}: is no file of `wsn calibrate`: {problem!r}") from None
    if isinstance(quantities.get("positions"), list):
        quantities["positions"] = tuple(map(tuple, quantities["positions"]))
    return quantities


def load_map(path: str | Path) -> np.ndarray:
    """A residual map of `wsn calibrate --maps`: (S, nx, ny) float32 dB. Executes nothing.

    Raises:
        ScenarioError: names the file and what is wrong with it.
    """
    try:
        with np.load(path, allow_pickle=False) as content:
            field, cell = content["residual_db"], content["cell_m"]
    except (OSError, ValueError, KeyError, EOFError, TypeError, AttributeError, zipfile.BadZipFile) as error:
        raise ScenarioError(f"{path}: is no residual map: {error}") from None
    if cell.shape or cell != CELL_M:
        raise ScenarioError(f"{path}: cell_m = {cell!r}: must be {CELL_M}")
    if field.ndim != 3 or field.dtype != np.float32 or not np.isfinite(field).all():
        kind = f"{field.dtype} of shape {field.shape}"
        raise ScenarioError(f"{path}: residual_db = {kind}: must be finite float32 of shape (S, nx, ny)")
    return field
