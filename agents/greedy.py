"""Members in the order of information per energy, for as long as the next one pays for itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from wsn_env.agents.base import ViewPolicy
from wsn_env.agents.tuned import nearest_lam, tuned
from wsn_env.compiled.kernels import kernel, piece
from wsn_env.envs.merit import chance_of, gain, price_mj
from wsn_env.models.field import squared_distance
from wsn_env.models.measurement.base import informs
from wsn_env.models.quantity import check_quantity
from wsn_env.models.radio.base import reception, relayed, transmission
from wsn_env.models.state import Cluster, knowledge_at, sensors_of
from wsn_env.scenario.constants import constants
from wsn_env.simulation.messages import in_one_hop
from wsn_env.simulation.view import View

CANDIDATES = 12
LEAST_DETECTION = 1e-6  # down to it `gain` tells probabilities apart


class Terms(NamedTuple):
    """What a period's bargain is worth beyond the period, at one lam."""

    lam: float  # m/mJ
    worth: float  # information bought now serves later periods too: its drop of the sd counts so many times
    service: float  # an invitation or a handover serves so many periods: its price counts by one part in so many


@dataclass(frozen=True)
class Greedy(ViewPolicy):
    """Adds the candidate whose report is worth most, less its price, to the head and those before it, while that is
    more than nothing.

    A report's worth is the expected drop of the position sd (root of the predicted covariance's trace) times `worth`;
    its price is lam times the energy of the report, and of the invitation where the node has to be called. Two such
    clusters compete: one about the standing head, and one about the node nearest to the prediction, which has to
    make up for the handover. Each row takes the terms whose lam is nearest to its own on the logarithmic scale.
    """

    terms: Sequence[Terms] | None = None  # None: tuned for the scenario's name; else usual ones

    def __post_init__(self) -> None:
        given: Sequence[Any] | None = self.terms
        if given is None:
            given = tuned(self.scenario, "greedy") or [(self.scenario.lam_range[0], 3.0, 4.0)]
        terms = tuple(sorted(Terms(*each) for each in given))
        check_quantity("Greedy", "len(terms)", len(terms), at_least=1)
        for each in terms:
            check_quantity("Terms", "lam", each.lam, at_least=0)
            check_quantity("Terms", "worth", each.worth, above=0)
            check_quantity("Terms", "service", each.service, above=0)
        object.__setattr__(self, "terms", terms)

    def act(self, view: View) -> Cluster:
        """Bargain, for every row."""
        table = np.array(self.terms)
        terms = table[nearest_lam(table[:, 0], view.lam)]
        nodes = view.nearest(CANDIDATES, self.scenario.ring_m)[0]
        heads, members = view.nearest_living().copy(), np.empty((len(nodes), CANDIDATES), np.int32)
        numbers = view.lam / terms[:, 1], 1.0 / terms[:, 2]
        known = constants(self.scenario), view.knowledge.handle
        _bargain(0, len(nodes), *known, *numbers, nodes, heads, members)
        return Cluster(heads, members)


@kernel
def _bargain(start, stop, cs, handle, lams, parts, nodes, heads, members):
    """Fill members (B, K), and put the standing head into heads (B,), which hold its rival, where it does no worse.

    Args:
        handle: of what the network knows (Knowledge).
        lams: (B,) price of energy over worth of information [m/mJ].
        parts: (B,) share of what invitations and handovers cost that the period bears.
        nodes: (B, K) candidates, -1: none.
    """
    stay = np.empty(nodes.shape[1], np.int32)
    known, c = knowledge_at(handle), cs[0]
    for b in range(start, stop):
        network, belief = known.network, known.belief[b]
        sensors, old = sensors_of(known, b), network.row[b].head
        awake, lam, part = network.members[b, : network.row[b].n_members], lams[b], parts[b]
        moved = _gather(heads[b], members[b], sensors, belief, old, awake, lam, part, nodes[b], c)
        if old >= 0 and old != heads[b]:
            if _gather(old, stay, sensors, belief, old, awake, lam, part, nodes[b], c) >= moved:
                heads[b], members[b] = old, stay


@piece
def _gather(head, chosen, sensors, belief, old, awake, lam, part, nodes, c):
    """The cluster about a head in `chosen`, -1 at the end; returns what it is worth, less its price [m]."""
    mean, cov = belief.predicted_mean, belief.predicted_cov
    p00, p01, p11 = cov[0, 0], cov[0, 2], cov[2, 2]
    chosen[:] = -1
    if head < 0:
        return 0.0
    detection = chance_of(sensors, head, mean, cov, c)
    drop, q00, q01, q11 = gain(detection, sensors, head, mean, cov, p00, p01, p11, c)
    total = np.sqrt(p00 + p11) - np.sqrt(max(p00 + p11 - drop, 0.0)) - lam * part * _handover_mj(old, head, sensors, c)
    p00, p01, p11 = q00, q01, q11
    size = len(nodes)
    detections, prices = np.empty(size), np.empty(size)
    for k in range(size):
        prices[k] = np.inf  # no candidate
        node = nodes[k]
        if node < 0 or node == head or not in_one_hop(node, head, sensors.positions, c.radio):
            continue
        detections[k] = chance_of(sensors, node, mean, cov, c)
        if informs(c.measurement, detections[k]) > LEAST_DETECTION:
            called = _invitation_mj(node, head, old, awake, sensors, c)
            prices[k] = lam * (price_mj(detections[k], sensors, node, head, mean, c) + part * called)
    for slot in range(size):
        best, most, after = -1, 0.0, (p00, p01, p11)
        for k in range(size):
            if prices[k] < np.inf:
                drop, q00, q01, q11 = gain(detections[k], sensors, nodes[k], mean, cov, p00, p01, p11, c)
                value = np.sqrt(p00 + p11) - np.sqrt(max(p00 + p11 - drop, 0.0)) - prices[k]
                if value > most:
                    best, most, after = k, value, (q00, q01, q11)
        if best < 0:
            break
        prices[best] = np.inf
        chosen[slot] = nodes[best]
        total += most
        p00, p01, p11 = after
    return total


@piece
def _handover_mj(old, head, sensors, c):
    """From the standing head, if there is one; a sink or the target needs none."""
    if not c.radio.to_head or old < 0 or old == head:
        return 0.0
    squared = squared_distance(sensors.positions, old, sensors.positions[head, 0], sensors.positions[head, 1])
    return 1e3 * (relayed(c.radio, c.radio.handover_bits, squared) + reception(c.radio, c.radio.handover_bits))


@piece
def _invitation_mj(node, head, old, awake, sensors, c):
    """To a node that is not awake yet; a new head invites all."""
    called = node != old
    for member in awake:
        called &= member != node
    hearing = reception(c.radio, c.radio.invitation_bits)
    if not c.radio.to_head:
        return 1e3 * hearing * called
    if not called and head == old:
        return 0.0
    squared = squared_distance(sensors.positions, node, sensors.positions[head, 0], sensors.positions[head, 1])
    return 1e3 * (transmission(c.radio, c.radio.invitation_bits, squared) + hearing)
