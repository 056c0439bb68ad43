"""Calibrations of a folder of recorded tracks: by all of them, and without each one, as files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from wsn_env.bluetooth.calibration import Calibration
from wsn_env.bluetooth.fitting import calibrate, leave_one_out
from wsn_env.bluetooth.residual_map import residual_map, save_map
from wsn_env.models.quantity import suggest
from wsn_env.models.recordings.calibration_file import CalibrationError
from wsn_env.models.recordings.dataset import Track


def calibrate_with_and_without(
    tracks: Sequence[Track], leave_out: str | None = None
) -> tuple[Calibration, list[Calibration]]:
    """The calibration by all tracks, and those without one track each, if there are two tracks or more.

    Args:
        leave_out: name of a track that must be among them.

    Raises:
        CalibrationError: no such track, or nothing is left without it.
    """
    names = [track.name for track in tracks]
    if leave_out is not None and leave_out not in names:
        raise CalibrationError(f"leave_out = {leave_out!r}: no such track; {suggest(leave_out, names)}")
    whole = calibrate(tracks)
    return whole, leave_one_out(tracks) if len(tracks) > 1 or leave_out is not None else []


def save_calibrations(
    tracks: Sequence[Track], calibrations: Sequence[Calibration], out: Path, maps: bool = False
) -> list[str]:
    """Write calibration.json, or without_TRACK.json for one that leaves out a track, into a folder.

    Args:
        tracks: all of them.
        calibrations: what to write.
        out: folder to write into; it is made if need be.
        maps: write the residual map of each calibration, too, as .npz beside it.

    Returns: the files' names.
    """
    out.mkdir(parents=True, exist_ok=True)
    written = []
    for calibration in calibrations:
        stem = "calibration" if calibration.left_out is None else f"without_{calibration.left_out}"
        calibration.save(out / f"{stem}.json")
        written.append(f"{stem}.json")
        if maps:
            save_map(residual_map(tracks, calibration), out / f"{stem}.npz")
            written.append(f"{stem}.npz")
    return written
