"""What a fault has to say: what is wrong with nodes in an episode, or with the target's way.

All that a faulty sensor does is sense something else: a target moved, one that is not there, one that is far away. So a
fault writes down, at an episode's start, what is wrong with each node (CONDITION); the world acts on that in one place,
`simulation/faults.py`, whatever the nodes measure, and never asks which fault it was.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from wsn_env.compiled import draws
from wsn_env.compiled.arrays import record
from wsn_env.compiled.kernels import lean_piece
from wsn_env.models.kinds import Kind, by_kind
from wsn_env.models.quantity import ScenarioError

if TYPE_CHECKING:
    from wsn_env.scenario import Scenario

CONDITION = record(
    [
        ("fails_at", "i8"),  # period from which on the node is dead; 0: it does not fail
        ("stuck_at", "i8"),  # period from which on it senses what it senses then; 0: none
        ("stuck_x", "f8"),  # a target there [m]
        ("stuck_y", "f8"),
        ("off_x", "f8"),  # how far off the target is that it senses [m]
        ("off_y", "f8"),
        ("misses", "f8"),  # probability of sensing no target in a period
        ("false_alarms", "f8"),  # probability of sensing one that is not there, where it senses none
        ("late", "f8"),  # probability that a report is sent a period late
        ("to_bad", "f8"),  # probability, in a period, that its good link turns bad; 0: it does not
        ("to_good", "f8"),  # that the bad one turns good
        ("bad_success", "f8"),  # probability that one try of a report arrives over a bad link
        ("bad", "i8"),  # 1: the link is bad
        ("until", "i8"),  # the period before which it does not turn
        ("turns", "i8"),  # how often it has turned
        ("waiting", "i8"),  # period in which the report that waits was made; 0: none
        ("value", "f8", 2),  # its value
        ("packets", "f8"),  # how long it is
    ]
)


OF_SCENARIO = ("periods", "period_s", "radius_m", "side_m", "depth_m")  # constants that every fault has


@dataclass(frozen=True)
class Fault(Kind):
    """Base of all faults; several of them may befall an episode.

    A kind has one of

        strike(f, stream, positions, condition)
            Write into `condition` (S,) CONDITION what is wrong with the nodes at `positions` (S, 2) [m]. It holds what
            the faults before have done.
        change_track(f, stream, track)
            Change the target's true states `track` (periods + 1, 4), (x, vx, y, vy) [m, m/s].

    Random numbers are draws of `stream`, of the fault's own for the episode, by their numbers; `f` holds the kind's
    constants: its settings, periods, period_s, the sensing radius radius_m, and the field's sides side_m and depth_m.
    """

    abstract: ClassVar[bool] = True
    role: ClassVar[str] = "fault"
    required: ClassVar[tuple[str, ...]] = ()
    optional: ClassVar[tuple[str, ...]] = ("strike", "change_track")
    allocates: ClassVar[bool] = False

    of_sensing: ClassVar[bool] = False  # whether nodes sense another target than the true one

    def check_functions(self) -> None:
        """Raise ScenarioError unless the kind does anything."""
        if not (self.strikes or self.changes_tracks):
            raise ScenarioError(f"{type(self).__name__} has no strike(...): a fault must have it, or change_track")
        if taken := sorted({item.name for item in fields(self)} & set(OF_SCENARIO)):
            raise ScenarioError(f"{type(self).__name__}.{taken[0]}: is the scenario's; must have another name")

    @property
    def strikes(self) -> bool:
        """Whether something is wrong with nodes."""
        return type(self).strike is not Fault.strike

    @property
    def changes_tracks(self) -> bool:
        """Whether the target goes another way."""
        return type(self).change_track is not Fault.change_track

    def check(self, scenario: Scenario) -> None:
        """Raise ScenarioError where it does not fit the rest of the scenario."""
        packets = scenario.measurement.lasting_errors and (
            self.of_sensing or (self.changes_tracks and scenario.motion.horizon(scenario.period_s) is not None)
        )
        if packets:
            kind = type(scenario.measurement).__name__
            raise ScenarioError(
                f"Scenario.faults = {self}: what a {kind} hears is drawn or recorded before the episode; allowed are"
                " faults of nodes, links and reports"
            )

    def constants(self, scenario: Scenario) -> dict[str, float]:
        """The settings; times and distances of the scenario."""
        numbers = scenario.periods, scenario.period_s, scenario.radius_m, *scenario.field.room_m
        return super().constants(scenario) | dict(zip(OF_SCENARIO, numbers))

    @staticmethod
    def strike(f: Any, stream: Any, positions: np.ndarray, condition: np.ndarray) -> None:
        """Nothing is wrong with nodes."""

    @staticmethod
    def change_track(f: Any, stream: Any, track: np.ndarray) -> None:
        """The target goes its way."""


strike: Any = by_kind(Fault.strike)
change_track: Any = by_kind(Fault.change_track)


@lean_piece
def either(one: float, other: float) -> float:
    """Probability of one or the other of two independent things."""
    return 1.0 - (1.0 - one) * (1.0 - other)


@lean_piece
def fail_at(node: Any, period: int) -> None:
    """A node (CONDITION) fails in a period, unless it has failed before."""
    if node.fails_at == 0 or period < node.fails_at:
        node.fails_at = period


@lean_piece
def draw_period(stream: Any, index: int, periods: int) -> Any:
    """One of an episode's periods, 1 to `periods`."""
    return 1 + np.int64(periods * draws.uniform(stream, index))


@lean_piece
def delay(track: np.ndarray, first: int, by: int) -> None:
    """What was to be at an instant and after comes so many periods later.

    The states from `first` to `first + by - 1` are left for the caller to fill.
    """
    for k in range(len(track) - 1, first + by - 1, -1):
        for axis in range(4):
            track[k, axis] = track[k - by, axis]
