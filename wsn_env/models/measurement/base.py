"""What a measurement has to say, and the defaults of what it need not.

Kernels call the functions at the end of this file with a kind's constants first; see `models.kinds`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NamedTuple

import numpy as np

from wsn_env.compiled import draws
from wsn_env.compiled.elementary import F, log
from wsn_env.compiled.kernels import lean_piece
from wsn_env.models.detection.base import detects, mean_probability, probability, stream_of
from wsn_env.models.kinds import Kind, by_kind
from wsn_env.models.quantity import ScenarioError
from wsn_env.models.state import Sensors

if TYPE_CHECKING:
    from wsn_env.scenario import Scenario

Order = Literal["nearest", "information", "value"]  # of merit

EXPECT_AT = 1.7320508075688772  # sds: Gauss and Hermite's three points


class Line(NamedTuple):
    """One measured number, linearised in the target's position."""

    expected: float
    slope_x: float  # per m
    slope_y: float
    variance: float  # of its noise


class PositionBelief(NamedTuple):
    """Where a target is believed to be: mean and covariance of a normal position [m, m^2]."""

    x: float
    y: float
    xx: float  # all three 0: it is there
    xy: float
    yy: float


class Node(NamedTuple):
    """A node as its measurement knows it."""

    number: Any  # int64
    x: float  # m
    y: float
    learnt: Line  # what the tracker has learnt that its next report should be, where errors last; else zeros


class Memory(NamedTuple):
    """What a field's nodes and their head keep of states and packets; arrays of length 0 where the kind keeps none."""

    sensed: np.ndarray  # (S,) int8: what each node sensed last, known to itself alone
    bitmap: np.ndarray  # (S,) int8: the states that the head knows
    packets: np.ndarray  # (S, 2): mean level and number of the packets in reach


class Occasion(NamedTuple):
    """When a node senses."""

    key: Any  # of the episode's random numbers
    period: int  # of the random numbers; a sensor that is stuck draws them of the period in which it got stuck
    asked: bool  # whether the head is looking for a lost target
    clock: int  # the period by the clock


class AtHead(NamedTuple):
    """What a head has to correct its belief with."""

    belief: Any  # Belief, of all rows
    network: Any  # Network
    reports: Any  # Reports
    b: int  # the row


@dataclass(frozen=True)
class Measurement(Kind):
    """Base of what nodes measure.

    A kind has `sample` and `linearise`, and `log_likelihood` or else `weigh`:

        sample(m, stream, node, x, y) -> (value, second value)
            What a node measures of a target at (x, y); random numbers are draws of `stream` at `node.number`.
        log_likelihood(m, value, second, node, x, y) -> log density of a measured value, but for a constant, at most 0
            For one particle at (x, y), float32.
        linearise(m, node, belief) -> a tuple of `Line`s, one for each number of the value
            About a target that is believed to be there.

    `m` holds the kind's constants, `node` is a `Node`, `belief` a `PositionBelief`; all lengths in m. The functions
    after these have defaults.
    """

    abstract: ClassVar[bool] = True
    role: ClassVar[str] = "measurement"
    required: ClassVar[tuple[str, ...]] = ("sample", "linearise", "weigh")
    optional: ClassVar[tuple[str, ...]] = (
        "log_likelihood",
        "unwrap",
        "signal",
        "tells",
        "news",
        "take_note",
        "finds_target",
        "log_miss",
        "chance",
        "packets_a_report",
        "weigh_period",
        "predict_reports",
        "level",
        "level_slope",
    )

    values: ClassVar[int] = 1  # numbers of a report
    equal_everywhere: ClassVar[bool] = False  # whether a report tells the same wherever its node stands
    reports_state: ClassVar[bool] = False  # whether nodes remember a state and report how it stands, so that silence
    # tells as much as a report
    gaussian: ClassVar[bool] = False  # whether noise is normal, of constant variance, and `linearise` exact at a point:
    # then H' R^-1 H is all of a value's Fisher information, as the bound needs it
    lasting_errors: ClassVar[bool] = False  # whether errors are alike from period to period, so that silence tells
    # nothing and a tracker has to learn them
    order: ClassVar[Order] = "information"  # the menu's order of merit that suits it
    verb: ClassVar[str] = "reported"  # what a node has done that was heard

    def check_functions(self) -> None:
        """Raise ScenarioError unless the kind has what is required, and a likelihood."""
        super().check_functions()
        if type(self).weigh is Measurement.weigh and not callable(getattr(type(self), "log_likelihood", None)):
            raise ScenarioError(
                f"{type(self).__name__} has no log_likelihood(...): a measurement must have it, or weigh"
            )

    @property
    def independent(self) -> bool:
        """Whether reports depend on nothing but the target of their period: what a Kalman filter supposes."""
        return not (self.reports_state or self.lasting_errors)

    def axes(self, nodes: int) -> dict[str, int]:
        """Lengths of the state's arrays that only some kinds use."""
        return {"states": nodes if self.reports_state else 0, "receivers": nodes if self.lasting_errors else 0}

    def check(self, scenario: Scenario) -> None:
        """Raise ScenarioError where it does not fit the rest of the scenario."""

    def packets_of(self, scenario: Scenario) -> Any:
        """Where an episode's packets come from, drawn or recorded before it begins; None: there are none."""
        return None

    def residual_maps(self, nodes: int, room_m: tuple[float, float]) -> np.ndarray:
        """(S, nx, ny) float32: what a tracker knows that values are off by, cell by cell; (0, 0, 0): nothing."""
        return np.zeros((0, 0, 0), np.float32)

    def ring_m(self, radius_m: float) -> float:
        """How far from the target a node tells most; here as near as may be."""
        return 0.0

    def fixes(self, values: np.ndarray, places: np.ndarray, radius_m: float) -> tuple[np.ndarray, float]:
        """Where reports alone put the target: here where the nodes (n, 2) stand. Points (n, 2), variance [m, m^2]."""
        return places, radius_m**2 / 2

    def signals(self, values: np.ndarray, places: np.ndarray) -> np.ndarray:
        """(...,) how strong reports (..., 2) of nodes at (..., 2) are; here the value itself."""
        return values[..., 0]

    def raised(self, signal: np.ndarray, by_db: float) -> np.ndarray:
        """A signal so much stronger; here a power."""
        return signal * 10 ** (by_db / 10)

    @staticmethod
    def weigh(m: Any, px: np.ndarray, py: np.ndarray, log_weights: np.ndarray, node: Any, value: Any) -> None:
        """Add a report's log likelihood to the log weights of some particles.

        Args:
            px, py, log_weights: (P,) float32; m, m, log weights to change.
            value: (2,) what was reported.
        """
        first, second = F(value[0]), F(value[1])
        for i in range(len(px)):
            log_weights[i] += F(log_likelihood(m, first, second, node, px[i], py[i]))

    @staticmethod
    def unwrap(m: Any, value: Any, about: Any) -> Any:
        """The same value, told near another: of an angle, without the jump of a whole turn."""
        return value

    @staticmethod
    def signal(m: Any, occasion: Occasion, node: Any, x: float, y: float) -> float:
        """How strong a node finds the target, for the choice of a head after a search: here alike everywhere."""
        return 0.0

    @staticmethod
    def tells(m: Any, occasion: Occasion, node: Any, x: float, y: float, c: Any) -> bool:
        """Whether a node takes the target to be there: here, it detects it."""
        stream = stream_of(c.detection, occasion.key, occasion.period)
        return detects(c.detection, c.measurement, stream, node, x, y)

    @staticmethod
    def news(m: Any, memory: Memory, occasion: Occasion, node: Any, x: float, y: float, c: Any) -> tuple[Any, ...]:
        """What an awake node has to report of a target at (x, y).

        Args:
            memory: of the row's nodes; the node's own may change.

        Returns: whether it has anything, the two numbers of the value, how many packets long the report is.
        """
        if not tells(m, occasion, node, x, y, c):
            return False, 0.0, 0.0, 1.0
        stream = draws.stream(occasion.key, occasion.period, draws.MEASUREMENT)
        value, second = sample(m, stream, node, x, y)
        return True, value, second, 1.0

    @staticmethod
    def take_note(m: Any, memory: Memory, number: int, value: Any) -> None:
        """What the head keeps of a report that has come."""

    @staticmethod
    def finds_target(m: Any, memory: Memory, reports: int, head: int, members: np.ndarray) -> bool:
        """Whether anything was heard of the target: here, any report.

        Args:
            reports: their number.
            head, members: who is awake; head -1: nobody.
        """
        return reports > 0

    @staticmethod
    def log_miss(
        m: Any, mean: np.ndarray, cov: np.ndarray, positions: np.ndarray, head: int, members: np.ndarray, c: Any
    ) -> float:
        """Log of the probability that none of the awake nodes would have been heard, averaged over the belief.

        The average is Gauss and Hermite's with 3 x 3 points over the belief's position (exact to degree 5).

        Args:
            mean, cov: (4,), (4, 4) the belief about this period before its reports.
            positions: (S, 2).
            head, members: who is awake; head -1: nobody.
        """
        a = np.sqrt(max(cov[0, 0], 1e-12))
        b = cov[0, 2] / a
        d = np.sqrt(max(cov[2, 2] - b * b, 0.0))
        total = 0.0
        for i in range(-1, 2):
            for j in range(-1, 2):
                weight = (2.0 / 3.0 if i == 0 else 1.0 / 6.0) * (2.0 / 3.0 if j == 0 else 1.0 / 6.0)
                u, v = EXPECT_AT * i, EXPECT_AT * j
                x, y = mean[0] + a * u, mean[2] + b * u + d * v
                missed = 1.0
                for k in range(-1 if head >= 0 else 0, len(members)):
                    node = head if k < 0 else members[k]
                    dx, dy = positions[node, 0] - x, positions[node, 1] - y
                    seen = probability(c.detection, c.measurement, np.sqrt(dx * dx + dy * dy))
                    missed *= 1.0 - (c.radio.head_delivery if k < 0 else c.radio.delivery) * seen
                total += weight * missed
        return log(max(total, 1e-300))

    @staticmethod
    def chance(m: Any, node: Any, belief: PositionBelief, c: Any) -> float:
        """Probability that a node has something to report of a target that is believed to be there."""
        x, y, xx, xy, yy = belief
        return mean_probability(c.detection, c.measurement, x - node.x, y - node.y, xx, xy, yy)

    @staticmethod
    def packets_a_report(m: Any) -> float:
        """How many packets long a report is, on average."""
        return 1.0

    @staticmethod
    def weigh_period(m: Any, head: AtHead, c: Any, maps: np.ndarray, scratch: Any) -> None:
        """Weigh the particles with all that a head has heard in a period, in place.

        Args:
            maps, scratch: (S, nx, ny) dB and (P,) float32, for kinds that want them.
        """
        belief, network, reports, b = head
        x, log_weights = belief.particles[b], belief.log_weights[b]
        count, positions = reports.count[b], network.positions[b]
        for j in range(count):
            node, value = node_at(positions, reports.node[b, j]), reports.value[b, j]
            if c.tracking.pooled:  # every count-th particle from the j-th on
                weigh(m, x[0, j::count], x[2, j::count], log_weights[j::count], node, value)
            else:
                weigh(m, x[0], x[2], log_weights, node, value)

    @staticmethod
    def predict_reports(
        m: Any, belief: Any, positions: np.ndarray, b: int, c: Any, maps: np.ndarray, scratch: Any
    ) -> None:
        """Note what each node should report in the period to come; only kinds that learn their errors do."""


@lean_piece
def node_at(positions: np.ndarray, number: int) -> Any:
    """A node of a row's positions (S, 2) [m], of whose errors nothing has been learnt."""
    return Node(np.int64(number), positions[number, 0], positions[number, 1], Line(0.0, 0.0, 0.0, 0.0))


@lean_piece
def node_of(sensors: Sensors, number: int) -> Any:
    """A node of a row's Sensors, with what the tracker has learnt of it."""
    positions, learnt = sensors.positions, Line(0.0, 0.0, 0.0, 0.0)
    if len(sensors.receivers) > 0:
        own = sensors.receivers[number]
        learnt = Line(0.0, own.gradient[0], own.gradient[1], own.variance)
    return Node(np.int64(number), positions[number, 0], positions[number, 1], learnt)


@lean_piece
def at_point(x: float, y: float) -> PositionBelief:
    """A target that is known to be at (x, y)."""
    return PositionBelief(x, y, 0.0, 0.0, 0.0)


@by_kind
def sample(m: Any, stream: Any, node: Any, x: float, y: float) -> Any:
    """What a node measures of a target at (x, y), if it detects it: the two numbers of its value."""


@by_kind
def log_likelihood(m: Any, value: Any, second: Any, node: Any, x: float, y: float) -> Any:
    """Log density of a value that a node has reported, for a particle at (x, y) (float32)."""


@by_kind
def linearise(m: Any, node: Any, belief: PositionBelief) -> Any:
    """A `Line` for each number of the value, about a target that is believed to be there."""


@by_kind
def level(m: Any, squared: float) -> Any:
    """The mean level [dB] at a squared distance [m^2], for kinds that have one."""


@by_kind
def level_slope(m: Any, squared: float) -> Any:
    """Its derivative by the distance, over the distance [dB/m^2]; times (dx, dy), its gradient."""


@lean_piece
def value_information(m: Any, node: Any, x: float, y: float) -> tuple[float, float, float]:
    """H' R^-1 H of a report's value about a target at (x, y): its xx, xy and yy [1/m^2]."""
    xx, xy, yy = 0.0, 0.0, 0.0
    for line in linearise(m, node, at_point(x, y)):
        weight = 1.0 / line.variance
        xx += weight * line.slope_x * line.slope_x
        xy += weight * line.slope_x * line.slope_y
        yy += weight * line.slope_y * line.slope_y
    return xx, xy, yy


weigh: Any = by_kind(Measurement.weigh)
unwrap: Any = by_kind(Measurement.unwrap)
signal: Any = by_kind(Measurement.signal)
tells: Any = by_kind(Measurement.tells)
news: Any = by_kind(Measurement.news)
take_note: Any = by_kind(Measurement.take_note)
finds_target: Any = by_kind(Measurement.finds_target)
log_miss: Any = by_kind(Measurement.log_miss)
chance: Any = by_kind(Measurement.chance)
packets_a_report: Any = by_kind(Measurement.packets_a_report)
weigh_period: Any = by_kind(Measurement.weigh_period)
predict_reports: Any = by_kind(Measurement.predict_reports)
