"""How the residuals of two packets hang together, by their lags in time and in space: field, drift and white part."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import numpy as np
from scipy.optimize import least_squares

from wsn_env.bluetooth.packets import Packets, receiver_pairs
from wsn_env.models.recordings.calibration_file import CalibrationError

LAGS_S = (0.3, 0.7, 1.2, 2, 3, 4.5, 6.5, 9, 13, 20, 40)  # cells of `autocovariance`
LAGS_M = (0, 0.1, 0.25, 0.5, 0.8, 1.2, 2, 3, 5, 8)
FEWEST_PAIRS, MOST_PAIRS = 100, 10_000  # in a cell that counts; more weigh no more
LEAST_BIAS = 0.1  # dB^2


@dataclass(frozen=True)
class Autocovariance:
    """Mean product of the residuals of two packets of a receiver, in cells of their lag in time and in space.

    Args:
        lag_s, lag_m: (cells in time, cells in space) mean lags; the last row in time pairs different tracks, lag inf.
        covariance: mean product, dB^2; NaN where there is no pair.
        pairs: how many.
    """

    lag_s: np.ndarray
    lag_m: np.ndarray
    covariance: np.ndarray
    pairs: np.ndarray

    @property
    def counts(self) -> np.ndarray:
        """Cells that hold enough pairs."""
        return self.pairs > FEWEST_PAIRS


def lagged_covariance(packets: Packets, residual: np.ndarray, lags_s: tuple[float, float]) -> float:
    """Mean product of two residuals of a receiver on the same track whose times differ by a lag in (low, high]."""
    total = pairs = 0
    for i, j, same_track in receiver_pairs(packets):
        if same_track:
            lag = np.abs(packets.time_s[i, None] - packets.time_s[j])
            near = (lag > lags_s[0]) & (lag <= lags_s[1])
            total += residual[i] @ near @ residual[j]
            pairs += near.sum()
    return total / max(pairs, 1)


def autocovariance(packets: Packets, residual: np.ndarray) -> Autocovariance:
    """Mean products of the residuals of two packets of a receiver, in cells LAGS_S x LAGS_M of their lags.

    Pairs from different tracks are a lag of inf apart in time: of what they share, only the field is left.
    """
    shape = len(LAGS_S), len(LAGS_M) - 1
    other = shape[0] - 1  # the row of pairs from different tracks
    sums = np.zeros((4, shape[0] * shape[1]))
    for i, j, same_track in receiver_pairs(packets):
        apart = packets.position_m[i, None, :2] - packets.position_m[j, :2]
        metres = np.sqrt(apart[..., 0] ** 2 + apart[..., 1] ** 2)
        products = residual[i, None] * residual[j]
        seconds = np.abs(packets.time_s[i, None] - packets.time_s[j])
        if same_track:
            once = i[:, None] < j
            metres, products, seconds = metres[once], products[once], seconds[once]
            row = np.searchsorted(LAGS_S, seconds, side="right") - 1
        else:
            row = np.full(metres.shape, other)
        column = np.searchsorted(LAGS_M, metres, side="right") - 1
        good = (row >= 0) & (column < shape[1]) & ((row < other) ^ (not same_track))
        cell = row[good] * shape[1] + column[good]
        for k, values in enumerate((None, seconds, metres, products)):
            sums[k] += np.bincount(cell, None if values is None else values[good], sums.shape[1])
    pairs = sums[0]
    seconds, metres, products = np.divide(sums[1:], pairs, out=np.full((3, len(pairs)), np.nan), where=pairs > 0)
    seconds, metres, products, pairs = (values.reshape(shape) for values in (seconds, metres, products, pairs))
    seconds[other] = inf
    return Autocovariance(seconds, metres, products, pairs.astype(int))


def fit_bias(cells: Autocovariance) -> dict[str, float]:
    """Part what neighbouring packets share into field and drift, by least squares over the cells.

        c(dt, dx) = field_db2 exp(-dx / field_m) + drift_db2 exp(-dt / drift_s) - taken_db2

    `taken_db2` is what the residuals lost when the lines were fitted, which took up a part of the field. A cell weighs
    as many pairs as it has, MOST_PAIRS at most: far pairs from different tracks are many, but of few kinds.

    Returns: the five figures by their names.
    """
    counts = cells.counts
    if counts.sum() < 5:
        raise CalibrationError(f"{cells.pairs.sum()} pairs of packets are too few to tell the field from the drift")
    lag_s, lag_m, covariance = cells.lag_s[counts], cells.lag_m[counts], cells.covariance[counts]
    weight = np.sqrt(np.minimum(cells.pairs[counts], MOST_PAIRS))

    def misfit(point: np.ndarray) -> np.ndarray:
        return weight * (bias_covariance(lag_s, lag_m, *point) - covariance)

    scale = max(covariance.max(), LEAST_BIAS)
    bounds = (0, 0.1, 0, 0.3, -scale), (4 * scale, 20, 4 * scale, 60, scale)
    starts = [(scale / 2, length, scale / 2, time, 0) for length in (0.5, 1.5) for time in (3, 8)]
    best = min((least_squares(misfit, start, bounds=bounds) for start in starts), key=lambda found: found.cost)
    return dict(zip(("field_db2", "field_m", "drift_db2", "drift_s", "taken_db2"), best.x.tolist()))


def bias_covariance(
    lag_s: np.ndarray,
    lag_m: np.ndarray,
    field_db2: float,
    field_m: float,
    drift_db2: float,
    drift_s: float,
    taken_db2: float,
) -> np.ndarray:
    """Covariance of the residuals of two packets of a receiver; see `fit_bias`.

    Args:
        lag_s, lag_m: (...,).

    Returns: (...,) dB^2.
    """
    return field_db2 * np.exp(-lag_m / field_m) + drift_db2 * np.exp(-lag_s / drift_s) - taken_db2
