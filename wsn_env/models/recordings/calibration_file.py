"""The file of a calibration, as `wsn calibrate` writes it: what is in it, and the check of all that."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from wsn_env.models.arguments import check_argument
from wsn_env.models.quantity import ScenarioError, check_quantity, suggest
from wsn_env.models.recordings.files import DatasetError, parse_json, read_file
from wsn_env.models.recordings.receivers import FARTHEST_M

LONGEST_S = 1e6  # of time constants
METRES = dict(at_least=-FARTHEST_M, at_most=FARTHEST_M)
SPREAD = dict(at_least=0, at_most=100)

KIND, VERSION = "wsn_env calibration", 1

# What a scenario takes: each quantity's meaning and bounds; lists hold one figure a receiver.
LISTS: dict[str, tuple[str, dict[str, Any]]] = {
    "positions": ("x and y of the receivers [m]", METRES),
    "heights_m": ("heights of the receivers [m]", METRES),
    "at_1m_db": ("level at 1 m (P0) [dBm]", dict(at_least=-200, at_most=100)),
    "exponents": ("path loss exponents (n)", dict(above=0, at_most=100)),
}
SCALARS: dict[str, tuple[str, dict[str, Any]]] = {
    "side_m": ("width of the room, along x", dict(above=0, at_most=FARTHEST_M)),
    "depth_m": ("depth of the room, along y", dict(above=0, at_most=FARTHEST_M)),
    "beacon_m": ("mean height of the beacon", METRES),
    "field_db": ("sd of the field that stands in the room", SPREAD),
    "field_m": ("its correlation length", dict(above=0, at_most=FARTHEST_M)),
    "drift_db": ("sd of the drift", SPREAD),
    "drift_s": ("its time constant", dict(above=0, at_most=LONGEST_S)),
    "main_db": ("mean of the white part's upper component", dict(at_least=-100, at_most=100)),
    "main_sd_db": ("its sd", dict(above=0, at_most=100)),
    "fade_share": ("weight of the lower component", dict(at_least=0, at_most=1)),
    "fade_db": ("its mean", dict(at_least=-100, at_most=100)),
    "fade_sd_db": ("its sd", dict(above=0, at_most=100)),
    "loss": ("probability that a packet is lost", dict(at_least=0, below=1)),
    "loss_after_loss": ("the same if the packet before was lost", dict(at_least=0, below=1)),
    "interval_s": ("advertising interval", dict(at_least=0.01, at_most=60)),
    "bias_s": ("time constant of the tracker's bias", dict(above=0, at_most=LONGEST_S)),
}
QUANTITIES = LISTS | SCALARS


class CalibrationError(ValueError):
    """A calibration cannot be made, or a file holds none; the message names the file, the field and its value."""


def read_calibration(path: str | Path) -> dict[str, Any]:
    """What a file of `wsn calibrate` holds.

    Raises:
        CalibrationError: names the file, the field, its value and what is allowed.
    """
    try:
        content = parse_json(read_file(path))
    except DatasetError as error:
        raise CalibrationError(str(error)) from None
    except ValueError as error:
        raise CalibrationError(f"{path}: is no JSON: {error}") from None
    try:
        _check(content)
    except (CalibrationError, ScenarioError) as error:
        raise CalibrationError(f"{path}: {error}") from None
    return content


def read_quantities(path: str | Path) -> dict[str, Any]:
    """The scenario quantities of such a file.

    Raises:
        ScenarioError: names the file and what is wrong with it.
    """
    check_argument("calibration", path, str | Path, ScenarioError)
    try:
        quantities = read_calibration(path)["quantities"]
    except CalibrationError as problem:
        why = str(problem).removeprefix(f"{path}: ")
        raise ScenarioError(f"calibration = {str(path)!r}: is no file of `wsn calibrate`: {why}") from None
    return quantities | {"positions": tuple(map(tuple, quantities["positions"]))}


def _check(content: Any) -> None:
    """Raise unless a file's content is a calibration."""
    if not isinstance(content, dict) or content.get("kind") != KIND:
        kind = content.get("kind") if isinstance(content, dict) else content
        raise CalibrationError(f"kind = {kind!r:.60}: must be {KIND!r}")
    if content.get("version") != VERSION:
        raise CalibrationError(f"version = {content.get('version')!r:.60}: must be {VERSION}")
    texts = content.get("tracks")
    if not isinstance(texts, list) or not texts or not all(isinstance(text, str) for text in texts):
        raise CalibrationError(f"tracks = {texts!r:.60}: must be a list of names")
    left_out = content.get("left_out", 0)
    if not (left_out is None or isinstance(left_out, str)) or left_out in texts:
        raise CalibrationError(
            f"left_out = {left_out!r:.60}: must be null, or the name of a track that is not in tracks"
        )
    for name in ("quantities", "found", "versions"):
        if not isinstance(content.get(name), dict):
            raise CalibrationError(f"{name} = {content.get(name)!r:.60}: must be an object")
    check_quantities(content["quantities"])


def check_quantities(quantities: dict[str, Any]) -> None:
    """Raise CalibrationError or ScenarioError unless they are all there, no others, and within their bounds."""
    for name in quantities:
        if name not in QUANTITIES:
            raise CalibrationError(
                f"quantities.{name:.60} = {quantities[name]!r:.60}: unknown; {suggest(name, QUANTITIES)}"
            )
    for name in QUANTITIES:
        if name not in quantities:
            raise CalibrationError(f"quantities.{name}: is missing ({QUANTITIES[name][0]})")
    for name, (_, allowed) in SCALARS.items():
        check_quantity("quantities", name, quantities[name], **allowed)
    positions = quantities["positions"]
    count = len(positions) if isinstance(positions, list) else 0
    for name, (meaning, allowed) in LISTS.items():
        values = quantities[name]
        if not isinstance(values, list) or not values or len(values) != count:
            raise CalibrationError(
                f"quantities.{name} = {values!r:.60}: must be a list, one for every receiver ({meaning})"
            )
        for i, value in enumerate(values):
            if name == "positions" and not (isinstance(value, list) and len(value) == 2):
                raise CalibrationError(f"quantities.positions[{i}] = {value!r:.60}: must be a pair, x and y")
            for number in value if name == "positions" else [value]:
                check_quantity("quantities", f"{name}[{i}]", number, **allowed)
