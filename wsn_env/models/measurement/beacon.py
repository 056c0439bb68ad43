"""What receivers hear of a beacon that the target carries."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from wsn_env.compiled.elementary import log
from wsn_env.models.measurement.base import AtHead, Line, Measurement, Memory, Occasion, PositionBelief
from wsn_env.models.measurement.beacon_levels import predict_levels, weigh_levels
from wsn_env.models.measurement.beacon_packets import Packets
from wsn_env.models.quantity import ScenarioError, check_quantity, described, quantity
from wsn_env.models.recordings.replay import load_map

if TYPE_CHECKING:
    from wsn_env.scenario import Scenario

MOST_PACKETS = 10_000_000  # of an episode: each receiver's are drawn when it begins
MAP_LEAVES = 0.15  # of the static field's variance, where a map was made on other days

OF_RECEIVERS: dict[str, dict[str, Any]] = {  # what may be each one's own
    "at_1m_db": dict(at_least=-1e6, at_most=1e6),
    "exponents": dict(at_least=0, at_most=1000),
    "heights_m": dict(at_least=-1000, at_most=1000),
}


@dataclass(frozen=True)
class Beacon(Measurement):
    """Levels [dBm] of the packets that a beacon advertises; a receiver that listens reports each one that it hears.

        level = P0 - 10 n log10(d) + field(x, y) + drift(t) + white,    rounded to 1 dB

    with the distance d in three dimensions. P0 and n are each receiver's own (one number: of all alike). The field is
    static, Gaussian with covariance field_db^2 exp(-d / field_m); the drift is an AR(1) of drift_db with time constant
    drift_s; the white part is a mixture of two normals, the lower one for fading. Each receiver has its own draws.
    Packets are lost in bursts: `loss` of all, `loss_after_loss` of those after a lost one. White noise alone would make
    a simulation half as hard as it is, and would make listening to the nearest receivers look harmless.

    The tracker takes field and drift together for a bias of time constant `bias_s`. The default figures are those of
    the recordings of Danis, Naskali, Cemgil & Ersoy (2022), see `Ble-v0`.
    """

    at_1m_db: float | tuple[float, ...] = described(-59.1, "P0, level at 1 m [dBm]; one for all receivers or one each")
    exponents: float | tuple[float, ...] = described(1.7, "path-loss exponent n; one for all receivers or one each")
    heights_m: float | tuple[float, ...] = described(0.0, "height of the receivers; one for all or one each")
    beacon_m: float = quantity(0.0, "height of the beacon", at_least=0, at_most=1000)
    floor_m: float = quantity(0.1, "nearer than this the level grows no more", at_least=1e-6, at_most=1e6)
    field_db: float = quantity(2.24, "sd of the static field", at_least=0, at_most=1000)
    field_m: float = quantity(0.8, "its correlation length", at_least=1e-6, at_most=1e6)
    drift_db: float = quantity(2.02, "sd of the drift", at_least=0, at_most=1000)
    drift_s: float = quantity(7.0, "its time constant", at_least=1e-6, at_most=1e9)
    main_db: float = quantity(1.8, "white part: mean of the upper component", at_least=-1000, at_most=1000)
    main_sd_db: float = quantity(2.9, "its sd", at_least=0, at_most=1000)
    fade_share: float = quantity(0.4, "weight of the lower component", at_least=0, at_most=1)
    fade_db: float = quantity(-2.7, "its mean", at_least=-1000, at_most=1000)
    fade_sd_db: float = quantity(4.5, "its sd", at_least=0, at_most=1000)
    loss: float = quantity(0.146, "probability that a packet is lost", at_least=0, below=1)
    loss_after_loss: float = quantity(0.216, "the same after a lost one", at_least=0, below=1)
    interval_s: float = quantity(0.4525, "between packets", at_least=0.01, at_most=60)
    bias_s: float = quantity(
        7.0, "time constant of the bias that the tracker takes field and drift for", at_least=1e-6, at_most=1e9
    )

    temper: float = quantity(
        0.7,
        "exponent of a level's likelihood in the tracker: below 1 since errors are more alike than it believes",
        above=0,
        at_most=1,
    )

    residual_map: str | None = described(
        None, "file of `wsn calibrate --maps`, the static field as the tracker knows it; None: it knows none"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, allowed in OF_RECEIVERS.items():
            value = getattr(self, name)
            try:
                array = np.asarray(value, dtype=float)
            except (TypeError, ValueError):
                array = np.array(np.nan)
            if array.ndim > 1 or not array.size or not np.isfinite(array).all():
                raise ScenarioError(f"Beacon.{name} = {value!r}: must be a finite number, or one for each receiver")
            for number in array.flat:
                check_quantity("Beacon", name, number.item(), **allowed)
            object.__setattr__(self, name, tuple(array.tolist()) if array.ndim else array.item())
        if not self.least_loss_after_loss <= self.loss_after_loss:
            raise ScenarioError(
                f"Beacon.loss_after_loss = {self.loss_after_loss}: must be at least {self.least_loss_after_loss:.3g}"
                f" for a loss of {self.loss}: else more than every packet after a received one would be lost"
            )

    @property
    def least_loss_after_loss(self) -> float:
        """P(loss | none before) = loss (1 - loss_after_loss) / (1 - loss) must not exceed 1."""
        return max(0.0, 1.0 - (1.0 - self.loss) / self.loss) if self.loss > 0 else 0.0

    @property
    def loss_after_none(self) -> float:
        """Probability that a packet is lost after one that was not."""
        return self.loss * (1.0 - self.loss_after_loss) / (1.0 - self.loss)

    @property
    def bias_db(self) -> float:
        """sd of the tracker's bias state: field and drift; of the field with a map what that leaves of it."""
        left = 1.0 if self.residual_map is None else MAP_LEAVES
        return math.sqrt(left * self.field_db**2 + self.drift_db**2)

    @property
    def white_db(self) -> float:
        """sd of the white part."""
        share, gap = self.fade_share, self.main_db - self.fade_db
        inner = (1 - share) * self.main_sd_db**2 + share * self.fade_sd_db**2
        return math.sqrt(inner + share * (1 - share) * gap**2)

    def packets(self, period_s: float) -> float:
        """Expected number of packets that a listening receiver hears in a period."""
        return (1.0 - self.loss) * period_s / self.interval_s

    def heard(self, period_s: float) -> float:
        """Probability that it hears at least one."""
        sent = period_s / self.interval_s
        fewer, share = math.floor(sent), sent - math.floor(sent)

        def missed(n: int) -> float:
            return 1.0 if n == 0 else self.loss * self.loss_after_loss ** (n - 1)

        return 1.0 - (1.0 - share) * missed(fewer) - share * missed(fewer + 1)

    def of_nodes(self, nodes: int) -> np.ndarray:
        """(S, 3): P0 [dBm], n, squared difference of heights [m^2].

        Raises:
            ScenarioError: a list has another length.
        """
        columns = []
        for name in OF_RECEIVERS:
            array = np.asarray(getattr(self, name), dtype=float)
            if array.ndim and len(array) != nodes:
                raise ScenarioError(f"Beacon.{name} has {len(array)} entries: must have one for each of {nodes} nodes")
            columns.append(np.broadcast_to(array, nodes))
        return np.stack([columns[0], columns[1], (columns[2] - self.beacon_m) ** 2], axis=1)

    allocates: ClassVar[bool] = False
    lasting_errors: ClassVar[bool] = True
    verb: ClassVar[str] = "has heard"

    def check(self, scenario: Scenario) -> None:
        """Levels of all receivers, none of what silence or a search would tell."""
        self.of_nodes(scenario.field.nodes)
        sent = scenario.periods * scenario.period_s / self.interval_s
        if sent > MOST_PACKETS:
            least = scenario.periods * scenario.period_s / MOST_PACKETS
            raise ScenarioError(
                f"Beacon.interval_s = {self.interval_s}: must be at least {least:.4g} s, so that an episode has at most"
                f" {MOST_PACKETS:,} packets"
            )
        tracking = scenario.tracking
        if tracking.search:
            raise ScenarioError("Tracking.search = True: allowed is False with Beacon levels")
        if tracking.silent_information or tracking.fusion != "joint":
            raise ScenarioError(
                f"Tracking.silent_information = {tracking.silent_information}, Tracking.fusion = {tracking.fusion!r}:"
                " allowed are False and 'joint' with Beacon levels"
            )

    def packets_of(self, scenario: Scenario) -> Packets:
        """Where an episode's packets come from."""
        return Packets(self, scenario)

    def residual_maps(self, nodes: int, room_m: tuple[float, float]) -> np.ndarray:
        """(S, nx, ny) float32 dB: what the tracker's mean levels are off by, cell by cell; (0, 0, 0): no map.

        Raises:
            ScenarioError: no map, or one of other receivers or of another room.
        """
        if self.residual_map is None:
            return np.zeros((0, 0, 0), np.float32)
        return load_map(self.residual_map, nodes, room_m)

    def constants(self, scenario: Scenario) -> dict[str, float]:
        """What the tracker takes levels for."""
        heard = self.heard(scenario.period_s)
        return dict(
            floor_m=self.floor_m,
            bias_variance=self.bias_db**2,
            bias_kept=math.exp(-scenario.period_s / self.bias_s),
            white_variance=self.white_db**2,
            temper=self.temper,
            heard=heard,
            report_packets=self.packets(scenario.period_s) / heard,
        )

    @staticmethod
    def sample(m: Any, stream: Any, node: Any, x: float, y: float) -> tuple[float, float]:
        """An episode's packets are drawn at its start, see `Packets`; `news` finds them."""
        return 0.0, 0.0

    @staticmethod
    def news(m: Any, memory: Memory, occasion: Occasion, node: Any, x: float, y: float, c: Any) -> tuple[Any, ...]:
        """A receiver reports the packets that it has heard: their mean level, and how many they are."""
        level, count = memory.packets[node.number, 0], memory.packets[node.number, 1]
        return count > 0.0, np.float64(level), np.float64(count), np.float64(count)

    @staticmethod
    def log_miss(
        m: Any, mean: np.ndarray, cov: np.ndarray, positions: np.ndarray, head: int, members: np.ndarray, c: Any
    ) -> float:
        """A receiver hears its beacon anywhere."""
        awake = len(members) + (head >= 0)
        return awake * log(max(1.0 - m.heard, 1e-12))

    @staticmethod
    def chance(m: Any, node: Any, belief: PositionBelief, c: Any) -> float:
        """That of hearing any packet."""
        return m.heard

    @staticmethod
    def packets_a_report(m: Any) -> float:
        """Those that a receiver hears if it hears any."""
        return m.report_packets

    @staticmethod
    def linearise(m: Any, node: Any, belief: PositionBelief) -> tuple[Any, ...]:
        """The tracker has said what to expect."""
        own = node.learnt
        return (Line(own.expected, own.slope_x, own.slope_y, max(own.variance, 1e-12)),)

    @staticmethod
    def weigh(m: Any, px: np.ndarray, py: np.ndarray, log_weights: np.ndarray, node: Any, value: Any) -> None:
        """Levels are weighed together with their biases, in `weigh_period`."""

    @staticmethod
    def weigh_period(m: Any, head: AtHead, c: Any, maps: np.ndarray, scratch: Any) -> None:
        """The tempered log likelihoods of the reported levels; the biases are corrected by them."""
        weigh_levels(m, head, maps, scratch)

    @staticmethod
    def predict_reports(
        m: Any, belief: Any, positions: np.ndarray, b: int, c: Any, maps: np.ndarray, scratch: Any
    ) -> None:
        """What each receiver should report in the period to come, as a line over the predicted positions."""
        t = c.tracking
        way = 0.5 * c.period_s * (1.0 + t.velocity_kept) if t.walks else c.period_s
        predict_levels(m, way, belief, positions, b, maps, scratch)
