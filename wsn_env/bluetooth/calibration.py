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
from wsn_env.models.arguments import checked
from wsn_env.models.recordings.calibration_file import KIND, VERSION, read_calibration


@dataclass(frozen=True)
class Calibration:
    """A room as recorded tracks show it.

    Args:
        tracks: names of the tracks that it is made of.
        left_out: name of the track that was left out, if any.
        quantities: what a scenario takes, by the names in `calibration_file.QUANTITIES`.
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

    @checked
    def save(self, path: str | Path) -> None:
        """Write a JSON file."""
        content = {"kind": KIND, "version": VERSION, "tracks": list(self.tracks), "left_out": self.left_out}
        content |= {"quantities": self.quantities, "found": self.found, "versions": self.versions}
        with replacing(path) as temporary:
            temporary.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")

    @classmethod
    @checked
    def load(cls, path: str | Path) -> Calibration:
        """Read what `save` wrote; whatever is wrong raises CalibrationError."""
        content = read_calibration(path)
        names = ("left_out", "quantities", "found", "versions")
        return cls(tuple(content["tracks"]), **{name: content[name] for name in names})
