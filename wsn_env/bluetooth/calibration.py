"""A calibration: what describes the radio of a room, as quantities of a scenario, and its file.

A level is, in dB,

    level = P0_s - 10 n_s log10(d) + field_s(position) + drift_s(time) + white

for receiver s at the distance d [m] of the beacon: a field that stands in the room (it has the same value whenever
the beacon comes back), a drift that forgets with time, and a white part of its own for every packet. White is a
mixture of two normal distributions, of which the lower one is called fading; its mean over all is zero.

`fitting.calibrate` estimates all of it from recorded tracks.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from math import sqrt
from pathlib import Path
from typing import Any

from wsn_env.evaluation.files import replacing
from wsn_env.models.quantity import ScenarioError, check_quantity, suggest

KIND, VERSION = "wsn_env calibration", 1

# What a scenario takes: each quantity's meaning and bounds; lists hold one figure a receiver.
LISTS: dict[str, tuple[str, dict[str, Any]]] = {
    "positions": ("x and y of the receivers [m]", {}),
    "heights_m": ("heights of the receivers [m]", {}),
    "at_1m_db": ("level at 1 m (P0) [dBm]", {}),
    "exponents": ("path loss exponents (n)", dict(above=0)),
}
SCALARS: dict[str, tuple[str, dict[str, Any]]] = {
    "side_m": ("width of the room, along x", dict(above=0)),
    "depth_m": ("depth of the room, along y", dict(above=0)),
    "beacon_m": ("mean height of the beacon", {}),
    "field_db": ("sd of the field that stands in the room", dict(at_least=0)),
    "field_m": ("its correlation length", dict(above=0)),
    "drift_db": ("sd of the drift", dict(at_least=0)),
    "drift_s": ("its time constant", dict(above=0)),
    "main_db": ("mean of the white part's upper component", {}),
    "main_sd_db": ("its sd", dict(above=0)),
    "fade_share": ("weight of the lower component", dict(at_least=0, at_most=1)),
    "fade_db": ("its mean", {}),
    "fade_sd_db": ("its sd", dict(above=0)),
    "loss": ("probability that a packet is lost", dict(at_least=0, below=1)),
    "loss_after_loss": ("the same if the packet before was lost", dict(at_least=0, below=1)),
    "interval_s": ("advertising interval", dict(above=0)),
    "bias_s": ("time constant of the tracker's bias", dict(above=0)),
}
QUANTITIES = LISTS | SCALARS


class CalibrationError(ValueError):
    """A calibration cannot be made, or a file holds none; the message names the file, the field and its value."""


@dataclass(frozen=True)
class Calibration:
    """A room as recorded tracks show it.

    Args:
        tracks: names of the tracks that it is made of.
        left_out: name of the track that was left out, if any.
        quantities: what a scenario takes, by the names in `QUANTITIES`.
        found: further figures, for people.
        versions: what made it.
    """

    tracks: tuple[str, ...]
    left_out: str | None
    quantities: dict[str, Any]
    found: dict[str, Any]
    versions: dict[str, str]

    @property
    def bias_db(self) -> float:
        """Sd of what neighbouring packets share: field and drift."""
        return sqrt(self.quantities["field_db"] ** 2 + self.quantities["drift_db"] ** 2)

    @property
    def white_db(self) -> float:
        """Sd of the white part."""
        q = self.quantities
        main = q["main_db"] ** 2 + q["main_sd_db"] ** 2
        return sqrt((1 - q["fade_share"]) * main + q["fade_share"] * (q["fade_db"] ** 2 + q["fade_sd_db"] ** 2))

    def save(self, path: str | Path) -> None:
        """Write a JSON file."""
        content = {"kind": KIND, "version": VERSION, "tracks": list(self.tracks), "left_out": self.left_out}
        content |= {"quantities": self.quantities, "found": self.found, "versions": self.versions}
        with replacing(path) as temporary:
            temporary.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")

    @classmethod
    def load(cls, path: str | Path) -> Calibration:
        """Read what `save` wrote; whatever is wrong raises CalibrationError."""
        try:
            content = json.loads(Path(path).read_text(encoding="utf-8"))
        except OSError as error:
            raise CalibrationError(f"{path}: cannot be read: {error.strerror or error}") from error
        except ValueError as error:
            raise CalibrationError(f"{path}: is no JSON: {error}") from error
        try:
            _check(content)
        except (CalibrationError, ScenarioError) as error:
            raise CalibrationError(f"{path}: {error}") from None
        names = ("left_out", "quantities", "found", "versions")
        return cls(tuple(content["tracks"]), **{name: content[name] for name in names})


def _check(content: Any) -> None:
    """Raise unless a file's content is a calibration."""
    if not isinstance(content, dict) or content.get("kind") != KIND:
        kind = content.get("kind") if isinstance(content, dict) else content
        raise CalibrationError(f"kind = {kind!r}: must be {KIND!r}")
    if content.get("version") != VERSION:
        raise CalibrationError(f"version = {content.get('version')!r}: must be {VERSION}")
    texts = content.get("tracks")
    if not isinstance(texts, list) or not texts or not all(isinstance(text, str) for text in texts):
        raise CalibrationError(f"tracks = {texts!r}: must be a list of names")
    left_out = content.get("left_out", 0)
    if not (left_out is None or isinstance(left_out, str)) or left_out in texts:
        raise CalibrationError(f"left_out = {left_out!r}: must be null, or the name of a track that is not in tracks")
    for name in ("quantities", "found", "versions"):
        if not isinstance(content.get(name), dict):
            raise CalibrationError(f"{name} = {content.get(name)!r}: must be an object")
    _check_quantities(content["quantities"])


def _check_quantities(quantities: dict[str, Any]) -> None:
    for name in quantities:
        if name not in QUANTITIES:
            raise CalibrationError(f"quantities.{name} = {quantities[name]!r}: unknown; {suggest(name, QUANTITIES)}")
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
                f"quantities.{name} = {values!r}: must be a list, one for every receiver ({meaning})"
            )
        for i, value in enumerate(values):
            if name == "positions" and not (isinstance(value, list) and len(value) == 2):
                raise CalibrationError(f"quantities.positions[{i}] = {value!r}: must be a pair, x and y")
            for number in value if name == "positions" else [value]:
                check_quantity("quantities", f"{name}[{i}]", number, **allowed)
