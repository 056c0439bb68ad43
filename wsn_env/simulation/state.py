"""The values that flow through the house, batch-first: B rows, S nodes, P particles.

They are NamedTuples of arrays, so that compiled kernels take them as they are. Handing one over costs by the number
of arrays, so all that is a number or a small matrix a row shares one structured array, `row` (B,). Its fields read as
attributes: `belief.mean` is `belief.row["mean"]`, (B, 4); kernels write `belief.row[b].mean`.

Nested tuples cost five times as much as their arrays one after the other. The two kernels that run in every period take
them so, as `arrays()` gives them, and put them together again inside with `state_of` and `network_of`.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from wsn_env.compiled.kernels import spliced


def _of_row(self, name: str) -> np.ndarray:
    if name in self.row.dtype.names:
        return self.row[name]
    raise AttributeError(f"{type(self).__name__!r} has no attribute {name!r}")


BELIEF = np.dtype(
    [
        ("mean", "f8", 4),  # x, vx, y, vy in m and m/s, after the period's correction
        ("cov", "f8", (4, 4)),
        ("predicted_mean", "f8", 4),  # for the period to come
        ("predicted_cov", "f8", (4, 4)),
        ("n_eff", "f8"),  # effective sample size before resampling; 0 for trackers without particles
    ],
    align=True,
)


RECEIVER = np.dtype(
    [
        ("at_1m_db", "f8"),  # its mean level: at_1m_db - slope ln(d^2 + height_m2)
        ("slope", "f8"),
        ("height_m2", "f8"),
        ("bias_variance", "f8"),  # of its level about the mean, beside the packets' own noise, alike for all particles
        ("latest_db", "f8"),  # last heard; SILENT_DB if it has listened since in vain; 0 before it ever has
        ("gradient", "f8", 2),  # of the level to come by position, over the predicted belief [dB/m]
        ("variance", "f8"),  # of what it should report, about that [dB^2]
    ],
    align=True,
)
SILENT_DB = -95.0


class Belief(NamedTuple):
    """What the head believes about the target."""

    row: np.ndarray  # (B,) BELIEF
    particles: np.ndarray  # (B, 4, P) float32; P = 0 for trackers without
    log_weights: np.ndarray  # (B, P) float32, at most 0
    receivers: np.ndarray  # (B, S) RECEIVER: what is believed of each receiver of a beacon; else (B, 0)
    biases: np.ndarray  # (B, S, P) float32 dB: the mean of each receiver's bias if a particle is right; else (B, 0, P)

    __getattr__ = _of_row


class Reports(NamedTuple):
    """What the head received in the last period; the first `count` entries of a row are valid."""

    count: np.ndarray  # (B,)
    node: np.ndarray  # (B, S) int32
    value: np.ndarray  # (B, S, 2): x, y [m]; or the strength and 0; or the state, 1 or 0, and 1 if it has changed;
    # or the mean level of a beacon's packets and how many they are
    bitmap: np.ndarray  # (B, S) int8: the state of each binary sensor as last reported; (B, 0) for other sensors


GRID = np.dtype([("x_m", "f8"), ("y_m", "f8"), ("cell_m", "f8"), ("side", "i8")], align=True)


class Grid(NamedTuple):
    """The nodes by square cells, side x side of them, so that near ones are found without looking at all."""

    row: np.ndarray  # (B,) GRID: lower left corner, width of a cell, cells a side
    nodes: np.ndarray  # (B, S) int32, cell by cell
    starts: np.ndarray  # (B, side^2 + 1) int32: where in `nodes` each cell begins

    NODES_A_CELL = 4

    @classmethod
    def zeros(cls, rows: int, nodes: int) -> Grid:
        """Of the right shapes, before `physics.field.index_nodes`."""
        side = max(1, int((nodes / cls.NODES_A_CELL) ** 0.5))
        row = np.zeros(rows, GRID)
        row["side"] = side
        return cls(row, np.zeros((rows, nodes), np.int32), np.zeros((rows, side * side + 1), np.int32))


NETWORK = np.dtype(
    [
        ("alive", "i8"),  # living nodes
        ("head", "i8"),  # -1: none
        ("n_members", "i8"),
    ],
    align=True,
)


class Sensors(NamedTuple):
    """A row's nodes, for what is expected of them."""

    positions: np.ndarray  # (S, 2) m
    receivers: np.ndarray  # (S,) RECEIVER; else (0,)


class Network(NamedTuple):
    """Nodes, batteries and the standing cluster."""

    row: np.ndarray  # (B,) NETWORK
    positions: np.ndarray  # (B, S, 2) m, fixed for an episode
    battery: np.ndarray  # (B, S) J; a node is alive while it has any
    members: np.ndarray  # (B, S) int32: the first n_members ascending, without the head
    grid: Grid

    __getattr__ = _of_row

    def arrays(self) -> tuple[np.ndarray, ...]:
        """One after the other."""
        return *self[:4], *self.grid


@spliced
def network_of(arrays):
    """The network whose `arrays()` they are."""
    return Network(arrays[0], arrays[1], arrays[2], arrays[3], Grid(*arrays[4:7]))


class Ledger(NamedTuple):
    """Who paid in the last period."""

    count: np.ndarray  # (B,) how many nodes did
    payer: np.ndarray  # (B, S) int32: the first `count`
    spent_j: np.ndarray  # (B, S) J by node: exactly what the batteries lost


STATE = np.dtype(
    [
        ("period", "i8"),  # periods done
        ("lam", "f8"),  # m/mJ
        ("log_miss", "f8"),  # log probability of having missed the target ever since the last report
        ("last_search", "i8"),  # period of the last search
        ("luck", "u4"),  # a random number of the period, for policies that want one
    ],
    align=True,
)


class State(NamedTuple):
    """A whole world: copy it, store it, step it again. Nothing is hidden elsewhere."""

    key: np.ndarray  # (B,) uint64: all randomness of the episode
    track: np.ndarray  # (B, periods + 1, 4): the target's true states, drawn at the start
    packets: (
        np.ndarray
    )  # (B, periods + 1, S, 2) float32: mean level and number of a beacon's packets in reach, drawn or
    # recorded before the start; else (B, periods + 1, 0, 2)
    sensed: np.ndarray  # (B, S) int8: what each binary sensor sensed last, known to itself alone; else (B, 0)
    row: np.ndarray  # (B,) STATE: what the network knows beside the following
    network: Network
    ledger: Ledger
    reports: Reports
    belief: Belief

    __getattr__ = _of_row

    @property
    def rows(self) -> int:
        """B."""
        return len(self.key)

    @classmethod
    def zeros(
        cls, rows: int, nodes: int, periods: int, particles: int, binary: bool = False, hears: bool = False
    ) -> State:
        """Of the right shapes, before an episode begins."""
        states = nodes if binary else 0
        receivers = nodes if hears else 0
        return cls(
            key=np.zeros(rows, np.uint64),
            track=np.zeros((rows, periods + 1, 4)),
            packets=np.zeros((rows, periods + 1, receivers, 2), np.float32),
            sensed=np.zeros((rows, states), np.int8),
            row=np.zeros(rows, STATE),
            network=Network(
                row=np.zeros(rows, NETWORK),
                positions=np.zeros((rows, nodes, 2)),
                battery=np.zeros((rows, nodes)),
                members=np.zeros((rows, nodes), np.int32),
                grid=Grid.zeros(rows, nodes),
            ),
            ledger=Ledger(np.zeros(rows, np.int64), np.zeros((rows, nodes), np.int32), np.zeros((rows, nodes))),
            reports=Reports(
                count=np.zeros(rows, np.int64),
                node=np.zeros((rows, nodes), np.int32),
                value=np.zeros((rows, nodes, 2)),
                bitmap=np.zeros((rows, states), np.int8),
            ),
            belief=Belief(
                row=np.zeros(rows, BELIEF),
                particles=np.zeros((rows, 4, particles), np.float32),
                log_weights=np.zeros((rows, particles), np.float32),
                receivers=np.zeros((rows, receivers), RECEIVER),
                biases=np.zeros((rows, receivers, particles), np.float32),
            ),
        )

    def copy(self) -> State:
        """A deep copy: no array is shared."""
        return _each(np.copy, self)

    def only(self, row: int) -> State:
        """A batch of this row alone; it shares its arrays."""
        return _each(lambda array: array[row : row + 1], self)

    def arrays(self) -> tuple[np.ndarray, ...]:
        """One after the other."""
        return (
            self.key,
            self.track,
            self.packets,
            self.sensed,
            self.row,
            *self.network.arrays(),
            *self.ledger,
            *self.reports,
            *self.belief,
        )


@spliced
def state_of(arrays):
    """The state whose `arrays()` they are."""
    network, ledger, reports, belief = arrays[5:12], arrays[12:15], arrays[15:19], arrays[19:24]
    return State(
        arrays[0],
        arrays[1],
        arrays[2],
        arrays[3],
        arrays[4],
        network_of(network),
        Ledger(*ledger),
        Reports(*reports),
        Belief(*belief),
    )


def _each(change, value):
    """A nest of tuples with every array changed."""
    return type(value)(*(_each(change, part) for part in value)) if isinstance(value, tuple) else change(value)


KEEP_HEAD, KEEP_CLUSTER, NOBODY = -1, -2, -3


class Cluster(NamedTuple):
    """A choice: a head and its members."""

    head: (
        np.ndarray
    )  # (B,) node; KEEP_HEAD; KEEP_CLUSTER: head and members stay as they are; or NOBODY: all sleep, which
    # only a sink or the target can afford: a head would have to keep the belief
    members: np.ndarray  # (B, M) nodes, -1: no entry; the head may be among them, it always senses

    @classmethod
    def of(cls, head, chosen) -> Cluster:
        """From masks.

        Args:
            head: (B,) node.
            chosen: (B, S) bool, the members.
        """
        chosen = np.asarray(chosen, dtype=bool)
        width = int(chosen.sum(axis=1).max(initial=0))
        members = np.full((len(chosen), width), -1, dtype=np.int32)
        rows, nodes = np.nonzero(chosen)
        slots = np.cumsum(chosen, axis=1)[rows, nodes] - 1
        members[rows, slots] = nodes
        return cls(np.asarray(head, dtype=np.int64), members)


PURPOSES = ("sensing", "handover", "invitation", "report", "broadcast", "search")

OUTCOME = np.dtype(
    [
        ("error_m", "f8"),  # distance between the estimate and the target after the correction
        ("energy_mj", "f8"),
        ("energy_j", "f8", len(PURPOSES)),  # by purpose
        ("members", "i8"),  # awake nodes, head included; all that woke in a search
        ("detections", "i8"),  # awake nodes that detected; of binary sensors, those that had a state to report
        ("delivered", "i8"),  # reports the head had, its own included
        ("dropped", "i8"),  # chosen nodes that were dead, named twice, unknown, or beyond one hop of the head
        ("handover", "?"),  # the head's role went to another node
        ("searched", "?"),
        ("resampled", "?"),
        ("n_eff", "f8"),
        ("posterior_rms_m", "f8"),  # sqrt(trace of the belief's position covariance)
        ("believed_error_m", "f8"),  # the error that the belief expects
        ("alive", "i8"),  # living nodes after the period
        ("target_m", "f8", 2),  # the truth
        ("estimate_m", "f8", 2),
    ],
    align=True,
)


class Outcome(NamedTuple):
    """What a period brought and cost; for rewards and loggers, never for policies."""

    row: np.ndarray  # (B,) OUTCOME
    spent_j: np.ndarray  # (B, S) by node: the ledger's of the state after the period, not a copy

    __getattr__ = _of_row


class Tracker(Protocol):
    """Turns the reports of a period into a belief. Sees nothing of the truth."""

    particles: int  # P of its beliefs

    def start(self, keys, periods, rows, belief: Belief) -> None:
        """Spread the beliefs of the rows marked in `rows` (B,) about their mean and cov, in place."""

    def relocate(self, keys, periods, rows, belief: Belief) -> None:
        """After a search has set the position's mean and cov of the marked rows: move there, keep the velocity."""

    def correct(self, keys, periods, belief: Belief, network: Network, reports: Reports, resampled) -> None:
        """Predict from the period before and correct with the reports, in place.

        Sets mean, cov and n_eff; `resampled` (B,) tells where the head had to broadcast.
        """
