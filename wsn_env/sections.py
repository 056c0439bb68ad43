"""The sections of a scenario: field, motion, sensing, radio, tracking. Frozen quantities with units.

Every default is system A's (Xiang & Guo, 2013, Table 1) unless its meaning says otherwise. Quantities that
follow from others are properties, never fields.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from wsn_env.quantity import ScenarioError, Section, quantity


@dataclass(frozen=True)
class Field(Section):
    """Where the nodes stand: uniformly at random in a square, anew in every episode unless fixed."""

    nodes: int = quantity(225, "number of sensor nodes S", at_least=1, whole=True)
    side_m: float = quantity(100.0, "side of the square field", above=0, at_most=100_000)
    field_seed: int | None = quantity(
        None,
        "one fixed field drawn from this seed; None: a new one each episode",
        at_least=0,
        whole=True,
        optional=True,
    )
    positions: tuple[tuple[float, float], ...] | None = None  # m; given nodes instead of drawn ones

    def __post_init__(self):
        super().__post_init__()
        if self.positions is not None:
            if self.field_seed is not None:
                raise ScenarioError(f"Field.field_seed = {self.field_seed}: must be None where positions are given")
            try:
                array = np.asarray(self.positions, dtype=float)
            except (TypeError, ValueError):
                raise ScenarioError(f"Field.positions = {self.positions!r}: must be finite pairs (x, y) in m") from None
            if array.ndim != 2 or array.shape[1] != 2 or not len(array) or not np.isfinite(array).all():
                raise ScenarioError(f"Field.positions has shape {array.shape}: must be finite pairs (x, y) in m")
            if array.min() < 0 or array.max() > self.side_m:
                raise ScenarioError(
                    f"Field.positions spans {array.min()}..{array.max()}: must lie in 0..{self.side_m} m"
                )
            if self.nodes not in (type(self).nodes, len(array)):
                raise ScenarioError(f"Field.nodes = {self.nodes}: must be {len(array)}, as many as there are positions")
            object.__setattr__(self, "positions", tuple(map(tuple, array.tolist())))
            object.__setattr__(self, "nodes", len(array))


# --- how the target moves -----------------------------------------------------------------------------------


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
    "recorded": Recorded,
    "legs": Legs,
}


# --- what nodes sense ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Detection(Section):
    """Probability of detection against distance (eqs. 2-3)."""

    radius_m: float = quantity(10.0, "sensing radius r_s", above=0)
    softness: float = quantity(0.2, "delta: half width of the soft edge, in radii", above=0, at_most=1)
    decay: float = quantity(1.0, "lambda1", at_least=0)
    ceiling: float = quantity(0.6, "lambda2: probability well inside the radius", above=0, at_most=1)
    decay_power: float = quantity(3.0, "beta1", above=0)
    edge_power: float = quantity(2.0, "beta2", above=0)

    @property
    def reach_m(self) -> float:
        """From here on a node detects nothing."""
        return (1 + self.softness) * self.radius_m


@dataclass(frozen=True)
class Measurement(Section):
    """Base of what a detecting node measures."""

    code: ClassVar[int]


@dataclass(frozen=True)
class Position(Measurement):
    """Its own noisy position of the target (eq. 7)."""

    code: ClassVar[int] = 0
    noise_m: float = quantity(2.0, "sd of each coordinate", above=0)


@dataclass(frozen=True)
class Rssi(Measurement):
    """Received strength in dB: reference - 10 n log10(max(d, floor)) + noise (eq. 1 in its log-distance form)."""

    code: ClassVar[int] = 1
    reference_dbm: float = quantity(-40.0, "level at 1 m")
    exponent: float = quantity(2.5, "path loss exponent n", above=0)
    noise_db: float = quantity(3.0, "sd", above=0)
    floor_m: float = quantity(1.0, "nearer than this the level grows no more", above=0)


@dataclass(frozen=True)
class RssiPower(Measurement):
    """Received power: a max(d, floor)^-beta + noise (eq. 1 as printed, 2 <= beta <= 4)."""

    code: ClassVar[int] = 2
    amplitude: float = quantity(100.0, "power a at 1 m, in any unit", above=0)
    exponent: float = quantity(2.0, "beta", at_least=2, at_most=4)
    noise: float = quantity(0.2, "sd, in the same unit", above=0)
    floor_m: float = quantity(1.0, "nearer than this the power grows no more", above=0)


@dataclass(frozen=True)
class Binary(Measurement):
    """One bit: whether the node detects (Zhou, Cheng & Xing, 2009); a hard disc where detection has no soft edge.

    A node compares with what it sensed last, however long ago, and reports the new state when it differs; before it has
    ever sensed, that is 0.
    """

    code: ClassVar[int] = 4
    reports: str = quantity(
        "changes",
        "changes: a state that differs from the last one sensed; presence: every 1, in every period",
        choices=("changes", "presence"),
    )
    refresh: int = quantity(
        0, "in every so many periods all awake nodes report their state; 0: never", at_least=0, whole=True
    )
    flip: float = quantity(0.0, "probability that a node misreads its state in a period", at_least=0, below=0.5)
    edge_m: float = quantity(1.0, "width of the edge of detection that the particle filter believes in", above=0)


MEASUREMENTS = {"position": Position, "rssi": Rssi, "rssi_power": RssiPower, "binary": Binary}


# --- what talking costs ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Radio(Section):
    """Energy per bit (eq. 5), packet sizes, loss, batteries."""

    tx_nj_per_bit: float = quantity(50.0, "e1: sending, whatever the distance", at_least=0)
    amplifier_pj_per_bit_m2: float = quantity(150.0, "e2: sending, times distance squared", at_least=0)
    rx_nj_per_bit: float = quantity(100.0, "e_r: receiving", at_least=0)
    report_bits: int = quantity(512, "a member's report", at_least=0, whole=True)
    invitation_bits: int = quantity(128, "an invitation to a new member", at_least=0, whole=True)
    handover_bits: int = quantity(448, "the estimate, from old to new head", at_least=0, whole=True)
    wakeup_bits: int = quantity(128, "the wake-up of a search, paid by its receivers", at_least=0, whole=True)
    broadcast_bits: int = quantity(32, "the head's word to resample", at_least=0, whole=True)
    handover: str = quantity(
        "estimate",
        "what is handed over: the estimate (handover_bits) or every particle",
        choices=("estimate", "particles"),
    )
    packet_success: float = quantity(1.0, "probability that one try of a report arrives", at_least=0, at_most=1)
    retries: int = quantity(3, "further tries of a lost report", at_least=0, at_most=15, whole=True)
    receiver: str = quantity(
        "head",
        "who hears the awake nodes: the cluster's head; a sink on mains in the middle of the field; or the target,"
        " whose own node hears their beacons",
        choices=("head", "sink", "target"),
    )
    sensing_nj: float = quantity(0.0, "energy of an awake node's sensing, per period", at_least=0)
    battery_j: float = quantity(1.0, "a node's energy at the start", above=0)

    def sending_j(self, bits: float, distance_m: float) -> float:
        """Energy of sending (eq. 5): bits (e1 + e2 d^2)."""
        return bits * (1e-9 * self.tx_nj_per_bit + 1e-12 * self.amplifier_pj_per_bit_m2 * distance_m**2)

    def receiving_j(self, bits: float) -> float:
        """Energy of receiving (eq. 5): bits e_r."""
        return bits * 1e-9 * self.rx_nj_per_bit

    @property
    def delivery(self) -> float:
        """Probability that a report arrives within all its tries."""
        return 1 - (1 - self.packet_success) ** (1 + self.retries)


# --- how the target is tracked -----------------------------------------------------------------------------


BOUNDARY_TRACKERS = ("boundary_raw", "boundary", "boundary_mid", "boundary_ekf", "centroid", "centroid_rls")
TRACKERS = {  # name: where the class stands
    "particle": "wsn_env.trackers.particle:ParticleTracker",
    "ekf": "wsn_env.trackers.kalman:EKFTracker",
    "snapshot": "wsn_env.trackers.snapshot:SnapshotTracker",
    "ukf": "wsn_env.trackers.kalman:UKFTracker",
    "ckf": "wsn_env.trackers.cubature:CKFTracker",
    "ickf": "wsn_env.trackers.cubature:ICKFTracker",
    "trilateration": "wsn_env.trackers.trilateration:TrilaterationTracker",
    "nonlinear_ls": "wsn_env.trackers.trilateration:NonlinearLSTracker",
    "grnn": "wsn_env.trackers.grnn:GRNNTracker",
    "grnn_kf": "wsn_env.trackers.grnn:GRNNKalmanTracker",
    **dict.fromkeys(BOUNDARY_TRACKERS, "wsn_env.trackers.boundary:BoundaryTracker"),
}


@dataclass(frozen=True)
class Tracking(Section):
    """The filter at the head, and the search rule for lost tracks.

    An episode's first belief, `start`: "known" is N(truth, P0); "search" is what a search in period 0 finds; "field" is
    the whole field with the target at rest; "fix" is the same, but a Gaussian filter (ekf, ukf, ckf, ickf, grnn_kf)
    does not correct it: it begins with a fix of the first reports (see trackers/first_fix.py).
    """

    tracker: str = quantity("particle", " | ".join(TRACKERS), choices=tuple(TRACKERS))
    particles: int = quantity(5000, "number of particles P", at_least=2, at_most=1_000_000, whole=True)
    fusion: str = quantity("joint", "joint (members send z) or pooled (eqs. 9-15)", choices=("joint", "pooled"))
    silent_information: bool = quantity(
        False,
        "weigh with who reported and who kept silent, too (particle only)",
        choices=(True, False),
    )
    resample_below: float = quantity(2 / 3, "resample at N_eff below this share of P (eq. 14)", at_least=0, at_most=1)
    filter_q: float | None = quantity(
        None,
        "sd of the filter's acceleration noise [m/s^2]; None: what suits the motion",
        at_least=0,
        at_most=1000,
        optional=True,
    )
    gate_m: float | None = quantity(
        None,
        "boundary trackers refuse what is off the prediction by more than this and three sds; None: nothing",
        above=0,
        optional=True,
    )
    start: str = quantity(
        "known",
        "known: mean ~ N(truth, P0); search: from a search; field: anywhere; fix: from a fix of the first reports",
        choices=("known", "search", "field", "fix"),
    )
    start_sd_m: float = quantity(1.0, "position sd of P0", above=0, at_most=100_000)
    start_sd_ms: float = quantity(0.1, "velocity sd of P0", above=0, at_most=1000)
    rest_sd_ms: float = quantity(
        1.0, "velocity sd of a target of which none is known yet (starts other than known)", above=0, at_most=1000
    )
    search: bool = quantity(True, "search for lost tracks", choices=(True, False))
    search_miss: float = quantity(1e-3, "search when missing so long was less probable", above=0, at_most=1)
    search_gap: int = quantity(5, "periods between searches, at least", at_least=1, whole=True)
    width_search: str = quantity(
        "golden", "how a fingerprint network's width is found: golden section or fruit flies", choices=("golden", "foa")
    )
    training_seed: int = quantity(
        0, "seed of a fingerprint network's training, apart from every episode's", at_least=0, whole=True
    )

    def __post_init__(self):
        super().__post_init__()
        if self.silent_information and self.tracker != "particle":
            raise ScenarioError(
                f"Tracking.silent_information = True: allowed is False with the tracker {self.tracker!r}; only the"
                " particle filter knows what silence means"
            )
