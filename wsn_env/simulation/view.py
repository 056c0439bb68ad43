"""What policies and observations may see: belief, delivered reports, batteries, geometry, the standing cluster.

Nothing here depends on the truth but through reports. The arrays of a view are read-only, and those of `View.of` belong
to their period: whatever a policy does with them, and however long it keeps them, neither they nor the world change.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from wsn_env.models.arguments import check_argument
from wsn_env.models.quantity import short, whole_number
from wsn_env.models.state import Cluster, Grid, Knowledge, Network, Reports, State
from wsn_env.simulation import geometry

MOVING = ("surprise", "mode_probabilities")  # what the filter tells of how the target moves
HEARING = ("latest_db", "gradient", "variance")  # of a beacon's receivers, what policies ask for


@dataclass(frozen=True, eq=False)
class View:
    """The network's knowledge before it chooses the cluster of the next period; all arrays lead with B, and are
    read-only.

    `View(state.knowledge)` shares its arrays with the state, for code that neither writes to nor keeps them.
    """

    knowledge: Knowledge
    derived: dict[Any, Any] = field(default_factory=dict, repr=False)  # what has been found out from it, kept

    @property
    def row(self) -> np.ndarray:
        """(B,) STATE."""
        return self.knowledge.row

    @property
    def belief(self) -> np.ndarray:
        """(B,) BELIEF."""
        return self.knowledge.belief

    @property
    def network(self) -> Network:
        """Nodes, batteries, the standing cluster."""
        return self.knowledge.network

    @property
    def reports(self) -> Reports:
        """What the head received in the last period."""
        return self.knowledge.reports

    @property
    def receivers(self) -> np.ndarray:
        """(B, S) RECEIVER, where the tracker learns its nodes' errors; else (B, 0)."""
        return self.knowledge.receivers

    @property
    def period(self) -> np.ndarray:
        """(B,) periods done."""
        return self.row["period"]

    @property
    def lam(self) -> np.ndarray:
        """(B,) m/mJ."""
        return self.row["lam"]

    @property
    def random_bits(self) -> np.ndarray:
        """(B,) uint32: a random 32-bit number of the period, for policies that want one."""
        return self.row["random_bits"]

    @property
    def log_miss(self) -> np.ndarray:
        """(B,) log probability of so long a silence."""
        return self.row["log_miss"]

    @property
    def mean(self) -> np.ndarray:
        """(B, 4) x, vx, y, vy after the last correction."""
        return self.belief["mean"]

    @property
    def cov(self) -> np.ndarray:
        """(B, 4, 4)."""
        return self.belief["cov"]

    @property
    def full_j(self) -> np.ndarray:
        """(B,) what each battery held at the start [J]."""
        return self.row["full_j"]

    @property
    def predicted_mean(self) -> np.ndarray:
        """(B, 4) for the period to come."""
        return self.belief["predicted_mean"]

    @property
    def predicted_cov(self) -> np.ndarray:
        """(B, 4, 4)."""
        return self.belief["predicted_cov"]

    @classmethod
    def of(cls, state: State) -> View:
        """The view of a state, with arrays of its own: it stays what it is when the state is stepped."""
        if not isinstance(state, State):
            check_argument("state", state, State)
        return cls(state.knowledge.copy().freeze())

    def at_lam(self, lam: np.ndarray) -> View:
        """The same knowledge with other trade-offs.

        Args:
            lam: (B,) m/mJ.
        """
        row = self.row.copy()
        row["lam"] = lam
        return View(replace(self.knowledge, row=_frozen(row)))

    @property
    def positions(self) -> np.ndarray:
        """(B, S, 2) m."""
        return self.network.positions

    @property
    def battery(self) -> np.ndarray:
        """(B, S) J."""
        return self.network.battery

    @property
    def head(self) -> np.ndarray:
        """(B,) the standing head; -1: none."""
        return self.network.row["head"]

    @property
    def rows(self) -> np.ndarray:
        """(B,) 0, 1, ..., for indexing."""
        return np.arange(len(self.period))

    @cached_property
    def alive(self) -> np.ndarray:
        """(B, S) bool."""
        return _frozen(self.battery > 0)

    @cached_property
    def member(self) -> np.ndarray:
        """(B, S) bool: the standing cluster, head included."""
        listed = np.arange(self.network.members.shape[1]) < self.network.n_members[:, None]
        mask = _mask(self.network.members, listed, self.positions.shape[1])
        rows = np.flatnonzero(self.head >= 0)
        mask[rows, self.head[rows]] = True
        return _frozen(mask)

    @cached_property
    def detected(self) -> np.ndarray:
        """(B, S) bool: whose reports the head had in the last period, its own included."""
        return _frozen(_mask(self.reports.node, self._of_target, self.positions.shape[1]))

    @cached_property
    def sees(self) -> np.ndarray:
        """(B, S) bool: who detected the target in the last period: `detected`; of binary sensors those that were awake,
        or asked in a search, and whose state is 1."""
        if not self.reports.bitmap.shape[1]:
            return self.detected
        return _frozen((self.reports.bitmap > 0) & (self.member | self.detected))

    @cached_property
    def _of_target(self) -> np.ndarray:
        """Which of the reports are of the row's target. Where they do not say it: of each node that has probably
        measured it the likeliest one, the first of those alike."""
        valid = np.arange(self.reports.node.shape[1]) < self.reports.count[:, None]
        if not self.reports.share.shape[1]:
            return valid
        rows, slots = np.nonzero(valid)
        nodes, shares = self.reports.node[rows, slots], self.reports.share[rows, slots]
        sums, most = np.zeros(self.positions.shape[:2]), np.zeros(self.positions.shape[:2])
        np.add.at(sums, (rows, nodes), shares)
        np.maximum.at(most, (rows, nodes), shares)
        likeliest = (sums[rows, nodes] >= 0.5) & (shares == most[rows, nodes])
        place = rows * self.positions.shape[1] + nodes
        likeliest &= np.isin(np.arange(len(rows)), np.unique(np.where(likeliest, place, -1), return_index=True)[1])
        valid[rows, slots] = likeliest
        return valid

    @cached_property
    def measured(self) -> np.ndarray:
        """(B, S, 2): what they reported, zero elsewhere."""
        values = np.zeros(self.positions.shape)
        rows, slots = np.nonzero(self._of_target)
        values[rows, self.reports.node[rows, slots]] = self.reports.value[rows, slots]
        return _frozen(values)

    @property
    def prediction(self) -> np.ndarray:
        """(B, 2) where the target should be in the period to come [m]."""
        return self.predicted_mean[:, ::2]

    @property
    def spread_m(self) -> np.ndarray:
        """(B,) E = max of the predicted position sds (eq. 16) [m]."""
        return np.sqrt(np.maximum(self.predicted_cov[:, 0, 0], self.predicted_cov[:, 2, 2]))

    @cached_property
    def distance(self) -> np.ndarray:
        """(B, S) of the nodes to the prediction [m]."""
        return _frozen(geometry.distances_to(self.positions, self.prediction))

    def nearest(self, count: int, ring_m: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """The living nodes nearest to the prediction, or to a ring about it: (B, count) nodes, -1 for none, and their
        distances to the prediction [m]."""
        key = "nearest", count, ring_m
        if type(count) is not int or type(ring_m) is not float or key not in self.derived:
            count, ring_m = whole_number("count", count, 0), check_argument("ring_m", ring_m, float)
            if not 0 <= ring_m < np.inf:
                raise ValueError(f"ring_m = {ring_m}: must be a finite number, at least 0")
            key = "nearest", count, ring_m
        if key not in self.derived:
            self.derived[key] = tuple(map(_frozen, geometry.nearest(self.network, self.prediction, count, ring_m)))
        return self.derived[key]

    def nearest_living(self) -> np.ndarray:
        """(B,) the living node nearest to the prediction; -1: none is alive."""
        return self.nearest(1)[0][:, 0]

    def as_arrays(self) -> dict[str, np.ndarray]:
        """Fresh arrays of fixed shape, the content of the observation "view"."""
        arrays = {
            "period": self.period.astype(np.int64),
            "lam": self.lam[:, None].copy(),
            "random_bits": self.random_bits[:, None].astype(np.int64),
            "log_miss": self.log_miss[:, None].copy(),
            "full_j": self.full_j[:, None].copy(),
            "left_j": self.network.row["left_j"][:, None].copy(),
            "mean": self.mean.copy(),
            "cov": self.cov.copy(),
            "predicted_mean": self.predicted_mean.copy(),
            "predicted_cov": self.predicted_cov.copy(),
            "positions": self.positions.copy(),
            "battery": self.battery.copy(),
            "head": self.head[:, None].astype(np.int64),
            "member": self.member.astype(np.int8),
            "detected": self.detected.astype(np.int8),
            "measured": self.measured.copy(),
        } | {name: self.belief[name].reshape(len(self.row), -1).copy() for name in MOVING}
        if self.receivers.shape[1]:
            arrays |= {name: self.receivers[name].copy() for name in HEARING}
        if self.row["targets"].max(initial=0) > 1:
            arrays["targets"] = self.row["targets"][:, None].astype(np.int64)
        return arrays | ({"bitmap": self.reports.bitmap.copy()} if self.reports.bitmap.shape[1] else {})

    @classmethod
    def from_arrays(cls, arrays: dict[str, np.ndarray]) -> View:
        """The view back from `as_arrays`; of one environment too, whose arrays lack the leading B.

        Raises:
            ValueError: what it was given are no such arrays.
        """
        try:
            return cls._from_arrays(arrays)
        except (AttributeError, IndexError, KeyError, TypeError, ValueError) as problem:
            words = "must be the arrays of the observation 'view', or of View.as_arrays"
            raise ValueError(f"arrays: {words}: {short(repr(problem))}") from None

    @classmethod
    def _from_arrays(cls, arrays: dict[str, np.ndarray]) -> View:
        a = {name: np.asarray(value) for name, value in arrays.items()}
        if a["battery"].ndim == 1:
            a = {name: value[None] for name, value in a.items()}
        rows, nodes = a["battery"].shape
        side = Grid.side(nodes)
        of_kinds = {"states": nodes if "bitmap" in a else 0, "receivers": nodes if HEARING[0] in a else 0}
        known = Knowledge.zeros(rows=rows, nodes=nodes, reports=nodes, cells=side * side + 1, **of_kinds)
        for name in ("period", "lam", "random_bits", "log_miss", "full_j"):
            known.row[name] = a[name].reshape(rows)
        for name in ("mean", "cov", "predicted_mean", "predicted_cov"):
            known.belief[name] = a[name]
        for name in MOVING:
            known.belief[name] = a[name].reshape(known.belief[name].shape)
        for name in HEARING if known.receivers.size else ():
            known.receivers[name] = a[name]
        known.row["targets"] = a["targets"].reshape(rows) if "targets" in a else 1

        network, reports = known.network, known.reports
        network.positions[:], network.battery[:] = a["positions"], a["battery"]
        network.grid.row["side"] = side
        geometry.index(network)
        others, heads = a["member"].astype(bool), a["head"].reshape(rows)
        network.row["alive"], network.row["head"] = (a["battery"] > 0).sum(axis=1), heads
        network.row["left_j"] = a["left_j"].reshape(rows)
        others[heads >= 0, heads[heads >= 0]] = False
        network.members[:], network.row["n_members"] = _lists(others)

        reports.node[:], reports.count[:] = _lists(a["detected"].astype(bool))
        slots = reports.node[:, :, None].astype(np.int64)
        reports.value[:] = np.take_along_axis(a["measured"], np.maximum(slots, 0), axis=1)
        if "bitmap" in a:
            reports.bitmap[:] = a["bitmap"]
        return cls(known.freeze())


def _frozen(array: np.ndarray) -> np.ndarray:
    """What is kept with a view, for all who ask."""
    array.flags.writeable = False
    return array


def _mask(nodes: np.ndarray, valid: np.ndarray, count: int) -> np.ndarray:
    """(B, count) bool from those of (B, n) indices that are valid."""
    mask = np.zeros((len(nodes), count), dtype=bool)
    rows, slots = np.nonzero(valid)
    mask[rows, nodes[rows, slots]] = True
    return mask


def _lists(mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The inverse of `_mask`: indices (B, S) int32 and counts."""
    nodes = np.zeros(mask.shape, dtype=np.int32)
    found = Cluster.of(np.zeros(len(mask)), mask).members
    nodes[:, : found.shape[1]] = np.maximum(found, 0)
    return nodes, mask.sum(axis=1)
