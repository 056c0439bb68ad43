"""The lines of a recorded track: packets that can be used, and what is wrong with the others."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np

from wsn_env.models.recordings.files import parse_number, shown
from wsn_env.models.recordings.receivers import DEVICES, Receivers, in_room

FIELDS = 16  # in a line
LEVELS_DB = (-120.0, -20.0)  # a level lies between them
HEIGHT_M = 5.0  # the target cannot be farther above or below the receivers

BLANK, MALFORMED = "blank", "malformed"
UNKNOWN, OTHER = "unknown receiver", "another beacon"
LEVEL, POSITION = "impossible level", "impossible position"
FAULTS = (BLANK, MALFORMED, UNKNOWN, OTHER, LEVEL, POSITION)


def read_packets(lines: list[bytes], receivers: Receivers) -> tuple[np.ndarray, np.ndarray, list[tuple[int, str, str]]]:
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
            faults.append((number, UNKNOWN, f"{_shown(receiver)} is not in {DEVICES}"))

    beacon = _tracked([packet[1] for packet in packets], receivers)
    width, depth = receivers.limits_m
    low, high = receivers.positions_m[:, 2].min() - HEIGHT_M, receivers.positions_m[:, 2].max() + HEIGHT_M
    good = []
    for packet in packets:
        number, own, _, _, level, x, y, z = packet
        if own != beacon:
            named = f"those of {DEVICES}: {', '.join(receivers.beacons)}" if receivers.beacons else _shown(beacon)
            faults.append((number, OTHER, f"{_shown(own)}, not {named}"))
        elif not LEVELS_DB[0] < level < LEVELS_DB[1]:
            faults.append((number, LEVEL, f"{level:g} dBm is not between {LEVELS_DB[0]:g} and {LEVELS_DB[1]:g}"))
        elif not (in_room(x, y, receivers.limits_m) and low <= z <= high):
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
        raise ValueError(f"{len(fields)} fields instead of {FIELDS} with commas between them")
    try:
        time, level, *rest = map(float, (fields[0], *fields[3:]))
        if b"_" in line:
            raise ValueError
    except ValueError:
        time, level, *rest = (parse_number(field.decode(errors="replace")) for field in (fields[0], *fields[3:]))
    if not math.isfinite(time + level + sum(rest)):
        raise ValueError("its numbers are not all finite")
    x, y, z = rest[:3]
    return time, fields[1].strip(), fields[2].strip(), level, x, y, z


def _shown(field: bytes) -> str:
    return shown(field.decode(errors="replace"))


def _tracked(beacons: list[bytes], receivers: Receivers) -> bytes:
    """The most frequent of those that may be tracked; b"" if there is none."""
    named = {name.encode(errors="replace") for name in receivers.beacons}
    times = Counter(beacon for beacon in beacons if not named or beacon in named)
    return min(times, key=lambda beacon: (-times[beacon], beacon), default=b"")
