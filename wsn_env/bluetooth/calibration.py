"""What recorded tracks tell of a room: path loss, what disturbs a level and how fast it forgets, losses.

A level is, in dB,

    level = P0_s - 10 n_s log10(d) + field_s(position) + drift_s(time) + white

for receiver s at the distance d [m] of the beacon: a field that stands in the room (it has the same value whenever
the beacon comes back), a drift that forgets with time, and a white part of its own for every packet. White is a
mixture of two normal distributions, of which the lower one is called fading; its mean over all is zero.

`calibrate` estimates all of it from recorded tracks; `leave_one_out` leaves out every track in turn, so that the track
can be replayed against figures that never saw it.
"""

from __future__ import annotations

import json
import platform
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from math import inf, log, sqrt
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import least_squares, minimize

from wsn_env.evaluation.files import replacing
from wsn_env.models.quantity import ScenarioError, check_quantity, suggest

if TYPE_CHECKING:
    from wsn_env.models.recordings.dataset import Track

KIND, VERSION = "wsn_env calibration", 1

NEAREST_M = 0.1  # closer distances count as this one
EXPONENT_SD = 0.3  # of a receiver's exponent about the common one, before the receiver is heard
EXPONENT_NOISE_DB = 5.3 * sqrt(8)  # sd of a level for this purpose: eight neighbouring packets tell as much as one
SHORT_S, LONG_S = (0.3, 2.0), (4.5, 5.5)  # lags of the two autocovariances that the tracker's bias comes from
TO_LAG_ZERO = 1.2  # from the autocovariance at the short lags to the variance
SAME_PLACE = 1e-9  # dB^2, variance of the distance's level under which the beacon stands still
LEAST_BIAS, LEAST_WHITE = 0.1, 1.0  # dB^2
TINY = 1e-300  # density of what cannot be
BIAS_S = (2.0, 15.0)
LAGS_S = (0.3, 0.7, 1.2, 2, 3, 4.5, 6.5, 9, 13, 20, 40)  # cells of `autocovariance`
LAGS_M = (0, 0.1, 0.25, 0.5, 0.8, 1.2, 2, 3, 5, 8)
FEWEST_PAIRS, MOST_PAIRS = 100, 10_000  # in a cell that counts; more weigh no more
BURST_S = 0.05  # packets of one advertisement lie closer together
FEWEST_HEARD = 0.25  # of the receivers, or it is no advertisement
NEXT = 1.5  # intervals at most between two advertisements of which none is missing
DECIMALS = 6

# What a scenario takes: each quantity's meaning and bounds; lists hold one figure a receiver.
LISTS = {
    "positions": ("x and y of the receivers [m]", {}),
    "heights_m": ("heights of the receivers [m]", {}),
    "at_1m_db": ("level at 1 m (P0) [dBm]", {}),
    "exponents": ("path loss exponents (n)", dict(above=0)),
}
NUMBERS = {
    "side_m": ("width of the room, along x", dict(above=0)),
    "depth_m": ("depth of the room, along y", dict(above=0)),
    "beacon_m": ("mean height of the beacon", {}),
    "field_db": ("sd of the field that stands in the room", dict(at_least=0)),
    "field_m": ("its correlation length", dict(above=0)),
    "drift_db": ("sd of the drift", dict(at_least=0)),
    "drift_s": ("its time constant", dict(above=0)),
    "main_db": ("mean of the white part's upper component", {}),
    "main_sd_db": ("its sd", dict(above=0)),
    "fade_share": ("weight of the lower component", dict(at_least=0, at_most=1)),
    "fade_db": ("its mean", {}),
    "fade_sd_db": ("its sd", dict(above=0)),
    "loss": ("probability that a packet is lost", dict(at_least=0, below=1)),
    "loss_after_loss": ("the same if the packet before was lost", dict(at_least=0, below=1)),
    "interval_s": ("advertising interval", dict(above=0)),
    "bias_s": ("time constant of the tracker's bias", dict(above=0)),
}
QUANTITIES = LISTS | NUMBERS


class CalibrationError(ValueError):
    """A calibration cannot be made, or a file holds none; the message names the file, the field and its value."""


@dataclass(frozen=True)
class Calibration:
    """A room as recorded tracks show it.

    Args:
        tracks: names of the tracks that it is made of.
        left_out: name of the track that was left out, if any.
        quantities: what a scenario takes, by the names in `QUANTITIES`.
        found: further figures, for people.
        versions: what made it.
    """

    tracks: tuple[str, ...]
    left_out: str | None
    quantities: dict
    found: dict
    versions: dict

    @property
    def bias_db(self) -> float:
        """Sd of what neighbouring packets share: field and drift."""
        return sqrt(self.quantities["field_db"] ** 2 + self.quantities["drift_db"] ** 2)

    @property
    def white_db(self) -> float:
        """Sd of the white part."""
        q = self.quantities
        main = q["main_db"] ** 2 + q["main_sd_db"] ** 2
        return sqrt((1 - q["fade_share"]) * main + q["fade_share"] * (q["fade_db"] ** 2 + q["fade_sd_db"] ** 2))

    def save(self, path: str | Path) -> None:
        """Write a JSON file."""
        content = {"kind": KIND, "version": VERSION, "tracks": list(self.tracks), "left_out": self.left_out}
        content |= {"quantities": self.quantities, "found": self.found, "versions": self.versions}
        with replacing(path) as temporary:
            temporary.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")

    @classmethod
    def load(cls, path: str | Path) -> Calibration:
        """Read what `save` wrote; whatever is wrong raises CalibrationError."""
        try:
            content = json.loads(Path(path).read_text(encoding="utf-8"))
        except OSError as error:
            raise CalibrationError(f"{path}: cannot be read: {error.strerror or error}") from error
        except ValueError as error:
            raise CalibrationError(f"{path}: is no JSON: {error}") from error
        try:
            _check(content)
        except (CalibrationError, ScenarioError) as error:
            raise CalibrationError(f"{path}: {error}") from None
        names = ("left_out", "quantities", "found", "versions")
        return cls(tuple(content["tracks"]), **{name: content[name] for name in names})


@dataclass(frozen=True)
class Packets:
    """Packets of several tracks, one after the other.

    Args:
        track, receiver: (N,) numbers from 0.
        time_s: (N,) from the start of the track.
        level_db: (N,).
        position_m: (N, 3) of the beacon.
        distance_m: (N,) from beacon to receiver.
    """

    track: np.ndarray
    receiver: np.ndarray
    time_s: np.ndarray
    level_db: np.ndarray
    position_m: np.ndarray
    distance_m: np.ndarray


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


def calibrate(tracks: Sequence[Track]) -> Calibration:
    """Estimate all quantities from recorded tracks that share their receivers.

    The path loss is a least-squares line per receiver (`fit_path_loss`). The residuals' variance is parted by their
    autocovariance c(lag): bias^2 = 1.2 c(.3 to 2 s), white^2 = variance - bias^2, and the tracker's time constant
    is 4 s / log(c(.3 to 2 s) / c(4.5 to 5.5 s)), between 2 and 15 s. Field and drift share bias^2 in the proportion
    that `fit_bias` finds, whose own sum differs somewhat and stands in `found`; a mixture of two normal distributions
    makes up white^2 (`fit_mixture`).
    """
    receivers = _shared_receivers(tracks)
    packets = gather(tracks)
    count = len(receivers.names)
    at_1m, exponents = fit_path_loss(packets, receivers.names)
    residual = packets.level_db - at_1m[packets.receiver] + exponents[packets.receiver] * _decades(packets)
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
        **{name: value for name, value in losses.items() if name not in NUMBERS},
    }
    made_by = {"python": platform.python_version()} | {name: version(name) for name in ("wsn_env", "numpy", "scipy")}
    names = tuple(track.name for track in tracks)
    ordered = {name: _plain(quantities[name]) for name in QUANTITIES}
    return Calibration(names, None, ordered, {name: _plain(value) for name, value in found.items()}, made_by)


def leave_one_out(tracks: Sequence[Track]) -> list[Calibration]:
    """For every track the calibration by all the others."""
    if len(tracks) < 2:
        raise CalibrationError(f"tracks = {[track.name for track in tracks]}: at least two, or nothing is left")
    kept = ([track for track in tracks if track is not out] for out in tracks)
    return [replace(calibrate(some), left_out=out.name) for some, out in zip(kept, tracks)]


def gather(tracks: Iterable[Track]) -> Packets:
    """The packets of all tracks in one."""
    tracks = list(tracks)
    receiver, time, level, position = (
        np.concatenate([getattr(track, name) for track in tracks])
        for name in ("receiver", "time_s", "level_db", "position_m")
    )
    number = np.repeat(np.arange(len(tracks)), [len(track.level_db) for track in tracks])
    where = tracks[0].receivers.positions_m
    distance = np.maximum(np.sqrt(np.sum((position - where[receiver]) ** 2, axis=1)), NEAREST_M)
    return Packets(number, receiver, time, level, position, distance)


def residuals(packets: Packets, calibration: Calibration) -> np.ndarray:
    """Levels minus what the calibration's lines expect.

    Returns: (N,), dB.
    """
    at_1m, exponents = (np.array(calibration.quantities[name]) for name in ("at_1m_db", "exponents"))
    return packets.level_db - at_1m[packets.receiver] + exponents[packets.receiver] * _decades(packets)


def fit_path_loss(packets: Packets, names: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """Least-squares lines, with slopes that are drawn towards the common one.

        n = sum_s Sxz_s / sum_s Sxx_s,  n_s = (Sxz_s + k n) / (Sxx_s + k),  P0_s = mean z - n_s mean x

    for x = -10 log10(d), z = level, sums of squares Sxx and products Sxz about the receiver's means, and
    k = (EXPONENT_NOISE_DB / EXPONENT_SD)^2.

    Args:
        names: of the receivers, for errors.

    Returns: P0 (S,) dBm, n (S,).
    """
    x, z, s = -_decades(packets), packets.level_db, packets.receiver
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


def lagged_covariance(packets: Packets, residual: np.ndarray, lags_s: tuple[float, float]) -> float:
    """Mean product of two residuals of a receiver on the same track whose times differ by a lag in (low, high]."""
    total = pairs = 0
    for i, j in _pairs(packets):
        if i is j:
            lag = np.abs(packets.time_s[i, None] - packets.time_s[i])
            near = (lag > lags_s[0]) & (lag <= lags_s[1])
            total += residual[i] @ near @ residual[i]
            pairs += near.sum()
    return total / max(pairs, 1)


def autocovariance(packets: Packets, residual: np.ndarray) -> Autocovariance:
    """Mean products of the residuals of two packets of a receiver, in cells LAGS_S x LAGS_M of their lags.

    Pairs from different tracks are a lag of inf apart in time: of what they share, only the field is left.
    """
    shape = len(LAGS_S), len(LAGS_M) - 1
    other = shape[0] - 1  # the row of pairs from different tracks
    sums = np.zeros((4, shape[0] * shape[1]))
    for i, j in _pairs(packets):
        apart = packets.position_m[i, None, :2] - packets.position_m[j, :2]
        metres = np.sqrt(apart[..., 0] ** 2 + apart[..., 1] ** 2)
        products = residual[i, None] * residual[j]
        seconds = np.abs(packets.time_s[i, None] - packets.time_s[j])
        if i is j:
            once = np.triu_indices(len(i), 1)
            metres, products, seconds = metres[once], products[once], seconds[once]
            row = np.searchsorted(LAGS_S, seconds, side="right") - 1
        else:
            row = np.full(metres.shape, other)
        column = np.searchsorted(LAGS_M, metres, side="right") - 1
        good = (row >= 0) & (column < shape[1]) & ((row < other) ^ (i is not j))
        cell = row[good] * shape[1] + column[good]
        for k, values in enumerate((None, seconds, metres, products)):
            sums[k] += np.bincount(cell, None if values is None else values[good], sums.shape[1])
    pairs = sums[0]
    seconds, metres, products = np.divide(sums[1:], pairs, out=np.full((3, len(pairs)), np.nan), where=pairs > 0)
    seconds, metres, products, pairs = (values.reshape(shape) for values in (seconds, metres, products, pairs))
    seconds[other] = inf
    return Autocovariance(seconds, metres, products, pairs.astype(int))


def fit_bias(cells: Autocovariance) -> dict:
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

    def misfit(point):
        return weight * (bias_covariance(lag_s, lag_m, *point) - covariance)

    scale = max(covariance.max(), LEAST_BIAS)
    bounds = (0, 0.1, 0, 0.3, -scale), (4 * scale, 20, 4 * scale, 60, scale)
    starts = [(scale / 2, length, scale / 2, time, 0) for length in (0.5, 1.5) for time in (3, 8)]
    best = min((least_squares(misfit, start, bounds=bounds) for start in starts), key=lambda found: found.cost)
    return dict(zip(("field_db2", "field_m", "drift_db2", "drift_s", "taken_db2"), best.x.tolist()))


def bias_covariance(lag_s, lag_m, field_db2, field_m, drift_db2, drift_s, taken_db2):
    """Covariance of the residuals of two packets of a receiver; see `fit_bias`.

    Args:
        lag_s, lag_m: (...,).

    Returns: (...,) dB^2.
    """
    return field_db2 * np.exp(-lag_m / field_m) + drift_db2 * np.exp(-lag_s / drift_s) - taken_db2


def fit_mixture(residual: np.ndarray, bias: float, white: float) -> dict:
    """The white part as two normal components with mean zero and variance `white` over both, by maximum likelihood.

        (1 - w) N(w g, s^2) + w N(-(1 - w) g, r s^2),   w (1 - w) g^2 = b white,   (1 - w + w r) s^2 = (1 - b) white

    for the fading's weight w, the share b of the variance that lies between the components, and the ratio r of
    variances. A residual is the sum of the white part and of field and drift, normal with variance `bias`, which is
    added to the variance of either component.
    """
    values, counts = np.unique(np.round(residual, 1), return_counts=True)

    def parts(point):
        share, between, ratio = point[0], point[1], np.exp(point[2])
        gap = np.sqrt(between * white / (share * (1 - share)))
        narrow = (1 - between) * white / (1 - share + share * ratio)
        return share, share * gap, narrow, -(1 - share) * gap, narrow * ratio

    def surprise(point):
        share, main, narrow, fade, wide = parts(point)
        density = (1 - share) * normal_density(values, main, narrow + bias)
        density += share * normal_density(values, fade, wide + bias)
        return -(counts @ np.log(np.maximum(density, TINY))) / counts.sum()

    bounds = [(0.02, 0.98), (0, 0.95), (-3, 3)]
    starts = (0.2, 0.5, 1), (0.4, 0.3, 0.5), (0.5, 0.1, 0.1)
    options = {"xatol": 1e-5, "fatol": 1e-11, "maxfev": 2000}
    found = (minimize(surprise, start, bounds=bounds, method="Nelder-Mead", options=options) for start in starts)
    share, main, narrow, fade, wide = parts(min(found, key=lambda result: result.fun).x)
    return {
        "main_db": main,
        "main_sd_db": np.sqrt(narrow),
        "fade_share": share,
        "fade_db": fade,
        "fade_sd_db": np.sqrt(wide),
    }


def measure_losses(tracks: Sequence[Track]) -> dict:
    """Which receivers missed an advertisement, and how far apart advertisements are.

    Packets less than 50 ms apart belong to one advertisement; one that is heard by less than a quarter of the receivers
    does not count. A loss follows a loss if the receiver missed the advertisement before it, in the same track.
    """
    found = [advertisements(track) for track in tracks]
    gaps = [np.diff(time) for time, _ in found]
    gap = np.concatenate(gaps)
    if len(gap) == 0:
        raise CalibrationError(f"tracks = {[track.name for track in tracks]}: no two advertisements in a row")
    interval = np.median(gap)
    lost = [~heard for _, heard in found]
    before, after = (
        np.concatenate([table[part][gap < NEXT * interval] for table, gap in zip(lost, gaps)])
        for part in (slice(None, -1), slice(1, None))
    )
    every = np.concatenate(lost)
    packets = sum(len(track.level_db) for track in tracks)
    return {
        "loss": every.mean(),
        "loss_after_loss": after[before].mean() if before.any() else 0.0,
        "interval_s": gap[gap < NEXT * interval].mean(),
        "advertisements": len(every),
        "advertisements_unheard": int(np.sum(np.round(gap / interval) - 1)),
        "packets_again": packets - int((~every).sum()),
        "loss_by_receiver": every.mean(axis=0),
        "loss_by_track": [table.mean() for table in lost],
    }


def advertisements(track: Track) -> tuple[np.ndarray, np.ndarray]:
    """When the beacon advertised, and which receivers heard it.

    Returns: times (A,) of the first packets, heard (A, S).
    """
    order = np.argsort(track.time_s, kind="stable")
    time, receiver = track.time_s[order], track.receiver[order]
    first = np.diff(time, prepend=-inf) > BURST_S
    heard = np.zeros((first.sum(), len(track.receivers.names)), bool)
    heard[np.cumsum(first) - 1, receiver] = True
    good = heard.mean(axis=1) >= FEWEST_HEARD
    return time[first][good], heard[good]


def _decades(packets: Packets) -> np.ndarray:
    """10 log10 of the distance."""
    return 10 * np.log10(packets.distance_m)


def normal_density(x, mean, variance):
    """Density of the normal distribution."""
    return np.exp(-0.5 * (x - mean) ** 2 / variance) / np.sqrt(2 * np.pi * variance)


def _pairs(packets: Packets):
    """Packets of a receiver on two tracks, or on one (then both are the same array), every pair of tracks once."""
    tracks = range(packets.track.max() + 1)
    for receiver in range(packets.receiver.max() + 1):
        heard = packets.receiver == receiver
        own = [np.flatnonzero(heard & (packets.track == track)) for track in tracks]
        for second in tracks:
            for first in tracks[: second + 1]:
                yield own[first], own[second]


def _plain(value):
    """Numbers and lists of them, as JSON has them; rounded, so that files of the same data are the same."""
    if isinstance(value, dict):
        return {name: _plain(item) for name, item in value.items()}
    if isinstance(value, list | np.ndarray):
        return [_plain(item) for item in value]
    if isinstance(value, str):
        return value
    return int(value) if isinstance(value, int | np.integer) else round(float(value), DECIMALS) + 0.0


def _shared_receivers(tracks: Sequence[Track]):
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


def _check(content) -> None:
    """Raise unless a file's content is a calibration."""
    if not isinstance(content, dict) or content.get("kind") != KIND:
        kind = content.get("kind") if isinstance(content, dict) else content
        raise CalibrationError(f"kind = {kind!r}: must be {KIND!r}")
    if content.get("version") != VERSION:
        raise CalibrationError(f"version = {content.get('version')!r}: must be {VERSION}")
    texts = content.get("tracks")
    if not isinstance(texts, list) or not texts or not all(isinstance(text, str) for text in texts):
        raise CalibrationError(f"tracks = {texts!r}: must be a list of names")
    left_out = content.get("left_out", 0)
    if not (left_out is None or isinstance(left_out, str)) or left_out in texts:
        raise CalibrationError(f"left_out = {left_out!r}: must be null, or the name of a track that is not in tracks")
    for name in ("quantities", "found", "versions"):
        if not isinstance(content.get(name), dict):
            raise CalibrationError(f"{name} = {content.get(name)!r}: must be an object")
    _check_quantities(content["quantities"])


def _check_quantities(quantities: dict) -> None:
    for name in quantities:
        if name not in QUANTITIES:
            raise CalibrationError(f"quantities.{name} = {quantities[name]!r}: unknown; {suggest(name, QUANTITIES)}")
    for name in QUANTITIES:
        if name not in quantities:
            raise CalibrationError(f"quantities.{name}: is missing ({QUANTITIES[name][0]})")
    for name, (_, allowed) in NUMBERS.items():
        check_quantity("quantities", name, quantities[name], **allowed)
    positions = quantities["positions"]
    count = len(positions) if isinstance(positions, list) else 0
    for name, (meaning, allowed) in LISTS.items():
        values = quantities[name]
        if not isinstance(values, list) or not values or len(values) != count:
            raise CalibrationError(
                f"quantities.{name} = {values!r}: must be a list, one for every receiver ({meaning})"
            )
        for i, value in enumerate(values):
            if name == "positions" and not (isinstance(value, list) and len(value) == 2):
                raise CalibrationError(f"quantities.positions[{i}] = {value!r}: must be a pair, x and y")
            for number in value if name == "positions" else [value]:
                check_quantity("quantities", f"{name}[{i}]", number, **allowed)
