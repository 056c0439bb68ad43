"""How the target moves."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from wsn_env.models.quantity import ScenarioError, Section, quantity


@dataclass(frozen=True)
class Motion(Section):
    """Base of all motions. `fitting_q` is the filter's process noise that suits the track [m/s^2]."""

    fitting_q: ClassVar[float]


@dataclass(frozen=True)
class Crossing(Motion):
    """Towards a uniform point of the inner field from another, in the horizon's time, but for noise (the default).

    The noise is drawn until the whole track lies in the field: a mirror at the border would turn the velocity in an
    instant, which no filter with this q can follow.
    """

    fitting_q: ClassVar[float] = 0.05
    margin_m: float = quantity(10.0, "end points keep this distance from the border", at_least=0)
    crossing_m: float = quantity(40.0, "least distance between the end points", above=0)
    acceleration_ms2: float = quantity(0.025, "sd of the white acceleration on the track (q/2)", at_least=0)


@dataclass(frozen=True)
class Straight(Motion):
    """The diagonal of the reproduction: from a point at a constant velocity, without noise."""

    fitting_q: ClassVar[float] = 0.02
    from_m: float = quantity(5.0, "start, both axes", at_least=0)
    velocity_ms: float = quantity(0.9, "velocity, both axes")


@dataclass(frozen=True)
class Sine(Motion):
    """One full wave across the field: x advances at a constant speed, y swings about the middle."""

    fitting_q: ClassVar[float] = 0.2
    speed_ms: float = quantity(0.9, "speed along x", above=0)
    amplitude_m: float = quantity(25.0, "swing along y", at_least=0)
    turn_s: float = quantity(100.0, "time of one wave", above=0)


@dataclass(frozen=True)
class Circle(Motion):
    """Round the middle of the field at a constant speed (1.9 m/s by default)."""

    fitting_q: ClassVar[float] = 0.2
    circle_m: float = quantity(30.0, "radius", above=0)
    turn_s: float = quantity(100.0, "time of one round", above=0)


@dataclass(frozen=True)
class Turns(Motion):
    """Random turns: constant speed, now and then a new heading within a quarter turn; reflected at the border."""

    fitting_q: ClassVar[float] = 0.2
    speed_ms: float = quantity(1.0, "speed", above=0)
    turn_probability: float = quantity(0.1, "probability of a turn in a period", at_least=0, at_most=1)


@dataclass(frozen=True)
class Waypoint(Motion):
    """Random waypoint: straight at a constant speed to a uniform point of the field, then to the next."""

    fitting_q: ClassVar[float] = 0.2
    speed_ms: float = quantity(1.0, "speed", above=0)


@dataclass(frozen=True)
class Walk(Motion):
    """A walk in a room: straight to a uniform point of it, then to the next, each leg at a speed of its own."""

    fitting_q: ClassVar[float] = 0.2
    slowest_ms: float = quantity(0.14, "least speed of a leg", above=0)
    fastest_ms: float = quantity(0.73, "greatest speed of a leg", above=0)
    margin_m: float = quantity(1.0, "goals keep this distance from the walls", at_least=0)

    def __post_init__(self):
        super().__post_init__()
        if self.slowest_ms > self.fastest_ms:
            raise ScenarioError(f"Walk.slowest_ms = {self.slowest_ms}: must be at most fastest_ms = {self.fastest_ms}")


@dataclass(frozen=True)
class Cruise(Motion):
    """From a uniform point of the inner field at a given speed in any direction, with white acceleration.

    Start, heading and noise are drawn until the whole track keeps its distance from the border. White acceleration of
    density D [m^2/s^3] is, in periods of T seconds, one of sd sqrt(D / T): the positions lack an independent part of
    variance D T^3 / 12 then, which is negligible beside any measurement here.
    """

    fitting_q: ClassVar[float] = 0.01
    speed_ms: float = quantity(1.0, "speed at the start", above=0)
    acceleration_ms2: float = quantity(0.01, "sd of the white acceleration on the track", at_least=0)
    inset_m: float = quantity(200.0, "starts keep this distance from the border", at_least=0)
    margin_m: float = quantity(60.0, "the whole track keeps this distance from the border", at_least=0)


@dataclass(frozen=True)
class Recorded(Motion):
    """Recorded tracks from CSV files with columns t, x, y [s, m, m]; an episode picks one by its key.

    Each is resampled linearly to the horizon's periods; with `span_m` it is scaled so that the longer side of its
    bounding box has this length, and centred onto the field.
    """

    fitting_q: ClassVar[float] = 0.2
    tracks: tuple[str, ...] = ()
    span_m: float | None = quantity(80.0, "scale to this extent and centre; None: as recorded", above=0, optional=True)

    def __post_init__(self):
        names = (self.tracks,) if isinstance(self.tracks, (str, Path)) else self.tracks
        object.__setattr__(self, "tracks", tuple(str(name) for name in names))
        if not self.tracks:
            raise ScenarioError("Recorded.tracks = (): must name at least one CSV file with columns t, x, y")
        super().__post_init__()


@dataclass(frozen=True)
class Replay(Motion):
    """A recorded walk with a beacon, and the packets that were recorded with it; nothing else reaches the tracker.

    A file of the published format, see `wsn_env.bluetooth`. The target's position in a period is the mean of its
    packets'. Where the horizon is not given it is the recording's.
    """

    fitting_q: ClassVar[float] = 0.2
    recording: str = ""

    def __post_init__(self):
        object.__setattr__(self, "recording", str(self.recording))
        if not self.recording:
            raise ScenarioError("Replay.recording = '': must name a file such as straight_01_all_sensors.mbd")
        super().__post_init__()


@dataclass(frozen=True)
class Legs(Motion):
    """Straight legs, each at a velocity of its own, without noise; after the last the target stands still.

    The track is exact at every instant, wherever the periods fall: a turn within a period cuts no corner. At the
    instant of a turn the velocity is still that of the leg that ends. `fitting_q` suits walkers; a target that turns
    at 10 m/s needs a `filter_q` of 1 m/s^2 or more.
    """

    fitting_q: ClassVar[float] = 0.2
    start_m: tuple[float, float] = (5.0, 5.0)  # x, y
    legs: tuple[tuple[float, float, float], ...] = ((100.0, 0.9, 0.9),)  # s, m/s along x, m/s along y

    def __post_init__(self):
        super().__post_init__()
        start = self._finite("start_m", (2,), "a finite pair (x, y) in m")
        legs = self._finite("legs", (-1, 3), "finite triples (seconds, vx, vy) in s and m/s, at least one")
        if legs[:, 0].min() <= 0:
            raise ScenarioError(f"Legs.legs = {self.legs!r}: must last longer than 0 s each")
        object.__setattr__(self, "start_m", tuple(start.tolist()))
        object.__setattr__(self, "legs", tuple(map(tuple, legs.tolist())))

    def _finite(self, name: str, shape: tuple[int, ...], allowed: str) -> np.ndarray:
        value = getattr(self, name)
        try:
            array = np.asarray(value, dtype=float)
        except (TypeError, ValueError):
            array = np.empty(())
        fits = len(shape) == array.ndim and array.size and array.shape[-1] == shape[-1]
        if not fits or not np.isfinite(array).all():
            raise ScenarioError(f"Legs.{name} = {value!r}: must be {allowed}")
        return array


MOTIONS = {
    "crossing": Crossing,
    "straight": Straight,
    "sine": Sine,
    "circle": Circle,
    "turns": Turns,
    "waypoint": Waypoint,
    "cruise": Cruise,
    "recorded": Recorded,
    "legs": Legs,
    "walk": Walk,
    "replay": Replay,
}
