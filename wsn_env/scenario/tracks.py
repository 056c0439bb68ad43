"""Targets' tracks as a scenario draws them, and where they are to be expected."""

from __future__ import annotations

import numpy as np

from wsn_env.compiled import draws
from wsn_env.compiled.kernels import kernel, over_rows
from wsn_env.models.fault.base import change_track
from wsn_env.models.kinds import made_constants
from wsn_env.models.motion.base import Course, draw, reflect
from wsn_env.scenario.scenario import Scenario

CELLS = 24  # of the map of presence, along a side
STATES = 400_000  # true states that the map is made of
LONGEST = 20_000  # periods of a track that it looks at
LEAST = 0.05  # presence, of the mean: an estimate may be where no target comes


class Tracks:
    """Draws the target's track of an episode."""

    def __init__(self, scenario: Scenario) -> None:
        motion = scenario.motion
        motion.check(scenario)
        self._motion = made_constants(motion, scenario)
        faults = enumerate(scenario.faults)
        self._changes = [(made_constants(fault, scenario), number) for number, fault in faults if fault.changes_tracks]
        side_m, depth_m = scenario.field.room_m
        bounded = motion.bounded and not scenario.ends_outside
        self._course = scenario.period_s, side_m, depth_m, motion.recorded_tracks(scenario), bounded

    def draw(self, rows: np.ndarray, keys: np.ndarray, tracks: np.ndarray, threads: int) -> None:
        """Fill tracks (B, periods + 1, 4) in the rows marked."""
        over_rows(_draw_tracks, len(rows), threads, self._motion, self._course, rows, keys, tracks)
        for made, number in self._changes:
            over_rows(_change_tracks, len(rows), threads, made, number, rows, keys, tracks)


@kernel
def _draw_tracks(start, stop, cs, course, rows, keys, tracks):
    """Fill tracks in the rows marked.

    Args:
        course: the fields of a Course.
    """
    period_s, side_m, depth_m, recorded, bounded = course
    for b in range(start, stop):
        if rows[b]:
            track = tracks[b]
            stream = draws.stream(keys[b], 0, draws.TRACK)
            draw(cs[0], stream, Course(period_s, side_m, depth_m, recorded, bounded), track)
            if bounded:
                for state in track:
                    reflect(state, 0, side_m)
                    reflect(state, 2, depth_m)


@kernel
def _change_tracks(start, stop, cs, number, rows, keys, tracks):
    for b in range(start, stop):
        if rows[b]:
            change_track(cs[0], draws.stream(keys[b], number, draws.FAULT), tracks[b])


def neighbourhood_m(scenario: Scenario) -> float:
    """How far from the target is near it [m]: two sensing radii, and no less than the map of presence can tell."""
    return max(2.0 * scenario.radius_m, 1.5 * max(scenario.field.room_m) / CELLS)


def presence(scenario: Scenario) -> np.ndarray:
    """(CELLS, CELLS) share of an episode's periods in which the target is near each point of the field, by x and y.

    A target at the distance d of a point counts as 1 - (d / R)^2 up to R = `neighbourhood_m`. Of tracks that no
    episode has.
    """
    periods = min(scenario.periods, LONGEST)
    rows = max(STATES // (periods + 1), 4)
    tracks = np.empty((rows, periods + 1, 4))
    keys = np.arange(rows, dtype=np.uint64)  # small ones, which no seed leads to
    Tracks(scenario).draw(np.ones(rows, bool), keys, tracks, 1)
    sides = scenario.field.room_m
    x, y = tracks[..., 0].ravel(), tracks[..., 2].ravel()
    visits = np.histogram2d(x, y, bins=CELLS, range=[(0.0, side) for side in sides])[0]
    middles = [(np.arange(CELLS) + 0.5) * side / CELLS for side in sides]
    along, across = (((middle[:, None] - middle) / neighbourhood_m(scenario)) ** 2 for middle in middles)
    near = np.maximum(1.0 - along[:, None, :, None] - across[None, :, None, :], 0.0)
    found = np.einsum("xyij,ij->xy", near, visits / max(visits.sum(), 1.0))
    return np.maximum(found, LEAST * found.mean())
