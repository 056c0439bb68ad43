"""The packets of several tracks in one table, and their residuals against a calibration."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from wsn_env.bluetooth.calibration import Calibration

if TYPE_CHECKING:
    from wsn_env.models.recordings.dataset import Track

NEAREST_M = 0.1  # closer distances count as this one
LOCAL_S = 1.5  # packets this far apart count 1/e in a local mean
FARTHEST_S = 40.0  # apart on a track are packets that still have something to do with each other
MOST_AT_ONCE = 2000  # packets of a receiver on a track; pairs of more are taken in blocks, a matrix at a time


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

    @property
    def distance_db(self) -> np.ndarray:
        """(N,) 10 log10 of the distance."""
        return 10 * np.log10(self.distance_m)


def concatenate_tracks(tracks: Iterable[Track]) -> Packets:
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
    return packets.level_db - at_1m[packets.receiver] + exponents[packets.receiver] * packets.distance_db


def receiver_pairs(packets: Packets) -> Iterator[tuple[np.ndarray, np.ndarray, bool]]:
    """Packets of a receiver on two tracks or on one, every pair of tracks once, and whether it is one.

    Of a track with more than `MOST_AT_ONCE` packets, pairs with another track are of as many, evenly chosen.
    """
    tracks = range(packets.track.max() + 1)
    for receiver in range(packets.receiver.max() + 1):
        heard = packets.receiver == receiver
        own = [np.flatnonzero(heard & (packets.track == track)) for track in tracks]
        some = [one[:: -(-len(one) // MOST_AT_ONCE) or 1] for one in own]
        for second in tracks:
            for first in tracks[:second]:
                yield some[first], some[second], False
            for rows, near in blocks_in_time(own[second], packets.time_s):
                yield rows, near, True


def blocks_in_time(own: np.ndarray, time_s: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Parts of a track's packets, in the order of time, and those at most `FARTHEST_S` before or after any of them."""
    if len(own) <= MOST_AT_ONCE:
        yield own, own
        return
    time = time_s[own]
    for start in range(0, len(own), MOST_AT_ONCE):
        rows = own[start : start + MOST_AT_ONCE]
        low, high = time_s[rows[0]] - FARTHEST_S, time_s[rows[-1]] + FARTHEST_S
        yield rows, own[np.searchsorted(time, low) : np.searchsorted(time, high, side="right")]


@dataclass(frozen=True)
class HeldOut:
    """Residuals against the calibration that did not see the track, or against the whole one if there is none.

    Args:
        packets: of all tracks.
        residual_db: (N,).
    """

    packets: Packets
    residual_db: np.ndarray


def held_out_residuals(tracks: Sequence[Track], whole: Calibration, parts: Iterable[Calibration]) -> HeldOut:
    """Residuals of every track against the calibration without it."""
    packets = concatenate_tracks(tracks)
    residual = residuals(packets, whole)
    names: list[str | None] = [track.name for track in tracks]
    for part in parts:
        chosen = packets.track == names.index(part.left_out)
        residual[chosen] = residuals(packets, part)[chosen]
    return HeldOut(packets, residual)


def local_deviation(packets: Packets, residual: np.ndarray) -> np.ndarray:
    """Residuals minus the mean of their receiver's others near in time, weights exp(-lag / 1.5 s).

    Returns: (N,) dB; NaN where a receiver has no other packet on the track.
    """
    deviation = np.full(len(residual), np.nan)
    for receiver in range(packets.receiver.max() + 1):
        for track in range(packets.track.max() + 1):
            own = np.flatnonzero((packets.receiver == receiver) & (packets.track == track))
            if len(own) < 2:
                continue
            for rows, near in blocks_in_time(own, packets.time_s):
                weight = np.exp(-np.abs(packets.time_s[rows, None] - packets.time_s[near]) / LOCAL_S)
                weight[rows[:, None] == near] = 0
                total = weight.sum(axis=1)
                mean = np.divide(weight @ residual[near], total, out=np.full(len(rows), np.nan), where=total > 0)
                deviation[rows] = residual[rows] - mean
    return deviation
