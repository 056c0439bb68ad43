"""What a radio has to say: the price of talking (Xiang & Guo, 2013, eq. 5), of listening and of sleep."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np

from wsn_env.models.kinds import Kind, by_kind
from wsn_env.models.quantity import quantity, span

if TYPE_CHECKING:
    from wsn_env.scenario import Scenario

RECEIVERS = ("head", "sink", "target")
MOST_BITS, MOST_W = 10**9, 1e6
MOST_J = 1e9  # what batteries lose is rounded to .1 uJ then


@dataclass(frozen=True)
class Link(Kind):
    """Base of radios: packet sizes, loss, batteries. What a bit and a period cost is up to the kinds.

    A kind has `tx_j_per_bit`, `rx_j_per_bit`, `awake_j` and, where they differ from the defaults, the functions

        transmission(r, bits, squared) -> energy of sending over a squared distance [J, m^2]
        reception(r, bits) -> energy of receiving [J]
    """

    abstract: ClassVar[bool] = True
    role: ClassVar[str] = "radio"
    required: ClassVar[tuple[str, ...]] = ("transmission", "reception", "awake_j")
    optional: ClassVar[tuple[str, ...]] = ("relayed",)
    allocates: ClassVar[bool] = False

    report_bits: int = quantity(512, "a member's report", at_least=0, at_most=MOST_BITS, whole=True)
    invitation_bits: int = quantity(128, "an invitation to a new member", at_least=0, at_most=MOST_BITS, whole=True)
    handover_bits: int = quantity(448, "the estimate, from old to new head", at_least=0, at_most=MOST_BITS, whole=True)
    wakeup_bits: int = quantity(
        128, "the wake-up of a search, paid by its receivers", at_least=0, at_most=MOST_BITS, whole=True
    )
    broadcast_bits: int = quantity(32, "the head's word to resample", at_least=0, at_most=MOST_BITS, whole=True)
    handover: Literal["estimate", "particles"] = quantity(
        "estimate",
        "what is handed over: the estimate (handover_bits) or every particle",
        choices=("estimate", "particles"),
    )
    packet_success: float = quantity(1.0, "probability that one try of a report arrives", at_least=0, at_most=1)
    retries: int = quantity(3, "further tries of a lost report", at_least=0, at_most=15, whole=True)
    receiver: Literal["head", "sink", "target"] = quantity(
        "head",
        "who hears the awake nodes: the cluster's head; a sink on mains in the middle of the field; the target's own"
        " node, which hears their beacons",
        choices=RECEIVERS,
    )
    battery_j: float | tuple[float, float] = quantity(
        1.0, "a node's energy at the start", above=0, at_most=MOST_J, drawn=True
    )

    if TYPE_CHECKING:  # a kind's are constants, quantities or properties

        @property
        def hop_m(self) -> float:
            """No packet goes farther at once."""

        @property
        def tx_j_per_bit(self) -> float:
            """Sending, whatever the distance."""

        @property
        def amplifier_j_per_bit_m2(self) -> float:
            """Sending, times distance squared."""

        @property
        def rx_j_per_bit(self) -> float:
            """Receiving."""
    else:
        hop_m: ClassVar[float] = math.inf  # no packet goes farther at once
        tx_j_per_bit: ClassVar[float]  # sending, whatever the distance
        amplifier_j_per_bit_m2: ClassVar[float] = 0.0  # sending, times distance squared
        rx_j_per_bit: ClassVar[float]  # receiving

    @property
    def most_battery_j(self) -> float:
        """A node's energy at the start, in the episodes that have the most."""
        return span(self.battery_j)[1]

    @property
    def delivery(self) -> float:
        """Probability that a report arrives within all its tries."""
        return 1 - (1 - self.packet_success) ** (1 + self.retries)

    @property
    def head_delivery(self) -> float:
        """The same of the head's report: it hears its own, a sink or the target may not."""
        return 1.0 if self.receiver == "head" else self.delivery

    def sending_j(self, bits: float, distance_m: float) -> float:
        """Energy of sending over a distance: bits (e1 + e2 d^2) for each hop, and what its relays pay for receiving."""
        hops = max(1, math.ceil(distance_m / self.hop_m))
        hop = self.tx_j_per_bit + self.amplifier_j_per_bit_m2 * distance_m**2
        return bits * (hops * hop + (hops - 1) * self.rx_j_per_bit)

    def receiving_j(self, bits: float) -> float:
        """Energy of receiving: bits e_r."""
        return bits * self.rx_j_per_bit

    def check(self, scenario: Scenario) -> None:
        """Raise ScenarioError where it does not fit the rest of the scenario."""

    def constants(self, scenario: Scenario) -> dict[str, float]:
        """Sizes, prices and probabilities; who receives, and where a sink stands."""
        width_m, depth_m = scenario.field.room_m
        return dict(
            sink_x=0.5 * width_m,
            sink_y=0.5 * depth_m,
            tx_j_per_bit=self.tx_j_per_bit,
            amplifier_j_per_bit_m2=self.amplifier_j_per_bit_m2,
            rx_j_per_bit=self.rx_j_per_bit,
            report_bits=float(self.report_bits),
            invitation_bits=float(self.invitation_bits),
            handover_bits=float(scenario.handover_bits),
            wakeup_bits=float(self.wakeup_bits),
            broadcast_bits=float(self.broadcast_bits),
            packet_success=float(self.packet_success),
            tries=1 + self.retries,
            delivery=float(self.delivery),
            head_delivery=float(self.head_delivery),
            to_head=self.receiver == "head",
            to_target=self.receiver == "target",
            awake_j=float(self.awake_j(scenario.period_s)),
            asleep_j=float(self.asleep_j(scenario.period_s)),
            hop_m=float(self.hop_m),
        )

    def awake_j(self, period_s: float) -> float:
        """What an awake node pays for a period, packets apart."""
        raise NotImplementedError

    def asleep_j(self, period_s: float) -> float:
        """What a sleeping node pays for a period."""
        return 0.0

    @staticmethod
    def transmission(r: Any, bits: float, squared: float) -> float:
        """Energy of sending `bits` over a squared distance [J]: bits (e1 + e2 d^2), eq. 5."""
        return bits * (r.tx_j_per_bit + r.amplifier_j_per_bit_m2 * squared)

    @staticmethod
    def reception(r: Any, bits: float) -> float:
        """Energy of receiving `bits` [J]: bits e_r."""
        return bits * r.rx_j_per_bit

    @staticmethod
    def relayed(r: Any, bits: float, squared: float) -> float:
        """`transmission` over as many hops as it takes, with what the relays pay for receiving."""
        hops = max(np.ceil(np.sqrt(squared) / r.hop_m), 1.0)
        return hops * transmission(r, bits, squared) + (hops - 1.0) * reception(r, bits)


transmission: Any = by_kind(Link.transmission)
reception: Any = by_kind(Link.reception)
relayed: Any = by_kind(Link.relayed)
