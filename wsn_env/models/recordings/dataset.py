"""The public dataset of positioned Bluetooth packets: a folder of tracks, and the receivers that heard them.

Danis, Naskali, Cemgil & Ersoy, "An indoor localization dataset and data collection framework with high precision
position annotation", Pervasive and Mobile Computing 81, 2022. A folder holds

    tetam.dev    Dongles:{"receiver": [[x, y, z], colour, "label"], ...}
                 Beacons:{"beacon": [...], ...}
    tetam.par    {"limits": [0, 0, width, depth], ...}; it may be absent
    *.mbd        a packet a line: timestamp [s], receiver, beacon, level [dBm], x, y, z [m], orientation (3 x 3)

Recordings have faults. A line that cannot be used is left out and counted by its reason; a file that cannot be used
raises `DatasetError`.
"""

from __future__ import annotations

import codecs
import json
import math
import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wsn_env.models.quantity import check_quantity

DEVICES, PARAMETERS = "tetam.dev", "tetam.par"
ENDINGS = ("_all_sensors.mbd", ".mbd")  # of a track's file, left out of its name
FIELDS = 16  # in a line
LEVELS_DB = (-120.0, -20.0)  # a level lies between them
OUTSIDE_M = 1.0  # the target cannot be farther outside the room
HEIGHT_M = 5.0  # nor farther above or below the receivers
FARTHEST_M = 10_000.0  # receivers from the origin
ASTRAY_S = 60.0  # a longer silence parts a track; its longest part is kept
GAP_S = 1.0  # a longer silence is counted as a gap: two advertisements that nobody heard
REPEAT_S = 0.5e-3  # a packet is on air for .4 ms: a receiver cannot hear two within less
SHORTEST_S = 1.0  # of a track
FINEST_S = 0.01  # of the periods that a track is cut into

BLANK, MALFORMED = "blank", "malformed"
RECEIVER, BEACON = "unknown receiver", "another beacon"
LEVEL, POSITION = "impossible level", "impossible position"
ASTRAY, REPEATED = "astray time", "repeated packet"
REASONS = (BLANK, MALFORMED, RECEIVER, BEACON, LEVEL, POSITION, ASTRAY, REPEATED)

SECTION = re.compile(r"\s*(\w+)\s*:(.*)", flags=re.DOTALL)


class DatasetError(ValueError):
    """A file cannot be used; the message names it, the line and what is wrong there."""


@dataclass(frozen=True, eq=False)
class Receivers:
    """What listens.

    Attributes:
        names: their ids, in the file's order.
        positions_m: (S, 3).
        limits_m: width and depth of the room, whose corner is the origin.
        beacons: ids of what is tracked; () if nobody knows.
    """

    names: tuple[str, ...]
    positions_m: np.ndarray
    limits_m: tuple[float, float]
    beacons: tuple[str, ...] = ()


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


# --- the folder ---------------------------------------------------------------------------------------------


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
        DatasetError: there is none, or no such folder.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise DatasetError(f"{folder}: is no folder; it must hold {DEVICES} and *.mbd files")
    files = sorted(path for path in folder.glob("*.mbd") if path.is_file() and not path.name.startswith("."))
    if not files:
        raise DatasetError(f"{folder}: holds no *.mbd file")
    return files


def read_receivers(folder: str | Path) -> Receivers:
    """The receivers of a folder, and its room.

    The room is as large as tetam.par says; without it, or if it makes no sense (it must begin at the origin and hold
    the receivers), it reaches from the origin to the farthest receivers.

    Raises:
        DatasetError: names the file, the line and what is wrong.
    """
    path = Path(folder) / DEVICES
    sections = _sections(path)
    if "Dongles" not in sections:
        raise DatasetError(f"{path}: has no line Dongles:{{...}}, which names the receivers")
    number, text = sections["Dongles"]
    dongles = _table(path, number, text)
    if not dongles:
        raise DatasetError(f"{path}, line {number}: Dongles holds no receiver")
    positions = np.empty((len(dongles), 3))
    for place, (name, entry) in enumerate(dongles.items()):
        position = entry[0] if isinstance(entry, list) and entry else entry
        if not _are_numbers(position, 3) or max(map(abs, position)) > FARTHEST_M:
            raise DatasetError(
                f"{path}, line {number}: receiver {name!r} is at {position!r:.60}: must be [x, y, z] in m, within"
                f" {FARTHEST_M:g} m"
            )
        positions[place] = position
    limits = _limits(Path(folder) / PARAMETERS, positions)
    if limits is None:
        limits = tuple(positions[:, :2].max(axis=0).tolist())
        if min(limits) <= 0:
            raise DatasetError(
                f"{path}, line {number}: from the origin to the receivers there is no room: {PARAMETERS} must give"
                ' its "limits": [0, 0, width, depth]'
            )
    beacons = _table(path, *sections["Beacons"]) if "Beacons" in sections else ()
    positions.setflags(write=False)
    return Receivers(tuple(dongles), positions, limits, tuple(beacons))


def _sections(path: Path) -> dict[str, tuple[int, str]]:
    """Line and text of every NAME:{...}, which may go on in further lines."""
    texts: dict[str, tuple[int, list[str]]] = {}
    name = None
    for number, raw in enumerate(_read(path).splitlines(), 1):
        line = raw.decode(errors="replace")
        if found := SECTION.fullmatch(line):
            name, rest = found.groups()
            if name in texts:
                raise DatasetError(f"{path}, line {number}: {name} is there twice, first in line {texts[name][0]}")
            texts[name] = number, [rest]
        elif name is not None:
            texts[name][1].append(line)
        elif line.strip():
            raise DatasetError(f'{path}, line {number}: must be Dongles:{{"receiver": [[x, y, z], ...], ...}}')
    return {name: (number, "\n".join(lines)) for name, (number, lines) in texts.items()}


def _table(path: Path, number: int, text: str) -> dict:
    """A JSON table that begins in this line."""
    try:
        table = json.loads(text, object_pairs_hook=_distinct)
        if not isinstance(table, dict):
            raise ValueError("must be a table {...}")
    except json.JSONDecodeError as problem:
        line = number + problem.lineno - 1
        raise DatasetError(f"{path}, line {line}: {problem.msg} (character {problem.colno} of the table)") from None
    except (ValueError, RecursionError) as problem:
        raise DatasetError(f"{path}, line {number}: {problem}") from None
    return table


def _distinct(pairs: list[tuple[str, object]]) -> dict:
    table = dict(pairs)
    if len(table) < len(pairs):
        twice = next(name for name, times in Counter(name for name, _ in pairs).items() if times > 1)
        raise ValueError(f"{twice!r} is there twice")
    return table


def _limits(path: Path, positions: np.ndarray) -> tuple[float, float] | None:
    """Width and depth of the room, if the file gives some that can be right."""
    try:
        limits = json.loads(path.read_bytes())["limits"]
    except (OSError, ValueError, TypeError, LookupError, RecursionError):
        return None
    if not _are_numbers(limits, 4) or limits[0] != 0 or limits[1] != 0:
        return None
    far = np.array(limits[2:], float)
    fits = (far > 0).all() and (far <= FARTHEST_M).all() and (positions[:, :2] <= far + OUTSIDE_M).all()
    return tuple(far.tolist()) if fits else None


def _are_numbers(values, count: int) -> bool:
    """A list of so many numbers, all finite and none too large for a float."""
    return (
        isinstance(values, list)
        and len(values) == count
        and all(isinstance(value, int | float) and not isinstance(value, bool) for value in values)
        and all(abs(value) < 1e300 for value in values)
    )


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes().removeprefix(codecs.BOM_UTF8)
    except (OSError, ValueError) as problem:
        raise DatasetError(f"{path}: cannot be read: {getattr(problem, 'strerror', None) or problem}") from None


# --- a track ------------------------------------------------------------------------------------------------


def read_track(path: str | Path, receivers: Receivers | None = None) -> Track:
    """A track, in the order of time, without the lines that cannot be used.

    The beacon is one that the receivers' file names, the most frequent of them; if it names none, the most frequent of
    the track. What lines stay does not depend on their order.

    Args:
        receivers: those of its folder unless given.

    Raises:
        DatasetError: names the file, the line and what is wrong; no line can be used, or less than `SHORTEST_S`.
    """
    path = Path(path)
    lines = _read(path).splitlines()
    receivers = read_receivers(path.parent) if receivers is None else receivers
    packets, places, faults = _packets(lines, receivers)
    counts = {"lines": len(lines), "kept": len(packets)} | dict.fromkeys(REASONS, 0)
    for _, reason, _ in faults:
        counts[reason] += 1
    first = "".join(f"; line {number}: {reason}: {why}" for number, reason, why in faults[:1])
    if not len(packets):
        raise DatasetError(f"{path}: none of its {len(lines)} lines is a packet that can be used{first}")

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
    return Track(track_name(path), path, receivers, *arrays, counts, int(earlier.sum()))


def track_name(path: Path) -> str:
    """What a track's file is called, without its endings."""
    ending = next((ending for ending in ENDINGS if path.name.endswith(ending)), "")
    return path.name.removesuffix(ending)


def _packets(lines: list[bytes], receivers: Receivers) -> tuple[np.ndarray, np.ndarray, list[tuple[int, str, str]]]:
    """Lines, each by itself.

    Returns: (N, 5) time, level, x, y, z; (N,) receivers' places; (line number, reason, why) of the others, by number.
    """
    known = {name.encode(errors="replace"): place for place, name in enumerate(receivers.names)}
    packets, faults = [], []
    for number, line in enumerate(lines, 1):
        try:
            time, receiver, beacon, level, x, y, z = _parse(line)
        except ValueError as problem:
            blank = not line.strip()
            faults.append((number, BLANK if blank else MALFORMED, "holds nothing" if blank else str(problem)))
            continue
        if receiver in known:
            packets.append((number, beacon, known[receiver], time, level, x, y, z))
        else:
            faults.append((number, RECEIVER, f"{_shown(receiver)} is not in {DEVICES}"))

    beacon = _tracked([packet[1] for packet in packets], receivers)
    width, depth = receivers.limits_m
    low, high = receivers.positions_m[:, 2].min() - HEIGHT_M, receivers.positions_m[:, 2].max() + HEIGHT_M
    good = []
    for packet in packets:
        number, own, _, _, level, x, y, z = packet
        if own != beacon:
            named = f"those of {DEVICES}: {', '.join(receivers.beacons)}" if receivers.beacons else _shown(beacon)
            faults.append((number, BEACON, f"{_shown(own)}, not {named}"))
        elif not LEVELS_DB[0] < level < LEVELS_DB[1]:
            faults.append((number, LEVEL, f"{level:g} dBm is not between {LEVELS_DB[0]:g} and {LEVELS_DB[1]:g}"))
        elif not (-OUTSIDE_M <= x <= width + OUTSIDE_M and -OUTSIDE_M <= y <= depth + OUTSIDE_M and low <= z <= high):
            room = f"the room of {width:g} x {depth:g} m, or {HEIGHT_M:g} m above or below the receivers"
            faults.append((number, POSITION, f"({x:g}, {y:g}, {z:g}) m is outside {room}"))
        else:
            good.append(packet[2:])
    faults.sort()
    table = np.array(good, float).reshape(-1, 6)
    return table[:, 1:], table[:, 0].astype(np.int64), faults


def _parse(line: bytes) -> tuple[float, bytes, bytes, float, float, float, float]:
    """Time, receiver, beacon, level, x, y, z of a line.

    Raises:
        ValueError: what is wrong with it.
    """
    fields = line.split(b",")
    if len(fields) != FIELDS:
        raise ValueError(f"{len(fields)} fields instead of {FIELDS}")
    try:
        time, level, *rest = map(float, (fields[0], *fields[3:]))
    except ValueError:
        wrong = next(field for field in (fields[0], *fields[3:]) if not _is_number(field))
        raise ValueError(f"{_shown(wrong)} is not a number") from None
    if not math.isfinite(time + level + sum(rest)):
        raise ValueError("its numbers are not all finite")
    if b"_" in line and any(b"_" in field for field in (fields[0], *fields[3:])):
        raise ValueError("an underscore in a number")
    x, y, z = rest[:3]
    return time, fields[1].strip(), fields[2].strip(), level, x, y, z


def _is_number(field: bytes) -> bool:
    try:
        float(field)
    except ValueError:
        return False
    return True


def _shown(field: bytes) -> str:
    """In a message: on one line, not too long."""
    return repr(field[:40].decode(errors="replace"))


def _tracked(beacons: list[bytes], receivers: Receivers) -> bytes:
    """The most frequent of those that may be tracked; b"" if there is none."""
    named = {name.encode(errors="replace") for name in receivers.beacons}
    times = Counter(beacon for beacon in beacons if not named or beacon in named)
    return min(times, key=lambda beacon: (-times[beacon], beacon), default=b"")


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
