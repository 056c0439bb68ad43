"""A Bluetooth Low Energy receiver."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from wsn_env.models.quantity import quantity
from wsn_env.models.radio.base import MOST_BITS, MOST_J, MOST_W, RECEIVERS, Link


@dataclass(frozen=True)
class Bluetooth(Link):
    """A Bluetooth Low Energy receiver that scans for a whole period, and passes every packet on to a sink on mains.

    The powers are those of Nordic's nRF52832 at 3 V (5.3 mA sending at 0 dBm, 5.4 mA receiving, DC/DC), the rate that
    of the uncoded 1M PHY. Listening is nearly all that a receiver spends: 16.2 mJ a second, against .002 for a report.
    """

    transmit_w: float = quantity(0.0159, "power while sending", at_least=0, at_most=MOST_W)
    listen_w: float = quantity(0.0162, "power while listening or receiving", at_least=0, at_most=MOST_W)
    bit_rate: float = quantity(1e6, "bits a second", at_least=1e-3, at_most=1e15)
    receiver: Literal["head", "sink", "target"] = quantity("sink", "who hears the awake nodes", choices=RECEIVERS)
    report_bits: int = quantity(128, "what is passed on of a packet", at_least=0, at_most=MOST_BITS, whole=True)
    invitation_bits: int = quantity(0, "an invitation to a new member", at_least=0, at_most=MOST_BITS, whole=True)
    battery_j: float = quantity(
        20_000.0, "a node's energy at the start: two alkaline AA cells", above=0, at_most=MOST_J
    )

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
