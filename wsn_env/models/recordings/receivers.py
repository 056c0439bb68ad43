"""What listened to recorded tracks, and in which room: the folder's tetam.dev and tetam.par (see `dataset`)."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wsn_env.models.recordings.files import DatasetError, parse_json, read_file

DEVICES, PARAMETERS = "tetam.dev", "tetam.par"
OUTSIDE_M = 1.0  # the target cannot be farther outside the room, see `in_room`
FARTHEST_M = 10_000.0  # receivers from the origin

SECTION = re.compile(r"\s*(\w+)\s*:(.*)", flags=re.DOTALL)


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


def in_room(x: Any, y: Any, room_m: tuple[float, float]) -> Any:
    """Whether places (...) lie in a room, or so little outside that whoever measured them may have been there."""
    wide, deep = room_m
    return (x >= -OUTSIDE_M) & (x <= wide + OUTSIDE_M) & (y >= -OUTSIDE_M) & (y <= deep + OUTSIDE_M)


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
    for number, raw in enumerate(read_file(path).splitlines(), 1):
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
        table = parse_json(text)
        if not isinstance(table, dict):
            raise ValueError("must be a table {...}")
    except json.JSONDecodeError as problem:
        line = number + problem.lineno - 1
        raise DatasetError(f"{path}, line {line}: {problem.msg} (character {problem.colno} of the table)") from None
    except ValueError as problem:
        raise DatasetError(f"{path}, line {number}: {problem}") from None
    return table


def _limits(path: Path, positions: np.ndarray) -> tuple[float, float] | None:
    """Width and depth of the room, if the file gives some that can be right; it grows to hold its receivers."""
    try:
        limits = parse_json(read_file(path))["limits"]
    except (ValueError, TypeError, LookupError):
        return None
    if not _are_numbers(limits, 4) or limits[0] != 0 or limits[1] != 0:
        return None
    far = np.array(limits[2:], float)
    fits = (far > 0).all() and (far <= FARTHEST_M).all() and (positions[:, :2] <= far + OUTSIDE_M).all()
    return tuple(np.maximum(far, positions[:, :2].max(axis=0)).tolist()) if fits else None


def _are_numbers(values, count: int) -> bool:
    """A list of so many numbers, all finite and none too large for a float."""
    return (
        isinstance(values, list)
        and len(values) == count
        and all(isinstance(value, int | float) and not isinstance(value, bool) for value in values)
        and all(abs(value) < 1e300 for value in values)
    )
