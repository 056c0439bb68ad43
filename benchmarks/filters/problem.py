"""What every implementation filters: a target that crosses the field, and the reports of the nodes nearest to it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from wsn_env.scenario import Scenario

MEMBERS = 4  # m
PERIODS = 20  # then the filter starts over from the prior, so that it never loses the target
PRESETS = {"position": "PreDC-v0", "rssi": "Rssi-v0"}


def constant_velocity(t: float) -> tuple[np.ndarray, np.ndarray]:
    """F (4, 4) and G (4, 2) of eqs. 6, 8: x' = F x + G a over a period of t seconds."""
    transition = np.array([[1, t, 0, 0], [0, 1, 0, 0], [0, 0, 1, t], [0, 0, 0, 1]])
    return transition, np.array([[t * t / 2, 0], [t, 0], [0, t * t / 2], [0, t]])


@dataclass(frozen=True)
class Problem:
    """Prior, motion, measurement and the reports of PERIODS periods, for B rows. State: x, vx, y, vy [m, m/s]."""

    measurement: str  # "position" or "rssi"
    q: float  # sd of the filter's acceleration noise [m/s^2]
    resampling: bool  # in every period, or never
    truth: np.ndarray  # (B, PERIODS + 1, 4) the target's states
    sensors: np.ndarray  # (B, PERIODS, m, 2) positions of the reporting nodes [m]
    values: np.ndarray  # (B, PERIODS, m, 2) their reports: x, y [m]; or strength [dB] and 0
    prior_mean: np.ndarray  # (B, 4)
    prior_cov: np.ndarray  # (4, 4)
    particles: np.ndarray  # (B, 4, P) float32, drawn from the prior
    keys: np.ndarray  # (B,) uint64, for generators with keys
    seed: int = 0
    scenario: Scenario = field(default_factory=Scenario)  # of the same motion and measurement

    @classmethod
    def draw(
        cls,
        measurement: str = "position",
        particles: int = 5000,
        rows: int = 1,
        seed: int = 0,
        q: float | None = None,
        resampling: bool = True,
    ) -> Problem:
        """A problem of the preset scenario with this measurement; q and noise are the scenario's unless given."""
        changes = {"filter_q": Scenario.named(PRESETS[measurement]).filter_q if q is None else q}
        scenario = Scenario.named(
            PRESETS[measurement], particles=particles, resample_below=float(resampling), periods=PERIODS, **changes
        )
        rng = np.random.default_rng(seed)
        truth = _tracks(scenario, rows, rng)
        sensors = _nearest_nodes(scenario, truth[:, 1:, ::2], rng)
        sds = np.array([scenario.tracking.start_sd_m, scenario.tracking.start_sd_ms] * 2)
        prior_mean = truth[:, 0] + sds * rng.normal(size=(rows, 4))
        clouds = np.empty((rows, 4, particles), np.float32)
        for row in range(rows):  # one at a time: a large batch must not pass through doubles
            clouds[row] = prior_mean[row, :, None] + sds[:, None] * rng.standard_normal((4, particles), np.float32)
        return cls(
            measurement=measurement,
            q=scenario.filter_q,
            resampling=resampling,
            truth=truth,
            sensors=sensors,
            values=_reports(scenario, truth[:, 1:, None, ::2], sensors, rng),
            prior_mean=prior_mean,
            prior_cov=np.diag(sds**2),
            particles=clouds,
            keys=rng.integers(2**63, size=rows, dtype=np.uint64),
            seed=seed,
            scenario=scenario,
        )

    @property
    def rows(self) -> int:
        """B."""
        return self.particles.shape[0]

    @property
    def count(self) -> int:
        """P."""
        return self.particles.shape[2]

    @property
    def period_s(self) -> float:
        """Sampling period T."""
        return self.scenario.period_s

    @property
    def noise(self) -> float:
        """sd of a report: of each coordinate [m], or of the strength [dB]."""
        return getattr(self.scenario.measurement, "noise_m" if self.measurement == "position" else "noise_db")

    @property
    def level(self) -> float:
        """Strength at 1 m [dB]; 0 for positions."""
        return 0.0 if self.measurement == "position" else self.scenario.measurement.reference_dbm

    @property
    def slope(self) -> float:
        """Strength = level - slope ln(max(d, floor)^2) [dB]; 0 for positions."""
        return 0.0 if self.measurement == "position" else 5 * self.scenario.measurement.exponent / math.log(10)

    @property
    def floor(self) -> float:
        """Square of the distance nearer than which the strength grows no more [m^2]; 0 for positions."""
        return 0.0 if self.measurement == "position" else self.scenario.measurement.floor_m**2

    def row(self, row: int) -> Problem:
        """The problem of one row; its generators have a seed of their own."""
        parts = {name: getattr(self, name)[row : row + 1] for name in PER_ROW}
        return Problem(**{**self.__dict__, **parts, "seed": self.seed + 1000 * (row + 1)})


PER_ROW = ("truth", "sensors", "values", "prior_mean", "particles", "keys")


def _tracks(scenario: Scenario, rows: int, rng: np.random.Generator) -> np.ndarray:
    """(B, PERIODS + 1, 4): from somewhere in the field's middle, at the speed of a crossing of it."""
    side = scenario.field.side_m
    transition, gain = constant_velocity(scenario.period_s)
    heading = rng.uniform(0, 2 * np.pi, rows)
    start = rng.uniform(0.35 * side, 0.65 * side, (rows, 2))
    track = np.empty((rows, PERIODS + 1, 4))
    track[:, 0] = np.stack([start[:, 0], 0.6 * np.cos(heading), start[:, 1], 0.6 * np.sin(heading)], axis=1)
    for k in range(PERIODS):
        acceleration = rng.normal(0, scenario.motion.acceleration_ms2, (rows, 2))
        track[:, k + 1] = track[:, k] @ transition.T + acceleration @ gain.T
    return track


def _nearest_nodes(scenario: Scenario, targets: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """(B, PERIODS, m, 2): the nodes nearest to the positions (B, PERIODS, 2), in a field drawn for each row."""
    rows, periods, _ = targets.shape
    nearest = np.empty((rows, periods, MEMBERS, 2))
    for row in range(rows):
        nodes = rng.uniform(0, scenario.field.side_m, (scenario.field.nodes, 2))
        distances = np.linalg.norm(targets[row, :, None] - nodes, axis=-1)
        nearest[row] = nodes[np.argsort(distances, axis=1)[:, :MEMBERS]]
    return nearest


def _reports(scenario: Scenario, targets, sensors, rng: np.random.Generator) -> np.ndarray:
    m = scenario.measurement
    if scenario.name == PRESETS["position"]:
        return targets + rng.normal(0, m.noise_m, sensors.shape)
    squared = np.maximum(((targets - sensors) ** 2).sum(axis=-1), m.floor_m**2)
    values = np.zeros(sensors.shape)
    values[..., 0] = m.reference_dbm - 5 * m.exponent * np.log10(squared) + rng.normal(0, m.noise_db, squared.shape)
    return values
