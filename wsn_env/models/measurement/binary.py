"""One bit: whether a node detects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NamedTuple

import numpy as np

from wsn_env.compiled import draws
from wsn_env.compiled.elementary import F, exp, exp32, log32, normal_cdf
from wsn_env.compiled.kernels import lean_piece
from wsn_env.models.detection.base import detects, known_radius, stream_of
from wsn_env.models.measurement.base import (
    AtHead,
    Line,
    Measurement,
    Memory,
    Occasion,
    Order,
    PositionBelief,
    tells,
)
from wsn_env.models.quantity import ScenarioError, quantity

if TYPE_CHECKING:
    from wsn_env.scenario import Scenario

TWO_PI = 6.283185307179586


class Disc(NamedTuple):
    """Where a node detects."""

    x: float  # m
    y: float
    radius_m: float


@dataclass(frozen=True)
class Binary(Measurement):
    """One bit: whether the node detects (Zhou, Cheng & Xing, 2009); a hard disc where detection has no soft edge.

    A node compares with what it sensed last, however long ago, and reports the new state when it differs; before it has
    ever sensed, that is 0.
    """

    reports: Literal["changes", "presence"] = quantity(
        "changes",
        "changes: a state that differs from the last one sensed; presence: every 1, in every period",
        choices=("changes", "presence"),
    )
    refresh: int = quantity(
        0,
        "in every so many periods all awake nodes report their state; 0: never",
        at_least=0,
        at_most=10**9,
        whole=True,
    )
    flip: float = quantity(0.0, "probability that a node misreads its state in a period", at_least=0, below=0.5)
    edge_m: float = quantity(
        1.0, "width of the edge of detection that the particle filter believes in", at_least=1e-6, at_most=1e6
    )

    allocates: ClassVar[bool] = False
    reports_state: ClassVar[bool] = True
    order: ClassVar[Order] = "value"
    verb: ClassVar[str] = "detects"

    def check(self, scenario: Scenario) -> None:
        """A bitmap already tells who keeps silent."""
        if scenario.tracking.silent_information:
            raise ScenarioError(
                "Tracking.silent_information = True: allowed is False with Binary reports, whose bitmap already tells"
                " who keeps silent"
            )

    def ring_m(self, radius_m: float) -> float:
        """At the edge of detection."""
        return radius_m

    def constants(self, scenario: Scenario) -> dict[str, float]:
        """The settings, the disc, and how far the bitmap may be trusted."""
        return dict(
            every_presence=self.reports == "presence",
            refresh=self.refresh,
            flip=self.flip,
            edge_m=self.edge_m,
            radius_m=scenario.radius_m,
            ceiling=getattr(scenario.detection, "ceiling", 1.0),
            delivery=scenario.radio.delivery,
        )

    @staticmethod
    def sample(m: Any, stream: Any, node: Any, x: float, y: float) -> tuple[float, float]:
        """The bit is in `news`: it hangs on detection, and on what the node sensed before."""
        dx, dy = node.x - x, node.y - y
        return (1.0 if dx * dx + dy * dy <= m.radius_m * m.radius_m else 0.0), 0.0

    @staticmethod
    def tells(m: Any, occasion: Occasion, node: Any, x: float, y: float, c: Any) -> bool:
        """It detects, unless it misreads its one bit."""
        key, period = occasion.key, occasion.period
        misread = m.flip > 0.0 and draws.uniform(draws.stream(key, period, draws.MISREADING), node.number) < m.flip
        return detects(c.detection, m, stream_of(c.detection, key, period), node, x, y) != misread

    @staticmethod
    def news(m: Any, memory: Memory, occasion: Occasion, node: Any, x: float, y: float, c: Any) -> tuple[Any, ...]:
        """A node compares what it senses with what it sensed last.

        In a search everybody is asked, and silence means 0; so it does where every presence is reported.

        Returns: the value is the state, and 1 if it has changed.
        """
        state = tells(m, occasion, node, x, y, c)
        changed = state != (memory.sensed[node.number] != 0)
        memory.sensed[node.number] = state
        if m.every_presence or occasion.asked:
            memory.bitmap[node.number] = 0
            has_news = state
        else:
            has_news = changed or (m.refresh > 0 and occasion.clock % m.refresh == 0)
        return has_news, np.float64(state), np.float64(changed), 1.0

    @staticmethod
    def take_note(m: Any, memory: Memory, number: int, value: Any) -> None:
        """The state as last reported."""
        memory.bitmap[number] = value != 0.0

    @staticmethod
    def finds_target(m: Any, memory: Memory, reports: int, head: int, members: np.ndarray) -> bool:
        """States often stay: whether any node that is awake is known to detect."""
        found = head >= 0 and memory.bitmap[head] != 0
        for member in members:
            found |= memory.bitmap[member] != 0
        return found

    @staticmethod
    def linearise(m: Any, node: Any, belief: PositionBelief) -> tuple[Any, ...]:
        """One bit as a linear measurement along the way to the node: the noise leaves the same expected variance.

        A normal x of variance v that is only known to lie on one side of a threshold t sds from its mean keeps, on
        average, v (1 - phi(t)^2 / (Phi(t) Phi(-t))).
        """
        dx, dy = belief.x - node.x, belief.y - node.y
        distance = max(np.sqrt(dx * dx + dy * dy), 1e-9)
        h0, h1 = dx / distance, dy / distance
        along = max(h0 * h0 * belief.xx + 2.0 * h0 * h1 * belief.xy + h1 * h1 * belief.yy, 1e-12)
        blurred = along + m.edge_m * m.edge_m
        t = min(abs(m.radius_m - distance) / np.sqrt(blurred), 8.0)
        below = normal_cdf(-t)
        known = exp(-t * t) / (TWO_PI * below * (1.0 - below)) * along / blurred
        return (Line(distance, h0, h1, along * (1.0 - known) / max(known, 1e-12)),)

    @staticmethod
    def weigh(m: Any, px: np.ndarray, py: np.ndarray, log_weights: np.ndarray, node: Any, value: Any) -> None:
        """One reported state."""
        _weigh_state(px, py, log_weights, Disc(node.x, node.y, m.radius_m), value[0] != 0.0, m.flip, m)

    @staticmethod
    def weigh_period(m: Any, head: AtHead, c: Any, maps: np.ndarray, scratch: Any) -> None:
        """Add to every particle the log probability of the awake nodes' states as the bitmap has them: a silent node
        tells as much as one that has reported, but that a report of its own may have been lost.

        Nodes whose edge is far from every particle tell all of them the same and are left out.
        """
        belief, network, reports, b = head
        x, log_weights = belief.particles[b], belief.log_weights[b]
        positions, battery, standing = network.positions[b], network.battery[b], network.row[b]
        nodes, bitmap = reports.node[b, : reports.count[b]], reports.bitmap[b]
        if standing.head < 0:
            return
        box = _bounds(x[0]), _bounds(x[2])
        far = 16.0 * m.edge_m
        for k in range(-1, standing.n_members):
            number = standing.head if k < 0 else network.members[b, k]
            nearest, farthest = _reach(positions[number], box)
            radius = known_radius(c.detection, number)
            if battery[number] > 0.0 and nearest < radius + far and farthest > radius - far:
                wrong = max(m.flip, 1.0 - m.delivery)
                for other in nodes:
                    wrong = m.flip if other == number else wrong
                disc = Disc(positions[number, 0], positions[number, 1], radius)
                _weigh_state(x[0], x[2], log_weights, disc, bitmap[number] != 0, wrong, m)


@lean_piece
def _bounds(values):
    low, high = values[0], values[0]
    for value in values:
        low, high = min(low, value), max(high, value)
    return np.float64(low), np.float64(high)


@lean_piece
def _reach(position, box):
    """Distances of the nearest and the farthest point of a box [m]."""
    nearest, farthest = 0.0, 0.0
    for axis in range(2):
        below, above = box[axis][0] - position[axis], position[axis] - box[axis][1]
        nearest += max(below, above, 0.0) ** 2
        farthest += max(abs(below), abs(above)) ** 2
    return np.sqrt(nearest), np.sqrt(farthest)


@lean_piece
def _weigh_state(px, py, log_weights, disc, detects, wrong, m):
    """Add to every particle the log probability of the state of a binary sensor.

    P(1) = f + (1 - 2 f) l2 / (1 + exp((d - R) / s)), s the softness of the edge and l2 the ceiling of detection.

    Args:
        wrong: f, the probability that the bitmap is wrong: by a misreading, or by a change whose report was lost.
    """
    sx, sy = F(disc.x), F(disc.y)
    wrong = min(max(wrong, 1e-6), 0.5)  # no state rules a particle out
    rest = F((1.0 - 2.0 * wrong) * m.ceiling)
    least = F(wrong if detects else wrong + (1.0 - 2.0 * wrong) * (1.0 - m.ceiling))
    slope = F((-1.0 if detects else 1.0) / m.edge_m)
    radius = F(disc.radius_m)
    for i in range(len(px)):
        dx = px[i] - sx
        dy = py[i] - sy
        y = slope * (radius - np.sqrt(dx * dx + dy * dy))
        log_weights[i] += log32(least + rest / (F(1) + exp32(min(y, F(80)))))
