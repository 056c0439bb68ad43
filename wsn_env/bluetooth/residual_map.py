"""Maps of what a calibration's lines miss: the field of every receiver as far as the recorded tracks show it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from wsn_env.bluetooth.calibration import Calibration
from wsn_env.bluetooth.packets import concatenate_tracks, residuals
from wsn_env.evaluation.files import replacing
from wsn_env.models.arguments import checked
from wsn_env.models.recordings.calibration_file import CalibrationError
from wsn_env.models.recordings.dataset import Track
from wsn_env.models.recordings.replay import CELL_M, map_cells

VARIANCE, LENGTH_M = 5.0, 1.5  # of the field, dB^2 and m
SHARED_NOISE, PACKET_NOISE = 3.0, 18.0  # dB^2 of a cell's mean: drift, and white part over the number of packets


@checked
def residual_map(tracks: Sequence[Track], calibration: Calibration) -> np.ndarray:
    """Mean of the field, conditioned on the residuals of the calibration's own tracks: Gaussian process regression.

        k(d) = 5 exp(-d / 1.5 m) dB^2,   noise of a cell's mean residual = 3 + 18 / packets dB^2

    Packets are gathered in cells of .25 m; a cell stands where its packets are on average. Tracks that the calibration
    was not made of are not looked at, so a calibration without a track gives a map without it.

    Returns: (S, nx, ny) float32, dB to add to the lines; cell (i, j) is centred at ((i + 1/2) .25, (j + 1/2) .25) m.
    """
    by_name = {track.name: track for track in tracks}
    missing = [name for name in calibration.tracks if name not in by_name]
    if missing:
        raise CalibrationError(f"tracks: {', '.join(missing)} is missing, which the calibration was made of")
    chosen = [by_name[name] for name in calibration.tracks]
    packets = concatenate_tracks(chosen)
    residual = residuals(packets, calibration)
    nx, ny = map_cells(chosen[0].receivers.limits_m)
    cells = np.stack(np.meshgrid(np.arange(nx), np.arange(ny), indexing="ij"), axis=-1).reshape(-1, 2)
    centres = (cells + 0.5) * CELL_M
    fields = []
    for receiver in range(len(chosen[0].receivers.names)):
        heard = packets.receiver == receiver
        position = packets.position_m[heard, :2]
        place, mean, count = _cells(position, residual[heard])
        covariance = _field_covariance(place, place) + np.diag(SHARED_NOISE + PACKET_NOISE / count)
        weights = cho_solve(cho_factor(covariance, lower=True), mean)
        fields.append((_field_covariance(centres, place) @ weights).reshape(nx, ny))
    return np.array(fields, np.float32)


@checked
def save_map(field: np.ndarray, path: str | Path) -> None:
    """Write a map as .npz."""
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, residual_db=field, cell_m=np.float64(CELL_M))


def _cells(position: np.ndarray, residual: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean position (C, 2), mean residual (C,) and number of packets (C,) in every cell with packets."""
    _, cell = np.unique(np.floor(position / CELL_M).astype(int), axis=0, return_inverse=True)
    cell = cell.ravel()
    count = np.bincount(cell)
    x, y, mean = (np.bincount(cell, values) / count for values in (*position.T, residual))
    return np.stack([x, y], axis=1), mean, count


def _field_covariance(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Covariance of the field at a (N, 2) with the field at b (M, 2)."""
    distance = np.hypot(a[:, None, 0] - b[:, 0], a[:, None, 1] - b[:, 1])
    return VARIANCE * np.exp(-distance / LENGTH_M)
