"""The values that flow through the house, batch-first: B rows, S nodes, P particles.

They are NamedTuples of arrays, so that compiled kernels take them as they are.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np


class Belief(NamedTuple):
    """What the head believes about the target: state (x, vx, y, vy) in m and m/s."""

    mean: np.ndarray  # (B, 4) after the period's correction
    cov: np.ndarray  # (B, 4, 4)
    predicted_mean: np.ndarray  # (B, 4) for the period to come
    predicted_cov: np.ndarray  # (B, 4, 4)
    n_eff: np.ndarray  # (B,) effective sample size before resampling; 0 for trackers without particles
    particles: np.ndarray  # (B, 4, P) float32; P = 0 for trackers without
    log_weights: np.ndarray  # (B, P) float32, at most 0


class Reports(NamedTuple):
    """What the head received in the last period; the first `count` entries of a row are valid."""

    count: np.ndarray  # (B,)
    node: np.ndarray  # (B, S) int32
    value: np.ndarray  # (B, S, 2): x, y [m]; or the strength and 0


class Network(NamedTuple):
    """Nodes, batteries and the standing cluster."""

    positions: np.ndarray  # (B, S, 2) m, fixed for an episode
    battery: np.ndarray  # (B, S) J; a node is alive while it has any
    alive: np.ndarray  # (B,) living nodes
    head: np.ndarray  # (B,) int64, -1: none
    members: np.ndarray  # (B, S) int32: the first n_members ascending, without the head
    n_members: np.ndarray  # (B,)


class State(NamedTuple):
    """A whole world: copy it, store it, step it again. Nothing is hidden elsewhere."""

    key: np.ndarray  # (B,) uint64: all randomness of the episode
    period: np.ndarray  # (B,) periods done
    lam: np.ndarray  # (B,) m/mJ
    track: np.ndarray  # (B, periods + 1, 4): the target's true states, drawn at the start
    log_miss: np.ndarray  # (B,) log probability of having missed the target ever since the last report
    last_search: np.ndarray  # (B,) period of the last search
    luck: np.ndarray  # (B,) uint32: a random number of the period, for policies that want one
    network: Network
    reports: Reports
    belief: Belief

    @property
    def rows(self) -> int:
        """B."""
        return len(self.key)

    @classmethod
    def zeros(cls, rows: int, nodes: int, periods: int, particles: int) -> State:
        """Of the right shapes, before an episode begins."""
        network = Network(
            positions=np.zeros((rows, nodes, 2)),
            battery=np.zeros((rows, nodes)),
            alive=np.zeros(rows, np.int64),
            head=np.zeros(rows, np.int64),
            members=np.zeros((rows, nodes), np.int32),
            n_members=np.zeros(rows, np.int64),
        )
        reports = Reports(np.zeros(rows, np.int64), np.zeros((rows, nodes), np.int32), np.zeros((rows, nodes, 2)))
        belief = Belief(
            mean=np.zeros((rows, 4)),
            cov=np.zeros((rows, 4, 4)),
            predicted_mean=np.zeros((rows, 4)),
            predicted_cov=np.zeros((rows, 4, 4)),
            n_eff=np.zeros(rows),
            particles=np.zeros((rows, 4, particles), np.float32),
            log_weights=np.zeros((rows, particles), np.float32),
        )
        return cls(
            key=np.zeros(rows, np.uint64),
            period=np.zeros(rows, np.int64),
            lam=np.zeros(rows),
            track=np.zeros((rows, periods + 1, 4)),
            log_miss=np.zeros(rows),
            last_search=np.zeros(rows, np.int64),
            luck=np.zeros(rows, np.uint32),
            network=network,
            reports=reports,
            belief=belief,
        )

    def copy(self) -> State:
        """A deep copy: no array is shared."""
        return _copied(self)


def _copied(value):
    return type(value)(*map(_copied, value)) if isinstance(value, tuple) else value.copy()


class Cluster(NamedTuple):
    """A choice: a head and its members."""

    head: np.ndarray  # (B,) node; -1: keep the head
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


class Outcome(NamedTuple):
    """What a period brought and cost; for rewards and loggers, never for policies. Each (B,) unless said."""

    error_m: np.ndarray  # distance between the estimate and the target after the correction
    energy_j: np.ndarray  # (B, 6) by purpose, see PURPOSES
    spent_j: np.ndarray  # (B, S) by node: exactly what the batteries lost
    members: np.ndarray  # awake nodes, head included; all that woke in a search
    detections: np.ndarray  # awake nodes that detected
    delivered: np.ndarray  # reports the head had, its own included
    dropped: np.ndarray  # chosen nodes that were dead or named twice or out of range
    handover: np.ndarray  # 1 when the head's role went to another node
    searched: np.ndarray  # 1 when there was a search
    resampled: np.ndarray  # 1 when the particles were resampled
    alive: np.ndarray  # living nodes after the period
    posterior_rms_m: np.ndarray  # sqrt(trace of the belief's position covariance)
    target_m: np.ndarray  # (B, 2) the truth
    estimate_m: np.ndarray  # (B, 2)

    @classmethod
    def zeros(cls, rows: int, nodes: int) -> Outcome:
        """Of the right shapes, before a period."""
        counts = {name: np.zeros(rows, np.int64) for name in COUNTS}
        return cls(
            error_m=np.zeros(rows),
            energy_j=np.zeros((rows, len(PURPOSES))),
            spent_j=np.zeros((rows, nodes)),
            posterior_rms_m=np.zeros(rows),
            target_m=np.zeros((rows, 2)),
            estimate_m=np.zeros((rows, 2)),
            **counts,
        )

    @property
    def energy_mj(self) -> np.ndarray:
        """(B,) energy of the period in mJ, summed in the fixed order of PURPOSES."""
        return 1e3 * self.energy_j.cumsum(axis=1)[:, -1]


COUNTS = ("members", "detections", "delivered", "dropped", "handover", "searched", "resampled", "alive")
PURPOSES = ("sensing", "handover", "invitation", "report", "broadcast", "search")


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
