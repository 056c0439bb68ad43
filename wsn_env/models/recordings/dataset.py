"""The public dataset of positioned Bluetooth packets: a folder of tracks, and the receivers that heard them.

Danis, Naskali, Cemgil & Ersoy, "An indoor localization dataset and data collection framework with high precision
position annotation", Pervasive and Mobile Computing 81, 2022. A folder holds

    tetam.dev    Dongles:{"receiver": [[x, y, z], colour, "label"], ...}
                 Beacons:{"beacon": [...], ...}
    tetam.par    {"limits": [0, 0, width, depth], ...}; it may be absent
    *.mbd        a packet a line: timestamp [s], receiver, beacon, level [dBm], x, y, z [m], orientation (3 x 3)

Recordings have faults. A line that cannot be used is left out and counted by its reason; more than a tenth of them is a
`DatasetWarning`. A file that cannot be used, or whose times are not in seconds, raises `DatasetError`.
"""

from __future__ import annotations

import warnings
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wsn_env.models.arguments import checked
from wsn_env.models.quantity import check_quantity
from wsn_env.models.recordings.files import DatasetError, DatasetWarning, read_file
from wsn_env.models.recordings.lines import FAULTS, read_packets
from wsn_env.models.recordings.receivers import DEVICES, Receivers, read_receivers

ENDINGS = ("_all_sensors.mbd", ".mbd")  # of a track's file, left out of its name
ASTRAY_S = 60.0  # a longer silence parts a track; its longest part is kept
GAP_S = 1.0  # a longer silence is counted as a gap: two advertisements that nobody heard
REPEAT_S = 0.5e-3  # a packet is on air for .4 ms: a receiver cannot hear two within less
SHORTEST_S = 1.0  # of a track
SPACING_S = 0.02, 20.0  # of a receiver's packets, pauses aside: a beacon advertises every 20 ms to 10.24 s
FEWEST_GAPS = 10  # that show that they are too near
UNITS_S = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "days": 86400.0}
TOLD_SHARE = 0.1  # of a file: more than that is not left out without a word
FINEST_S = 0.01  # of the periods that a track is cut into

ASTRAY, REPEATED = "astray time", "repeated packet"
REASONS = (*FAULTS, ASTRAY, REPEATED)


@dataclass(frozen=True, eq=False)
class Track:
    """The packets of a recording in the order of time.

    Attributes:
        name: the file's, without its ending.
        path: the file.
        receivers: those of its folder.
        time_s: (N,) since the first packet.
        receiver: (N,) place in `receivers`.
        level_db: (N,) dBm.
        position_m: (N, 3) of the beacon.
        counts: "lines", "kept", and lines left out by reason (`REASONS`), which are the difference.
        out_of_order: lines of an earlier time than one above them; they are put in their place.
    """

    name: str
    path: Path
    receivers: Receivers
    time_s: np.ndarray
    receiver: np.ndarray
    level_db: np.ndarray
    position_m: np.ndarray
    counts: dict[str, int]
    out_of_order: int = 0

    @property
    def gaps(self) -> int:
        """Silences of all receivers that are longer than `GAP_S`."""
        return int((np.diff(self.time_s) > GAP_S).sum())

    @property
    def longest_gap_s(self) -> float:
        """The longest silence of all receivers."""
        return float(np.diff(self.time_s).max(initial=0.0))

    @property
    def note(self) -> str | None:
        """What must be said of a file of which more than a tenth is left out."""
        lines, kept = (self.counts.get(name, 0) for name in ("lines", "kept"))
        if lines - kept <= TOLD_SHARE * lines:
            return None
        reasons = Counter({reason: self.counts[reason] for reason in REASONS}).most_common()
        left_out = ", ".join(f"{count} {reason}" for reason, count in reasons if count)
        whole = "; times are in whole seconds, within which a receiver's packets count as one"
        rounded = self.counts[REPEATED] and not (self.time_s % 1).any()
        return f"{self.path}: {kept} of {lines} lines are used; left out: {left_out}{whole if rounded else ''}"

    def per_period(self, period_s: float = 1.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What was heard in each of the K whole periods; period k holds the packets of [k T, (k + 1) T).

        A position is the mean of the packets' x, y; without a packet, it is on the line between its neighbours.

        Returns: mean level or 0 (K, S) dBm, number of packets (K, S), position (K, 2) m.

        Raises:
            DatasetError: the track is shorter than a period.
            ScenarioError: not a length of periods.
        """
        check_quantity("Track.per_period", "period_s", period_s, at_least=FINEST_S)
        period = (self.time_s / period_s).astype(np.int64)
        periods, count = int(period[-1]), len(self.receivers.names)
        if periods == 0:
            raise DatasetError(f"{self.path}: lasts {self.time_s[-1]:.3g} s: no whole period of {period_s:g} s")
        everything = periods + 1  # with the part of a period at the end, whose position helps those without a packet
        cell = period * count + self.receiver
        heard = np.bincount(cell, minlength=everything * count).reshape(everything, count)
        levels = np.bincount(cell, self.level_db, everything * count).reshape(everything, count) / np.maximum(heard, 1)
        packets = heard.sum(axis=1)
        filled = np.flatnonzero(packets)
        positions = np.empty((everything, 2))
        for axis in (0, 1):
            mean = np.bincount(period, self.position_m[:, axis], everything)[filled] / packets[filled]
            positions[:, axis] = np.interp(np.arange(everything), filled, mean)
        return levels[:periods], heard[:periods], positions[:periods]


@checked
def read_dataset(folder: str | Path) -> list[Track]:
    """All tracks of a folder, in the order of their files' names.

    Raises:
        DatasetError: names the file, the line and what is wrong.
    """
    files = track_files(folder)
    receivers = read_receivers(folder)
    return [read_track(path, receivers) for path in files]


def track_files(folder: str | Path) -> list[Path]:
    """Its *.mbd files, sorted by name.

    Raises:
        DatasetError: there is none, no such folder, or two are called alike.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise DatasetError(f"{folder}: is no folder; it must hold {DEVICES} and *.mbd files")
    files = sorted(path for path in folder.glob("*.mbd") if path.is_file() and not path.name.startswith("."))
    if not files:
        raise DatasetError(f"{folder}: holds no *.mbd file")
    for name, times in Counter(map(track_name, files)).items():
        if times > 1:
            twice = ", ".join(path.name for path in files if track_name(path) == name)
            raise DatasetError(f"{folder}: {twice}: are {times} files of one track's name, {name}")
    return files


@checked
def read_track(path: str | Path, receivers: Receivers | None = None) -> Track:
    """A track, in the order of time, without the lines that cannot be used.

    The beacon is one that the receivers' file names, the most frequent of them; if it names none, the most frequent of
    the track. What lines stay does not depend on their order.

    Args:
        receivers: those of its folder unless given.

    Raises:
        DatasetError: names the file, the line and what is wrong; no line can be used, less than `SHORTEST_S`, or times
            that are not in seconds.
    """
    path = Path(path)
    lines = read_file(path).splitlines()
    receivers = read_receivers(path.parent) if receivers is None else receivers
    packets, places, faults = read_packets(lines, receivers)
    counts = {"lines": len(lines), "kept": len(packets)} | dict.fromkeys(REASONS, 0)
    for _, reason, _ in faults:
        counts[reason] += 1
    first = "".join(f"; line {number}: {reason}: {why}" for number, reason, why in faults[:1])
    if not len(packets):
        raise DatasetError(f"{path}: none of its {len(lines)} lines is a packet that can be used{first}")

    _check_unit(path, packets[:, 0], places)
    kept = _longest_run(packets[:, 0])
    counts[ASTRAY] = int((~kept).sum())
    packets, places = packets[kept], places[kept]
    earlier = packets[:, 0] < np.maximum.accumulate(packets[:, 0])

    packets, places = _without_repeats(packets, places)
    counts[REPEATED] = int(kept.sum()) - len(packets)

    order = np.argsort(packets[:, 0], kind="stable")
    packets, places = packets[order], places[order]
    counts["kept"] = len(packets)
    time = packets[:, 0] - packets[0, 0]
    if time[-1] < SHORTEST_S:
        raise DatasetError(
            f"{path}: its {len(time)} usable packets of {len(lines)} lines last {time[-1]:.3g} s: must be at least"
            f" {SHORTEST_S:g} s{first}"
        )
    arrays = time, places, packets[:, 1].copy(), packets[:, 2:].copy()
    for array in arrays:
        array.setflags(write=False)
    track = Track(track_name(path), path, receivers, *arrays, counts, int(earlier.sum()))
    if track.note:
        warnings.warn(track.note, DatasetWarning, stacklevel=1)  # from here: said once, whoever reads it again
    return track


def track_name(path: Path) -> str:
    """What a track's file is called, without its endings."""
    ending = next((ending for ending in ENDINGS if path.name.endswith(ending)), "")
    return path.name.removesuffix(ending)


def _check_unit(path: Path, time: np.ndarray, places: np.ndarray) -> None:
    """Raise DatasetError unless times (N,) are spaced as packets are, at the receivers (N,), in seconds.

    A receiver's packets are a few advertising intervals apart, but for pauses, which are the longest tenth at most. A
    few that are too near may be one packet on several channels.
    """
    order = np.lexsort((time, places))
    with np.errstate(over="ignore"):
        gaps = np.sort(np.diff(time[order])[np.diff(places[order]) == 0])
        usual = gaps[: len(gaps) - -(-len(gaps) // 10)]
        spacing = usual.mean() if len(usual) else 0.0
    low, high = SPACING_S
    if low <= spacing <= high or spacing == 0 or (spacing < low and len(usual) < FEWEST_GAPS):
        return
    like = [f", and look like {unit}" for unit, seconds in UNITS_S.items() if low <= spacing * seconds <= high]
    raise DatasetError(
        f"{path}: times must be in seconds{''.join(like[:1])}: a receiver's packets would be {spacing:.3g} s apart"
    )


def _longest_run(time: np.ndarray) -> np.ndarray:
    """Where the times (N,) belong to the run of most packets without a silence of more than `ASTRAY_S`."""
    order = np.argsort(time, kind="stable")
    with np.errstate(over="ignore"):
        run = np.cumsum(np.diff(time[order], prepend=time[order[0]]) > ASTRAY_S)
    kept = np.empty(len(time), bool)
    kept[order] = run == np.bincount(run).argmax()
    return kept


def _without_repeats(packets: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The packets (N, 5) and receivers' places (N,) by receiver and time, those within `REPEAT_S` left out."""
    time = packets[:, 0]
    order = np.lexsort((*packets.T[:0:-1], time, places))  # at the same time, by what they may differ in
    packets, places = packets[order], places[order]
    fresh = np.ones(len(packets), bool)
    fresh[1:] = (np.diff(packets[:, 0]) > REPEAT_S) | (np.diff(places) != 0)
    return packets[fresh], places[fresh]
