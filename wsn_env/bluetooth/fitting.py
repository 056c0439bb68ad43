"""Fits a calibration to recorded tracks.

`calibrate` estimates all quantities; `leave_one_out` leaves out every track in turn, so that the track can be replayed
with a calibration that is independent of it.
"""

from __future__ import annotations

import platform
from collections.abc import Sequence
from dataclasses import replace
from importlib.metadata import version
from math import log, sqrt
from typing import Any

import numpy as np
from scipy.optimize import minimize

from wsn_env.bluetooth.calibration import Calibration
from wsn_env.bluetooth.covariance import LEAST_BIAS, autocovariance, fit_bias, lagged_covariance
from wsn_env.bluetooth.losses import measure_losses
from wsn_env.bluetooth.packets import Packets, concatenate_tracks
from wsn_env.models.arguments import checked
from wsn_env.models.quantity import ScenarioError
from wsn_env.models.recordings.calibration_file import QUANTITIES, SCALARS, CalibrationError, check_quantities
from wsn_env.models.recordings.dataset import Track
from wsn_env.models.recordings.receivers import Receivers

EXPONENT_SD = 0.3  # of a receiver's exponent about the common one, before the receiver is heard
EXPONENT_NOISE_DB = 5.3 * sqrt(8)  # sd of a level for this purpose: eight neighbouring packets tell as much as one
SHORT_S, LONG_S = (0.3, 2.0), (4.5, 5.5)  # lags of the two autocovariances that the tracker's bias comes from
TO_LAG_ZERO = 1.2  # from the autocovariance at the short lags to the variance
SAME_PLACE = 1e-9  # dB^2, variance of the distance's level under which the beacon stands still
LEAST_WHITE = 1.0  # dB^2
TINY = 1e-300  # density of what cannot be
BIAS_S = (2.0, 15.0)
DECIMALS = 6


@checked
def calibrate(tracks: Sequence[Track]) -> Calibration:
    """Estimate all quantities from recorded tracks that share their receivers.

    The path loss is a least-squares line per receiver (`fit_path_loss`). The residuals' variance is parted by their
    autocovariance c(lag): bias^2 = 1.2 c(.3 to 2 s), white^2 = variance - bias^2, and the tracker's time constant
    is 4 s / log(c(.3 to 2 s) / c(4.5 to 5.5 s)), between 2 and 15 s. Field and drift share bias^2 in the proportion
    that `fit_bias` finds, whose own sum differs somewhat and stands in `found`; a mixture of two normal distributions
    makes up white^2 (`fit_mixture`).
    """
    receivers = _shared_receivers(tracks)
    packets = concatenate_tracks(tracks)
    count = len(receivers.names)
    at_1m, exponents = fit_path_loss(packets, receivers.names)
    residual = packets.level_db - at_1m[packets.receiver] + exponents[packets.receiver] * packets.distance_db
    variance = residual.var()
    short, long = (lagged_covariance(packets, residual, lags) for lags in (SHORT_S, LONG_S))
    bias = max(TO_LAG_ZERO * short, LEAST_BIAS)
    white = max(variance - bias, LEAST_WHITE)
    bias_s = np.clip(4 / max(1e-3, log(max(short, 1e-3) / max(long, 1e-3))), *BIAS_S)
    fitted = fit_bias(autocovariance(packets, residual))
    field_share = fitted["field_db2"] / max(fitted["field_db2"] + fitted["drift_db2"], 1e-9)
    mixture = fit_mixture(residual, bias, white)
    losses = measure_losses(tracks)
    heard = np.bincount(packets.receiver, minlength=count)
    mean = np.bincount(packets.receiver, residual, count) / heard
    quantities = {
        "positions": receivers.positions_m[:, :2],
        "side_m": receivers.limits_m[0],
        "depth_m": receivers.limits_m[1],
        "heights_m": receivers.positions_m[:, 2],
        "beacon_m": packets.position_m[:, 2].mean(),
        "at_1m_db": at_1m,
        "exponents": exponents,
        "field_db": sqrt(bias * field_share),
        "field_m": fitted["field_m"],
        "drift_db": sqrt(bias * (1 - field_share)),
        "drift_s": fitted["drift_s"],
        **mixture,
        "loss": losses["loss"],
        "loss_after_loss": losses["loss_after_loss"],
        "interval_s": losses["interval_s"],
        "bias_s": bias_s,
    }
    found = {
        "receivers": list(receivers.names),
        "packets": len(residual),
        "packets_by_track": np.bincount(packets.track),
        "packets_by_receiver": heard,
        "residual_db": sqrt(variance),
        "residual_mean_by_receiver_db": mean,
        "residual_sd_by_receiver_db": np.sqrt(np.bincount(packets.receiver, residual**2, count) / heard - mean**2),
        "residual_mean_by_track_db": np.bincount(packets.track, residual) / np.bincount(packets.track),
        "autocovariance_short_db2": short,
        "autocovariance_long_db2": long,
        "autocovariance_fit": fitted,
        "bias_db": sqrt(bias),
        "white_db": sqrt(white),
        "mixture_of_residuals": fit_mixture(residual * sqrt(white / variance), 0.0, white),
        "skewness": float(np.mean((residual - residual.mean()) ** 3) / variance**1.5),
        **{name: value for name, value in losses.items() if name not in SCALARS},
    }
    made_by = {"python": platform.python_version()} | {name: version(name) for name in ("wsn_env", "numpy", "scipy")}
    names = tuple(track.name for track in tracks)
    ordered = {name: _json_value(quantities[name]) for name in QUANTITIES}
    try:
        check_quantities(ordered)
    except (CalibrationError, ScenarioError) as problem:
        raise CalibrationError(f"tracks = {list(names)!r:.80}: show no radio that can be: {problem}") from None
    return Calibration(names, None, ordered, {name: _json_value(value) for name, value in found.items()}, made_by)


def leave_one_out(tracks: Sequence[Track]) -> list[Calibration]:
    """For every track the calibration by all the others."""
    if len(tracks) < 2:
        raise CalibrationError(f"tracks = {[track.name for track in tracks]}: at least two, or nothing is left")
    kept = ([track for track in tracks if track is not out] for out in tracks)
    return [replace(calibrate(some), left_out=out.name) for some, out in zip(kept, tracks)]


def fit_path_loss(packets: Packets, names: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """Least-squares lines, with slopes that are drawn towards the common one.

        n = sum_s Sxz_s / sum_s Sxx_s,  n_s = (Sxz_s + k n) / (Sxx_s + k),  P0_s = mean z - n_s mean x

    for x = -10 log10(d), z = level, sums of squares Sxx and products Sxz about the receiver's means, and
    k = (EXPONENT_NOISE_DB / EXPONENT_SD)^2.

    Args:
        names: of the receivers, for errors.

    Returns: P0 (S,) dBm, n (S,).
    """
    x, z, s = -packets.distance_db, packets.level_db, packets.receiver
    heard = np.bincount(s, minlength=len(names))
    if heard.min() < 2:
        silent = int(heard.argmin())
        raise CalibrationError(f"receiver {names[silent]}: {heard[silent]} packets in these tracks, two are needed")
    x_mean, z_mean = (np.bincount(s, values, len(names)) / heard for values in (x, z))
    x = x - x_mean[s]
    xx, xz = np.bincount(s, x * x, len(names)), np.bincount(s, x * z, len(names))
    if xx.sum() < SAME_PLACE * len(x):
        raise CalibrationError("the beacon's distance to each receiver never changes: no path loss can be told from it")
    pull = (EXPONENT_NOISE_DB / EXPONENT_SD) ** 2
    exponents = (xz + pull * xz.sum() / xx.sum()) / (xx + pull)
    return z_mean - exponents * x_mean, exponents


def fit_mixture(residual: np.ndarray, bias: float, white: float) -> dict[str, float]:
    """The white part as two normal components with mean zero and variance `white` over both, by maximum likelihood.

        (1 - w) N(w g, s^2) + w N(-(1 - w) g, r s^2),   w (1 - w) g^2 = b white,   (1 - w + w r) s^2 = (1 - b) white

    for the fading's weight w, the share b of the variance that lies between the components, and the ratio r of
    variances. A residual is the sum of the white part and of field and drift, normal with variance `bias`, which is
    added to the variance of either component.
    """
    values, counts = np.unique(np.round(residual, 1), return_counts=True)

    def parts(point: np.ndarray) -> tuple[float, float, float, float, float]:
        share, between, ratio = point[0], point[1], np.exp(point[2])
        gap = np.sqrt(between * white / (share * (1 - share)))
        narrow = (1 - between) * white / (1 - share + share * ratio)
        return share, share * gap, narrow, -(1 - share) * gap, narrow * ratio

    def negative_log_likelihood(point: np.ndarray) -> float:
        share, main, narrow, fade, wide = parts(point)
        density = (1 - share) * normal_density(values, main, narrow + bias)
        density += share * normal_density(values, fade, wide + bias)
        return -(counts @ np.log(np.maximum(density, TINY))) / counts.sum()

    bounds = [(0.02, 0.98), (0, 0.95), (-3, 3)]
    starts = (0.2, 0.5, 1), (0.4, 0.3, 0.5), (0.5, 0.1, 0.1)
    options = {"xatol": 1e-5, "fatol": 1e-11, "maxfev": 2000}
    found = (
        minimize(negative_log_likelihood, start, bounds=bounds, method="Nelder-Mead", options=options)
        for start in starts
    )
    share, main, narrow, fade, wide = parts(min(found, key=lambda result: result.fun).x)
    return {
        "main_db": main,
        "main_sd_db": np.sqrt(narrow),
        "fade_share": share,
        "fade_db": fade,
        "fade_sd_db": np.sqrt(wide),
    }


def normal_density(x: np.ndarray, mean: float, variance: float) -> np.ndarray:
    """Density of the normal distribution."""
    return np.exp(-0.5 * (x - mean) ** 2 / variance) / np.sqrt(2 * np.pi * variance)


def _json_value(value: Any) -> Any:
    """Numbers and lists of them, as JSON has them; rounded, so that files of the same data are the same."""
    if isinstance(value, dict):
        return {name: _json_value(item) for name, item in value.items()}
    if isinstance(value, list | np.ndarray):
        return [_json_value(item) for item in value]
    if isinstance(value, str):
        return value
    return int(value) if isinstance(value, int | np.integer) else round(float(value), DECIMALS) + 0.0


def _shared_receivers(tracks: Sequence[Track]) -> Receivers:
    """The receivers of all tracks, which have to be the same."""
    if not tracks:
        raise CalibrationError("tracks = []: at least one is needed")
    first = tracks[0].receivers
    names = [track.name for track in tracks]
    if len(set(names)) < len(names):
        raise CalibrationError(f"tracks = {names}: a track is there twice")
    for track in tracks:
        own = track.receivers
        if tuple(own.names) != tuple(first.names) or not np.array_equal(own.positions_m, first.positions_m):
            raise CalibrationError(f"track {track.name}: its receivers are not those of track {names[0]}")
        if len(track.level_db) == 0:
            raise CalibrationError(f"track {track.name}: it holds no packet")
    return first
