"""What is the same in every episode: straight legs, recorded tracks, recorded packets."""

import csv

import numpy as np

from wsn_env.models.quantity import ScenarioError
from wsn_env.models.recordings.replay import receivers_of, recorded
from wsn_env.scenario import Scenario

SAME_PLACE_M = 0.05


def walk_legs(scenario: Scenario) -> np.ndarray:
    """The track (periods + 1, 4) of straight legs; it may touch the border, rounding errors there are cut off.

    Raises:
        ScenarioError: the track leaves the field within the horizon.
    """
    motion, side = scenario.motion, scenario.field.side_m
    legs = np.array(motion.legs + ((np.inf, 0.0, 0.0),))  # at last it stands still
    ends = np.cumsum(legs[:, 0])
    begins = np.concatenate(([0.0], ends[:-1]))
    corners = motion.start_m + np.concatenate(([[0.0, 0.0]], np.cumsum(legs[:-1, :1] * legs[:-1, 1:], axis=0)))
    time = scenario.period_s * np.arange(scenario.periods + 1)
    leg = np.searchsorted(ends, time - 1e-9 * scenario.period_s)
    points = corners[leg] + (time - begins[leg])[:, None] * legs[leg, 1:]
    outside = np.flatnonzero(~((points >= -1e-9 * side) & (points <= (1 + 1e-9) * side)).all(axis=1))
    if outside.size:
        k = outside[0]
        there = tuple(points[k].tolist())
        raise ScenarioError(
            f"Legs.legs = {motion.legs!r}: lead from {motion.start_m} to {there} m at {time[k]:g} s: must stay in"
            f" the field 0..{side} m for the horizon"
        )
    track = np.empty((len(time), 4))
    track[:, ::2] = np.clip(points, 0.0, side)
    track[:, 1::2] = legs[leg, 1:]
    return track


def read_track(path: str, scenario: Scenario) -> np.ndarray:
    """A recorded track (periods + 1, 4), resampled linearly to the horizon, scaled and centred on request.

    Args:
        path: CSV with a header naming at least t, x, y [s, m, m]; times must increase.

    Raises:
        ScenarioError: names the file, the line and what is allowed.
    """
    times, points = [], []
    try:
        with open(path, newline="", encoding="utf-8-sig") as file:
            table = csv.DictReader(file, skipinitialspace=True)
            missing = [name for name in "txy" if name not in (table.fieldnames or ())]
            if missing:
                raise ScenarioError(
                    f"{path}: column {missing[0]!r} is missing: the header must name t, x, y; it is {table.fieldnames}"
                )
            for row in table:
                try:
                    t, x, y = (float(row[name]) for name in "txy")
                except (TypeError, ValueError):
                    raise ScenarioError(f"{path}, line {table.line_num}: {row} must be numbers t, x, y") from None
                if not np.isfinite((t, x, y)).all():
                    raise ScenarioError(f"{path}, line {table.line_num}: t={t}, x={x}, y={y} must be finite")
                if times and t <= times[-1]:
                    raise ScenarioError(f"{path}, line {table.line_num}: t={t} must be later than {times[-1]}")
                times.append(t)
                points.append((x, y))
    except (OSError, UnicodeDecodeError, csv.Error) as problem:
        raise ScenarioError(f"track {path!r} cannot be read: {problem}") from None
    if len(times) < 2:
        raise ScenarioError(f"{path}: has {len(times)} points: at least 2 are needed")
    return _resampled(path, np.array(times), np.array(points), scenario)


def _resampled(path, times, points, scenario: Scenario) -> np.ndarray:
    side, span = scenario.field.side_m, scenario.motion.span_m
    if span is not None:
        low, high = points.min(axis=0), points.max(axis=0)
        extent = (high - low).max()
        if extent == 0:
            raise ScenarioError(f"{path}: the target does not move: cannot scale to span_m = {span}")
        points = side / 2 + (points - (low + high) / 2) * min(span, side) / extent
    elif points.min() < 0 or points.max() > side:
        raise ScenarioError(
            f"{path}: spans {points.min()}..{points.max()} m: must lie in the field 0..{side} m, or give span_m"
        )
    if not np.isfinite(points).all():
        raise ScenarioError(f"{path}: coordinates as large as this cannot be scaled to span_m = {span}")
    at = np.linspace(times[0], times[-1], scenario.periods + 1)
    track = np.empty((scenario.periods + 1, 4))
    for axis in (0, 1):
        track[:, 2 * axis] = np.interp(at, times, points[:, axis])
        track[:, 2 * axis + 1] = np.gradient(track[:, 2 * axis], scenario.period_s)
    return track


def replayed_track(scenario: Scenario) -> np.ndarray:
    """The track (periods + 1, 4) of a recording; it begins where the first period's packets were sent.

    Raises:
        ScenarioError: the recording is shorter than the horizon, leaves the room, or has other receivers.
    """
    path, room = scenario.motion.recording, np.array(scenario.field.room_m)
    _, _, positions = recorded(path, scenario.period_s)
    if len(positions) < scenario.periods:
        raise ScenarioError(f"Scenario.periods = {scenario.periods}: must be at most {len(positions)}, those of {path}")
    theirs, ours = receivers_of(path)[:, :2], np.array(scenario.field.positions or ()).reshape(-1, 2)
    if theirs.shape != ours.shape or np.abs(theirs - ours).max() > SAME_PLACE_M:
        raise ScenarioError(
            f"Field.positions: must be those of the {len(theirs)} receivers of {path}, in the same order (calibrate on"
            " its folder)"
        )
    if (positions < -SAME_PLACE_M).any() or (positions > room + SAME_PLACE_M).any():
        raise ScenarioError(f"{path}: leaves the room of {room[0]:g} x {room[1]:g} m (side_m, depth_m)")
    track = np.empty((scenario.periods + 1, 4))
    track[1:, ::2] = np.clip(positions[: scenario.periods], 0.0, room)
    track[0] = track[1]
    for axis in (0, 2):
        track[:, axis + 1] = np.gradient(track[:, axis], scenario.period_s) if scenario.periods > 0 else 0.0
    return track


def replayed_packets(scenario: Scenario) -> np.ndarray:
    """Mean level [dBm] and number of the packets that each receiver recorded: (periods + 1, S, 2), none in period 0."""
    levels, counts, _ = recorded(scenario.motion.recording, scenario.period_s)
    packets = np.zeros((scenario.periods + 1, levels.shape[1], 2), np.float32)
    packets[1:, :, 0], packets[1:, :, 1] = levels[: scenario.periods], counts[: scenario.periods]
    return packets
