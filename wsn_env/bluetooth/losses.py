"""Lost packets: which receivers missed an advertisement, and whether losses follow each other."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np

from wsn_env.models.recordings.calibration_file import CalibrationError

if TYPE_CHECKING:
    from wsn_env.models.recordings.dataset import Track

BURST_S = 0.05  # packets of one advertisement lie closer together
FEWEST_HEARD = 0.25  # of the receivers, or it is no advertisement
NEXT = 1.5  # intervals at most between two advertisements of which none is missing


def measure_losses(tracks: Sequence[Track]) -> dict[str, Any]:
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
