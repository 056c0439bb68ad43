"""What talking costs."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from wsn_env.models.quantity import Section, quantity

RECEIVERS = ("head", "sink", "target")


@dataclass(frozen=True)
class Link(Section):
    """Base of radio and modem: packet sizes, loss, batteries. What a bit and a period cost is up to the kinds."""

    report_bits: int = quantity(512, "a member's report", at_least=0, whole=True)
    invitation_bits: int = quantity(128, "an invitation to a new member", at_least=0, whole=True)
    handover_bits: int = quantity(448, "the estimate, from old to new head", at_least=0, whole=True)
    wakeup_bits: int = quantity(128, "the wake-up of a search, paid by its receivers", at_least=0, whole=True)
    broadcast_bits: int = quantity(32, "the head's word to resample", at_least=0, whole=True)
    handover: str = quantity(
        "estimate",
        "what is handed over: the estimate (handover_bits) or every particle",
        choices=("estimate", "particles"),
    )
    packet_success: float = quantity(1.0, "probability that one try of a report arrives", at_least=0, at_most=1)
    retries: int = quantity(3, "further tries of a lost report", at_least=0, at_most=15, whole=True)
    receiver: str = quantity(
        "head",
        "who hears the awake nodes: the cluster's head; a sink on mains in the middle of the field; the target's own"
        " node, which hears their beacons",
        choices=RECEIVERS,
    )
    battery_j: float = quantity(1.0, "a node's energy at the start", above=0)

    hop_m: ClassVar[float] = math.inf  # no packet goes farther at once
    tx_j_per_bit: ClassVar[float]  # sending, whatever the distance
    amplifier_j_per_bit_m2: ClassVar[float] = 0.0  # sending, times distance squared
    rx_j_per_bit: ClassVar[float]  # receiving

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

    def awake_j(self, period_s: float) -> float:
        """What an awake node pays for a period, packets apart."""
        raise NotImplementedError

    def asleep_j(self, period_s: float) -> float:
        """What a sleeping node pays for a period."""
        return 0.0


@dataclass(frozen=True)
class Radio(Link):
    """Energy per bit (eq. 5); sleeping costs nothing, and every node hears every other."""

    tx_nj_per_bit: float = quantity(50.0, "e1: sending, whatever the distance", at_least=0)
    amplifier_pj_per_bit_m2: float = quantity(150.0, "e2: sending, times distance squared", at_least=0)
    rx_nj_per_bit: float = quantity(100.0, "e_r: receiving", at_least=0)
    sensing_nj: float = quantity(0.0, "energy of an awake node's sensing, per period", at_least=0)

    @property
    def tx_j_per_bit(self) -> float:
        """e1 in J."""
        return 1e-9 * self.tx_nj_per_bit

    @property
    def amplifier_j_per_bit_m2(self) -> float:
        """e2 in J."""
        return 1e-12 * self.amplifier_pj_per_bit_m2

    @property
    def rx_j_per_bit(self) -> float:
        """e_r in J."""
        return 1e-9 * self.rx_nj_per_bit

    def awake_j(self, period_s: float) -> float:
        """Sensing."""
        return 1e-9 * self.sensing_nj


@dataclass(frozen=True)
class Modem(Link):
    """An acoustic modem: fixed powers, one hop, a slow channel, and a little energy even asleep.

    The powers and the rate are those of Newcastle University's Nanomodem V3. A packet of b bits takes b / rate seconds,
    so that the power of sending and of receiving is an energy per bit, whatever the distance. A node beyond one hop of
    the head cannot be its member nor report to it; a handover farther than that is relayed, at the old head's
    expense. Only a head may receive: a sink or the target would be beyond one hop of many nodes, whose silence would
    be taken for a target that is far from them. An awake node listens for the whole period; a node that a search wakes
    has paid for its sleep already. Listening and sleeping are charged as sensing.

    50 kJ, about four alkaline AA cells, are 46 days of listening or eight years of sleep; the 64 nodes of Underwater-v0
    together last for three months of tracking by the strongest signal (2.1 J a period).
    """

    transmit_w: float = quantity(1.5, "power while sending", at_least=0)
    receive_w: float = quantity(0.025, "power while receiving, above listening", at_least=0)
    listen_w: float = quantity(0.0125, "power of an awake node", at_least=0)
    sleep_w: float = quantity(0.0002, "power of a sleeping node", at_least=0)
    bit_rate: float = quantity(640.0, "bits a second", above=0)
    receiver: str = quantity("head", "who hears the awake nodes: the cluster's head", choices=("head",))
    hop_m: float = quantity(250.0, "range of a transmission", above=0)
    sound_ms: float = quantity(1500.0, "speed of sound", above=0)
    report_bits: int = quantity(64, "a member's report", at_least=0, whole=True)
    invitation_bits: int = quantity(32, "an invitation to a new member", at_least=0, whole=True)
    handover_bits: int = quantity(256, "the estimate, from old to new head", at_least=0, whole=True)
    wakeup_bits: int = quantity(32, "the wake-up of a search, paid by its receivers", at_least=0, whole=True)
    battery_j: float = quantity(50_000.0, "a node's energy at the start", above=0)

    @property
    def tx_j_per_bit(self) -> float:
        """Sending."""
        return self.transmit_w / self.bit_rate

    @property
    def rx_j_per_bit(self) -> float:
        """Receiving."""
        return self.receive_w / self.bit_rate

    @property
    def report_s(self) -> float:
        """Until a report across one hop has arrived: its length, and the way of the sound."""
        return self.report_bits / self.bit_rate + self.hop_m / self.sound_ms

    def awake_j(self, period_s: float) -> float:
        """Listening."""
        return self.listen_w * period_s

    def asleep_j(self, period_s: float) -> float:
        """Sleeping."""
        return self.sleep_w * period_s


@dataclass(frozen=True)
class Bluetooth(Link):
    """A Bluetooth Low Energy receiver that scans for a whole period, and passes every packet on to a sink on mains.

    The powers are those of Nordic's nRF52832 at 3 V (5.3 mA sending at 0 dBm, 5.4 mA receiving, DC/DC), the rate that
    of the uncoded 1M PHY. Listening is nearly all that a receiver spends: 16.2 mJ a second, against .002 for a report.
    """

    transmit_w: float = quantity(0.0159, "power while sending", at_least=0)
    listen_w: float = quantity(0.0162, "power while listening or receiving", at_least=0)
    bit_rate: float = quantity(1e6, "bits a second", above=0)
    receiver: str = quantity("sink", "who hears the awake nodes", choices=RECEIVERS)
    report_bits: int = quantity(128, "what is passed on of a packet", at_least=0, whole=True)
    invitation_bits: int = quantity(0, "an invitation to a new member", at_least=0, whole=True)
    battery_j: float = quantity(20_000.0, "a node's energy at the start: two alkaline AA cells", above=0)

    @property
    def tx_j_per_bit(self) -> float:
        """Sending."""
        return self.transmit_w / self.bit_rate

    @property
    def rx_j_per_bit(self) -> float:
        """Receiving."""
        return self.listen_w / self.bit_rate

    def awake_j(self, period_s: float) -> float:
        """Listening."""
        return self.listen_w * period_s


RADIOS = {"radio": Radio, "modem": Modem, "bluetooth": Bluetooth}
