"""No report says of which target it is: joint probabilistic data association."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from wsn_env.compiled.elementary import F, exp32, log32
from wsn_env.compiled.kernels import piece
from wsn_env.models.association.base import Association
from wsn_env.models.association.events import weights_of_others
from wsn_env.models.association.fit import LOST, false_density, fit, highest_density
from wsn_env.models.kinds import by_kind
from wsn_env.models.measurement.base import AtHead, PositionBelief, chance, node_at, weigh
from wsn_env.models.quantity import ScenarioError, quantity

if TYPE_CHECKING:
    from wsn_env.scenario import Scenario

MOST_TARGETS = 8  # sums run over all sets of them
LEAST = F(1e-30)


class Heard(NamedTuple):
    """What a head has heard of one node."""

    node: Any  # Node
    values: np.ndarray  # (n, 2) its measurements
    shares: np.ndarray  # (n,) the probability that each is of the head's own target; at first 0


class Cloud(NamedTuple):
    """A head's particles."""

    x: np.ndarray  # (4, P)
    log_weights: np.ndarray  # (P,)
    scratch: np.ndarray  # (P,) to write to


@dataclass(frozen=True)
class Unknown(Association):
    """No report says of which target it is: an awake node reports all that it measures, of targets and of none.

    A head weighs its particles by joint probabilistic data association (Fortmann, Bar-Shalom & Scheffe, 1983), node by
    node: it knows where the other targets are predicted, and sums over all joint events which of the targets has made
    which of the node's measurements. With the probabilities of these events it corrects its own picture of the others,
    too, before the next node's turn.
    """

    clutter: float = quantity(
        0.0, "mean number of an awake node's false measurements in a period, Poisson", at_least=0, at_most=10
    )
    resolution_m: float = quantity(
        0.0, "targets nearer to each other than this are one to a node, at their middle", at_least=0, at_most=1e6
    )
    association_sds: float = quantity(
        4.0, "a measurement farther off a target's prediction than so many sds is not of it", above=0, at_most=1e6
    )

    names_targets: ClassVar[bool] = False

    def room_a_node(self, targets: int) -> int:
        """One for each target, and as many false ones as hardly ever come."""
        return targets + (int(4 + 2 * self.clutter + 4 * self.clutter**0.5) if self.clutter else 0)

    def check(self, scenario: Scenario) -> None:
        """Only reports of a position or of a strength, weighed one by one."""
        kind, t, m = type(self).__name__, scenario.tracking, scenario.measurement
        robust = f"{t.gate_sds}, {t.outlier_share}, {t.node_sd_m}"
        wrong = {
            f"Scenario.targets = {scenario.targets}: allowed are up to {MOST_TARGETS}": scenario.targets > MOST_TARGETS,
            f"Scenario.measurement = {type(m).__name__}: allowed are reports of a position or a strength":
                not m.independent,
            f"Scenario.faults = {scenario.faults}: allowed are those of the motion":
                any(fault.strikes for fault in scenario.faults),
            f"Tracking.tracker = {t.tracker!r}: allowed is 'particle'": t.tracker != "particle",
            f"Tracking.fusion = {t.fusion!r}: allowed is 'joint'": t.fusion != "joint",
            "Tracking.silent_information = True: allowed is False": t.silent_information,
            f"Tracking.gate_sds, outlier_share, node_sd_m = {robust}: allowed are None, 0, 0": t.robust,
        }  # fmt: skip
        for what, given in wrong.items():
            if given:
                raise ScenarioError(f"{what} with Scenario.association = {kind}")

    @staticmethod
    def weigh_reports(a: Any, head: AtHead, c: Any, maps: np.ndarray, scratch: Any) -> None:
        belief, network, reports, b = head
        own, cloud = b % c.targets, Cloud(belief.particles[b], belief.log_weights[b], scratch)
        tracks = np.empty((c.targets, 5))  # where this head takes each target to be: a PositionBelief
        for s in range(c.targets):
            mean, cov = belief.row[b - own + s].predicted_mean, belief.row[b - own + s].predicted_cov
            tracks[s, 0], tracks[s, 1] = mean[0], mean[2]
            tracks[s, 2], tracks[s, 3], tracks[s, 4] = cov[0, 0], cov[0, 2], cov[2, 2]
        start, count = 0, reports.count[b]
        while start < count:  # node by node
            stop = start + 1
            while stop < count and reports.node[b, stop] == reports.node[b, start]:
                stop += 1
            node, values = node_at(network.positions[b], reports.node[b, start]), reports.value[b, start:stop]
            reports.share[b, start:stop] = 0.0
            associate(a, Heard(node, values, reports.share[b, start:stop]), tracks, own, cloud, c)
            start = stop

    @staticmethod
    def associate(a: Any, heard: Any, tracks: np.ndarray, own: int, cloud: Any, c: Any) -> None:
        """Weigh the particles with what one node has measured.

        Args:
            heard: Heard, whose shares are to be filled.
            tracks: (M, 5) where each target is taken to be, as a PositionBelief; corrected.
            own: the head's own target.
            cloud: its Cloud, to weigh.
        """
        (node, values, shares), (x, log_weights, scratch) = heard, cloud
        targets, n = len(tracks), len(values)
        others = a.clutter + LOST * (targets > 1)
        if n == 1 and others == 0.0:  # nothing else can have made it
            shares[0] = 1.0
            weigh(c.measurement, x[0], x[2], log_weights, node, values[0])
            return
        chances, fits, false = np.empty(targets), np.zeros((targets, n)), np.zeros(n)
        corrected = np.zeros((targets, n, 5))
        for s in range(targets):
            target = track_of(tracks, s)
            chances[s] = chance(c.measurement, node, target, c)
            for j in range(n):
                found = fit(node, values[j], target, c)
                if found.squares <= a.association_sds * a.association_sds:
                    fits[s, j] = found.density
                    for k in range(5):
                        corrected[s, j, k] = found.corrected[k]
        for j in range(n):
            false[j] = others * false_density(node, values[j], c)
        rest = weights_of_others(chances, fits, false)
        highest = chances[own] * highest_density(node, track_of(tracks, own), c)
        for s in range(targets):
            weights = rest[s].copy()
            weights[n] *= 1.0 - chances[s]
            for j in range(n):
                weights[j] *= chances[s] * fits[s, j]
            total = weights.sum()
            if total > 0.0:
                if s == own:
                    shares[:] = weights[:n] / total
                mix(tracks, s, weights / total, corrected[s])
        gains, missed = np.zeros(n), rest[own, n] * (1.0 - chances[own])
        for j in range(n):
            if fits[own, j] > 0.0:
                gains[j] = highest * rest[own, j]
        best = missed + gains.sum()
        if gains.sum() <= 0.0:
            return  # it tells nothing of this target
        sums = np.full(len(log_weights), F(missed / best))
        for j in range(n):
            if gains[j] > 0.0:
                scratch[:] = F(0)
                weigh(c.measurement, x[0], x[2], scratch, node, values[j])
                gain = F(gains[j] / best)
                for i in range(len(sums)):
                    sums[i] += gain * exp32(scratch[i])
        for i in range(len(sums)):
            log_weights[i] += log32(min(max(sums[i], LEAST), F(1)))


associate = by_kind(Unknown.associate)


@piece
def track_of(tracks: np.ndarray, s: int) -> PositionBelief:
    """Where target s is taken to be."""
    return PositionBelief(tracks[s, 0], tracks[s, 1], tracks[s, 2], tracks[s, 3], tracks[s, 4])


@piece
def mix(tracks: np.ndarray, s: int, weights: np.ndarray, corrected: np.ndarray) -> None:
    """Correct a track by all events at once: the mean and the covariance of their mixture.

    Args:
        weights: (n + 1,) probability that the target has made each measurement; of the last, none.
        corrected: (n, 5) the track by each.
    """
    n = len(corrected)
    x, y = weights[n] * tracks[s, 0], weights[n] * tracks[s, 1]
    for j in range(n):
        x, y = x + weights[j] * corrected[j, 0], y + weights[j] * corrected[j, 1]
    dx, dy = tracks[s, 0] - x, tracks[s, 1] - y
    xx = weights[n] * (tracks[s, 2] + dx * dx)
    xy = weights[n] * (tracks[s, 3] + dx * dy)
    yy = weights[n] * (tracks[s, 4] + dy * dy)
    for j in range(n):
        dx, dy = corrected[j, 0] - x, corrected[j, 1] - y
        xx += weights[j] * (corrected[j, 2] + dx * dx)
        xy += weights[j] * (corrected[j, 3] + dx * dy)
        yy += weights[j] * (corrected[j, 4] + dy * dy)
    tracks[s, 0], tracks[s, 1], tracks[s, 2], tracks[s, 3], tracks[s, 4] = x, y, xx, xy, yy
