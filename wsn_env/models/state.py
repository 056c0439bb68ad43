"""The values that flow, batch-first: B environments, S nodes, P particles.

They are records of arrays (`compiled.arrays`), which kernels take whole. All that is a number or a small matrix an
environment shares one structured array, `row` (B,). Its fields read as attributes: `belief.mean` is
`belief.row["mean"]`, (B, 4); kernels write `belief.row[b].mean`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from wsn_env.compiled.arrays import Arrays, array, opener, part, record
from wsn_env.compiled.kernels import inline_piece
from wsn_env.models.fault.base import CONDITION
from wsn_env.models.measurement.beacon_levels import RECEIVER
from wsn_env.models.motion.modes import COUNT
from wsn_env.models.quantity import short

BELIEF = record(
    [
        ("mean", "f8", 4),  # x, vx, y, vy in m and m/s, after the period's correction
        ("cov", "f8", (4, 4)),
        ("predicted_mean", "f8", 4),  # for the period to come
        ("predicted_cov", "f8", (4, 4)),
        ("n_eff", "f8"),  # effective sample size before resampling; 0 for trackers without particles
        ("surprise", "f8"),  # how far reports have moved the estimate of late, over what was expected: about 1
        ("mode_probabilities", "f8", COUNT),  # of the modes in which the target goes on; for filters without LONG_RUN
    ]
)

GRID = record([("x_m", "f8"), ("y_m", "f8"), ("cell_m", "f8"), ("side", "i8")])

NETWORK = record(
    [
        ("alive", "i8"),  # nodes taken for alive
        ("left_j", "f8"),  # sum of their batteries
        ("head", "i8"),  # -1: none
        ("n_members", "i8"),
    ]
)

STATE = record(
    [
        ("period", "i8"),  # periods done
        ("lam", "f8"),  # m/mJ
        ("full_j", "f8"),  # a full battery: a node's energy at the start
        ("log_miss", "f8"),  # log probability of having missed the target ever since the last report
        ("last_search", "i8"),  # period of the last search
        ("targets", "i8"),  # of its field, whose rows stand one after the other
        ("random_bits", "u4"),  # a random 32-bit number of the period, for policies that want one
    ]
)


LIFE = record(
    [
        ("first_death", "i8"),  # period in which a node had died for the first time; 0: not yet
        ("half_dead", "i8"),  # in which half of them had
        ("functional", "i8"),  # in which the mean error of the last WINDOW periods exceeded a sensing radius
        ("tracked", "i8"),  # periods whose error was at most a sensing radius
        ("window_m", "f8"),  # sum of the last WINDOW periods' errors, as they count
    ]
)
WINDOW = 50


@dataclass(frozen=True, eq=False)
class Grid(Arrays):
    """The nodes by square cells, side x side of them, so that near ones are found without looking at all."""

    row: np.ndarray = array(GRID, "rows")  # lower left corner, width of a cell, cells a side
    nodes: np.ndarray = array(np.int32, "rows", "nodes")  # cell by cell
    starts: np.ndarray = array(np.int32, "rows", "cells")  # side^2 + 1: where in `nodes` each cell begins

    NODES_A_CELL = 4

    @classmethod
    def side(cls, nodes: int) -> int:
        """How many cells a side suit so many nodes."""
        return max(1, int((nodes / cls.NODES_A_CELL) ** 0.5))


@dataclass(frozen=True, eq=False)
class Network(Arrays):
    """Nodes, batteries and the standing cluster."""

    row: np.ndarray = array(NETWORK, "rows")
    positions: np.ndarray = array(float, "rows", "nodes", 2)  # m, fixed for an episode
    battery: np.ndarray = array(
        float, "rows", "nodes"
    )  # J left as the network knows it: as last reported, less what it
    # has seen spent since; a node is taken for alive while it has any
    members: np.ndarray = array(np.int32, "rows", "nodes")  # the first n_members ascending, without the head
    grid: Grid = part(Grid)


@dataclass(frozen=True, eq=False)
class Reports(Arrays):
    """What the head received in the last period; the first `count` entries of a row are valid.

    A node has one entry where reports name their target, else one for each of its measurements, by their first number.
    """

    count: np.ndarray = array(np.int64, "rows")
    node: np.ndarray = array(np.int32, "rows", "reports")
    value: np.ndarray = array(float, "rows", "reports", 2)  # the two numbers of the measurement's value: x, y [m]; a
    # strength and 0; a state, 1 or 0, and 1 if it has changed; the mean level of packets and how many they are
    share: np.ndarray = array(float, "rows", "unnamed")  # probability that it is of the row's target; (B, 0) where it
    # says of which it is
    bitmap: np.ndarray = array(np.int8, "rows", "states")  # each node's state as last reported; (B, 0) without states


@dataclass(frozen=True, eq=False)
class Belief(Arrays):
    """What the head believes about the target."""

    row: np.ndarray = array(BELIEF, "rows")
    receivers: np.ndarray = array(RECEIVER, "rows", "receivers")  # (B, 0) if errors do not last
    particles: np.ndarray = array(np.float32, "rows", 4, "particles")  # P = 0 for trackers without
    log_weights: np.ndarray = array(np.float32, "rows", "particles")  # at most 0
    modes: np.ndarray = array(np.int8, "rows", "switching")  # each particle's; (B, 0) for filters without
    biases: np.ndarray = array(np.float32, "rows", "receivers", "particles")  # dB: mean of each receiver's bias if a
    # particle is right


@dataclass(frozen=True, eq=False)
class Ledger(Arrays):
    """The nodes charged in the last period."""

    count: np.ndarray = array(np.int64, "rows")  # how many they are
    charged: np.ndarray = array(np.int32, "rows", "nodes")  # the first `count`
    spent_j: np.ndarray = array(float, "rows", "nodes")  # J by node: exactly what the batteries lost


@dataclass(frozen=True, eq=False)
class Knowledge(Arrays):
    """What the network knows, as policies may see it."""

    row: np.ndarray = array(STATE, "rows")
    network: Network = part(Network)
    reports: Reports = part(Reports)
    belief: np.ndarray = array(BELIEF, "rows")
    receivers: np.ndarray = array(RECEIVER, "rows", "receivers")


@dataclass(frozen=True, eq=False)
class State(Arrays):
    """A whole world: copy it, store it, step it again. Nothing is hidden elsewhere."""

    key: np.ndarray = array(np.uint64, "rows")  # all randomness of the episode
    track: np.ndarray = array(float, "rows", "instants", 4)  # periods + 1 true states of the target, drawn at the start
    packets: np.ndarray = array(np.float32, "rows", "instants", "receivers", 2)  # mean level and number of the packets
    # in reach, drawn or recorded before the start, where the measurement has such
    sensed: np.ndarray = array(np.int8, "rows", "states")  # what each node sensed last, known to itself alone
    residual_j: np.ndarray = array(float, "rows", "nodes")  # energy left in each node: it is alive while it has any
    living: np.ndarray = array(np.int64, "rows")  # how many are
    condition: np.ndarray = array(CONDITION, "rows", "faulty")  # what is wrong with each node; (B, 0) without faults
    life: np.ndarray = array(LIFE, "rows")  # how the episode has gone so far
    recent_m: np.ndarray = array(float, "rows", WINDOW)  # errors of the last periods, as they count
    ledger: Ledger = part(Ledger)
    row: np.ndarray = array(STATE, "rows")  # what the network knows beside the following
    network: Network = part(Network)
    reports: Reports = part(Reports)
    belief: Belief = part(Belief)

    @property
    def rows(self) -> int:
        """B."""
        return len(self.key)

    def only(self, row: int) -> State:
        """A batch of this environment alone; it shares its arrays."""
        return self.map(lambda array: array[row : row + 1])

    @cached_property
    def knowledge(self) -> Knowledge:
        """What the network knows of it; shares its arrays."""
        return Knowledge(self.row, self.network, self.reports, self.belief.row, self.belief.receivers)


state_at: Any = opener(State)
knowledge_at: Any = opener(Knowledge)
network_at: Any = opener(Network)
belief_at: Any = opener(Belief)
reports_at: Any = opener(Reports)


class Sensors(NamedTuple):
    """A row's nodes, for what is expected of them."""

    positions: np.ndarray  # (S, 2) m
    receivers: np.ndarray  # (S,) RECEIVER; else (0,)


@inline_piece
def sensors_of(known: Any, b: int) -> Sensors:
    """The nodes of row b of what the network knows (Knowledge)."""
    return Sensors(known.network.positions[b], known.receivers[b])


KEEP_HEAD, KEEP_CLUSTER, NOBODY = -1, -2, -3


class Cluster(NamedTuple):
    """A choice: a head and its members."""

    head: np.ndarray  # (B,) node; KEEP_HEAD; KEEP_CLUSTER: head and members stay as they are; or NOBODY: all sleep,
    # which only a sink or the target can afford: a head would have to keep the belief
    members: np.ndarray  # (B, M) nodes, -1: no entry; the head may be among them, it always senses

    @classmethod
    def of(cls, head: npt.ArrayLike, chosen: npt.ArrayLike) -> Cluster:
        """From masks.

        Args:
            head: (B,) node.
            chosen: (B, S) bool, the members.
        """
        chosen = np.asarray(chosen)
        if chosen.ndim != 2 or (chosen.dtype != bool and not np.isin(chosen, (0, 1)).all()):
            raise ValueError(
                f"Cluster.of: chosen = {short(repr(chosen))}: must be a mask (B, S) of bool, not node numbers"
            )
        chosen = chosen.astype(bool)
        width = int(chosen.sum(axis=1).max(initial=0))
        members = np.full((len(chosen), width), -1, dtype=np.int32)
        rows, nodes = np.nonzero(chosen)
        slots = np.cumsum(chosen, axis=1)[rows, nodes] - 1
        members[rows, slots] = nodes
        return cls(whole_nodes("head", head).astype(np.int64), members)

    def check(self, rows: int) -> tuple[np.ndarray, np.ndarray]:
        """Head and members as arrays of integers.

        Args:
            rows: B.

        Raises:
            ValueError: what is no whole number, or not one row for each environment.
        """
        head, members = whole_nodes("head", self.head), whole_nodes("members", self.members)
        if head.shape != (rows,) or members.ndim != 2 or len(members) != rows:
            raise ValueError(
                f"cluster has head {head.shape}, members {members.shape}: must be ({rows},), ({rows}, M), a row for"
                " each environment"
            )
        return head, members


def whole_nodes(name: str, values: Any) -> np.ndarray:
    """Node numbers as an array of integers of any width; floats must be whole.

    Raises:
        ValueError: for anything else: fractions, NaN, masks, words, lists of unequal lengths.
    """
    if type(values) is np.ndarray and values.dtype.kind in "iu":
        return values
    try:
        array = np.asarray(values)
    except ValueError:  # unequal lengths
        array = np.empty(0, object)
    if array.dtype.kind in "iu":
        return array
    if array.dtype.kind == "f" and (np.abs(array) < 2**53).all() and (array == np.trunc(array)).all():
        return array.astype(np.int64)
    raise ValueError(f"cluster.{name} = {short(repr(values))}: must be whole node numbers, an array of integers")


PURPOSES = ("sensing", "handover", "invitation", "report", "broadcast", "search")

OUTCOME = record(
    [
        ("error_m", "f8"),  # distance between the estimate and the target after the correction
        ("energy_mj", "f8"),
        ("members", "i8"),  # awake nodes, head included; all that woke in a search
        ("detections", "i8"),  # awake nodes that detected; of binary sensors, those that had a state to report
        ("delivered", "i8"),  # reports the head had, its own included
        ("dropped", "i8"),  # chosen nodes that were dead, named twice, unknown, or beyond one hop of the head
        ("handover", "?"),  # the head's role went to another node
        ("searched", "?"),
        ("n_eff", "f8"),
        ("posterior_rms_m", "f8"),  # sqrt(trace of the belief's position covariance)
        ("believed_error_m", "f8"),  # the error that the belief expects
        ("alive", "i8"),  # living nodes after the period
        ("target_m", "f8", 2),  # the truth
        ("estimate_m", "f8", 2),
        # An environment's info ends here.
        ("energy_j", "f8", len(PURPOSES)),  # by purpose
        ("resampled", "?"),
    ]
)


@dataclass(frozen=True, eq=False)
class Outcome(Arrays):
    """What a period brought and cost; for rewards and loggers, never for policies."""

    row: np.ndarray = array(OUTCOME, "rows")
    spent_j: np.ndarray = array(float, "rows", "nodes")  # by node: the ledger's of the state after it, not a copy


class Tracker(Protocol):
    """Turns the reports of a period into a belief. Sees nothing of the truth."""

    particles: int  # P of its beliefs

    def start(self, keys: np.ndarray, periods: np.ndarray, rows: np.ndarray, belief: Belief) -> None:
        """Spread the beliefs of the rows marked in `rows` (B,) about their mean and cov, in place."""

    def relocate(self, keys: np.ndarray, periods: np.ndarray, rows: np.ndarray, belief: Belief) -> None:
        """After a search has set the position's mean and cov of the marked rows: move there, keep the velocity."""

    def correct(
        self,
        keys: np.ndarray,
        periods: np.ndarray,
        belief: Belief,
        network: Network,
        reports: Reports,
        resampled: np.ndarray,
    ) -> None:
        """Predict from the period before and correct with the reports, in place.

        Sets mean, cov and n_eff; `resampled` (B,) tells where the head had to broadcast.
        """
