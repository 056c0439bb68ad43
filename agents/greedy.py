"""Members in the order of information per energy, for as long as the next one pays for itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from wsn_env.agents.base import ViewPolicy
from wsn_env.agents.tuned import nearest_lam, tuned
from wsn_env.compiled.kernels import kernel, lean_piece
from wsn_env.envs.expectations import REPORTS, Expectations, outlook_of
from wsn_env.envs.merit import gain, informing, position_cov, price_mj, sd_drop, squared_between
from wsn_env.envs.prospects import stands
from wsn_env.models.quantity import check_quantity
from wsn_env.models.radio.base import reception, relayed, transmission
from wsn_env.models.state import Cluster, knowledge_at
from wsn_env.scenario.constants import common_constants
from wsn_env.simulation.view import View

CANDIDATES = 12
LEAST_SHARE = 0.8  # of the chance of detection at the nearest node, with which a shared node may lead
SAVED = 0.5  # of what it saves that counts there: the targets part again
TURNS = 2  # of each target to choose, where there are several
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

    Several targets of a field choose one after the other, twice; a node that is in the cluster of another is awake
    anyhow: only its report has a price, and half of what is saved counts for its leading.
    """

    terms: Sequence[Sequence[float]] | None = None  # None: tuned for the scenario's name; else usual ones
    jointly: bool = True  # False: each target chooses as if it were alone

    def __post_init__(self) -> None:
        chosen: Sequence[Any] | None = self.terms
        if chosen is None:
            chosen = tuned(self.scenario, "greedy") or [(self.scenario.lam_range[0], 3.0, 4.0)]
        terms = tuple(sorted(Terms(*each) for each in chosen))
        check_quantity("Greedy", "len(terms)", len(terms), at_least=1)
        for each in terms:
            check_quantity("Terms", "lam", each.lam, at_least=0)
            check_quantity("Terms", "worth", each.worth, above=0)
            check_quantity("Terms", "service", each.service, above=0)
        object.__setattr__(self, "terms", terms)

    @cached_property
    def _expectations(self) -> Expectations:
        return Expectations(self.scenario, CANDIDATES + 1)

    def act(self, view: View) -> Cluster:
        """Bargain, for every row."""
        table = np.array(self.terms)
        terms = table[nearest_lam(table[:, 0], view.lam)]
        nodes = np.column_stack([view.nearest(CANDIDATES, self.scenario.ring_m)[0], view.nearest_living()])
        heads, members = np.empty(len(nodes), np.int64), np.empty((len(nodes), CANDIDATES), np.int32)
        prices = view.lam / terms[:, 1], 1.0 / terms[:, 2]
        table = self._expectations.of_nodes(view, nodes, REPORTS).table
        known = common_constants(self.scenario), view.knowledge.handle
        targets = int(view.row["targets"].max(initial=1)) if self.jointly else 1
        if len(nodes) % targets:  # not of whole fields
            targets = 1
        _bargain(*known, table, prices, (heads, members), targets)
        return Cluster(heads, members)


@kernel
def _bargain(cs, handle, table, prices, cluster, targets):
    """Fill in the better of two clusters: about the nearest living node, or about the standing head, where that does no
    worse.

    Args:
        cs: the scenario's common constants.
        handle: of what the network knows (Knowledge).
        table: of Expected to the depth REPORTS, of CANDIDATES candidates and the nearest living node.
        prices: (B,) of energy over worth of information [m/mJ], and (B,) share of what invitations and handovers cost
            that the period bears.
        cluster: heads (B,) and members (B, K), filled.
        targets: of a field, whose rows stand one after the other.
    """
    known, chosen, (heads, members), r = knowledge_at(handle), np.empty(CANDIDATES, np.int32), cluster, cs[0].radio
    shares = targets > 1 and r.awake_j > r.asleep_j
    for first in range(0, len(heads), targets):
        for turn in range(TURNS if shares else 1):
            for b in range(first, first + targets):
                for other in range(first, b if turn == 0 else first + targets):
                    if other != b and shares:
                        _mark_shared(table[b], heads[other], members[other])
                _bargain_in(b, r, known, table, prices, chosen, cluster)
                for k in range(len(table[b])):
                    table[b][k].shared = 0


@lean_piece
def _mark_shared(nodes, head, members):
    """Mark which nodes (EXPECTED) are in a cluster."""
    for k in range(len(nodes)):
        nodes[k].shared |= nodes[k].node == head
        for member in members:
            nodes[k].shared |= member >= 0 and nodes[k].node == member


@lean_piece
def _bargain_in(b, r, known, table, prices, chosen, cluster):
    heads, members = cluster
    nearest, standing = CANDIDATES, CANDIDATES + 1
    outlook, price = outlook_of(known, b, standing, table), Price(prices[0][b], prices[1][b])
    old = outlook.nodes[standing].node
    heads[b] = outlook.nodes[nearest].node
    worth = _gather(nearest, outlook, price, r, members[b])
    if old >= 0 and old != heads[b]:
        other = _gather(standing, outlook, price, r, chosen)
        if other >= worth:
            heads[b], worth = old, other
            for k in range(CANDIDATES):
                members[b, k] = chosen[k]
    least = LEAST_SHARE * outlook.nodes[nearest].detection
    for leader in range(CANDIDATES):  # who is awake for another target anyhow
        node = outlook.nodes[leader]
        if node.shared and node.node != heads[b] and node.detection >= least:
            other = _gather(leader, outlook, price, r, chosen)
            if other > worth:
                heads[b], worth = node.node, other
                for k in range(CANDIDATES):
                    members[b, k] = chosen[k]


class Price(NamedTuple):
    """What a row's energy is worth."""

    lam: float  # over worth of information [m/mJ]
    part: float  # of what invitations and handovers cost


@lean_piece
def _gather(leader, outlook, price, r, chosen):
    """The cluster about a leader in `chosen` (K,), -1 at the end; returns what it is worth, less its price [m]."""
    nodes, p = outlook.nodes, position_cov(outlook.cov)
    head = nodes[leader]
    chosen[:] = -1
    if head.node < 0:
        return 0.0
    trace, after = gain(head, 1.0, p)
    total = sd_drop(p, trace) - price.lam * price.part * _handover_mj(outlook, head, r)
    if head.shared:  # a head is awake in every period: only what it saves tells clusters apart
        total += SAVED * price.lam * 1e3 * (r.awake_j - r.asleep_j)
    p = after
    for k in range(CANDIDATES):
        node = nodes[k]
        node.open = node.node >= 0 and node.node != head.node and squared_between(node, head) <= r.hop_m * r.hop_m
        if node.open:
            node.open = informing(node, 1.0) > LEAST_DETECTION
        if node.open:
            called = _invitation_mj(outlook, node, head, r)
            node.price_m = price.lam * (price_mj(node, outlook, leader, r) + price.part * called)
    for slot in range(CANDIDATES):
        best, most, rest = -1, 0.0, p
        for k in range(CANDIDATES):
            if nodes[k].open:
                trace, after = gain(nodes[k], 1.0, p)
                value = sd_drop(p, trace) - nodes[k].price_m
                if value > most:
                    best, most, rest = k, value, after
        if best < 0:
            break
        nodes[best].open = 0
        chosen[slot] = nodes[best].node
        total += most
        p = rest
    return total


@lean_piece
def _handover_mj(outlook, head, r):
    """From the standing head, if there is one; a sink or the target needs none."""
    old = outlook.nodes[outlook.candidates]
    if not r.to_head or old.node < 0 or old.node == head.node:
        return 0.0
    squared = squared_between(old, head)
    return 1e3 * (relayed(r, r.handover_bits, squared) + reception(r, r.handover_bits))


@lean_piece
def _invitation_mj(outlook, node, head, r):
    """To a node that is not awake yet; a new head invites all."""
    called = not stands(outlook, node.node)
    hearing = reception(r, r.invitation_bits)
    if not r.to_head:
        return 1e3 * hearing * called
    if not called and head.node == outlook.nodes[outlook.candidates].node:
        return 0.0
    return 1e3 * (transmission(r, r.invitation_bits, squared_between(node, head)) + hearing)
