"""Recorded motion, from CSV files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from wsn_env.compiled import draws
from wsn_env.models.arguments import check_argument
from wsn_env.models.motion.base import Motion
from wsn_env.models.quantity import ScenarioError, described, quantity
from wsn_env.models.recordings.tracks import read_track

if TYPE_CHECKING:
    from wsn_env.scenario import Scenario


@dataclass(frozen=True)
class RecordedMotion(Motion):
    """Base of motions whose tracks are known beforehand."""

    abstract: ClassVar[bool] = True
    bounded: ClassVar[bool] = False  # where the target was it was, even a little outside

    @staticmethod
    def draw(m: Any, stream: Any, course: Any, track: np.ndarray) -> None:
        """One of them, by the episode's key."""
        track[:] = course.recorded[int(draws.uniform(stream, 0) * len(course.recorded))]


@dataclass(frozen=True)
class Recorded(RecordedMotion):
    """Recorded tracks from CSV files with columns t, x, y [s, m, m]; an episode picks one by its key.

    Each is resampled linearly to the horizon's periods; with `span_m` it is scaled so that the longer side of its
    bounding box has this length, and centred onto the field.
    """

    fitting_q: ClassVar[float] = 0.2
    tracks: tuple[str, ...] = described((), "CSV files with columns t, x, y [s, m, m]")
    span_m: float | None = quantity(80.0, "scale to this extent and centre; None: as recorded", above=0, optional=True)

    def __post_init__(self) -> None:
        check_argument("Recorded.tracks", self.tracks, str | Path | Sequence[str | Path], ScenarioError)
        names = (self.tracks,) if isinstance(self.tracks, (str, Path)) else self.tracks
        object.__setattr__(self, "tracks", tuple(str(name) for name in names))
        if not self.tracks:
            raise ScenarioError("Recorded.tracks = (): must name at least one CSV file with columns t, x, y")
        super().__post_init__()

    def recorded_tracks(self, scenario: Scenario) -> np.ndarray:
        """One of each file."""
        return np.stack([read_track(path, self.span_m, scenario) for path in self.tracks])
