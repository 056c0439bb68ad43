"""An acoustic modem."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from wsn_env.models.quantity import ScenarioError, quantity
from wsn_env.models.radio.base import MOST_BITS, MOST_J, MOST_W, Link

if TYPE_CHECKING:
    from wsn_env.scenario import Scenario


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

    transmit_w: float = quantity(1.5, "power while sending", at_least=0, at_most=MOST_W)
    receive_w: float = quantity(0.025, "power while receiving, above listening", at_least=0, at_most=MOST_W)
    listen_w: float = quantity(0.0125, "power of an awake node", at_least=0, at_most=MOST_W)
    sleep_w: float = quantity(0.0002, "power of a sleeping node", at_least=0, at_most=MOST_W)
    bit_rate: float = quantity(640.0, "bits a second", at_least=1e-3, at_most=1e15)
    receiver: Literal["head"] = quantity("head", "who hears the awake nodes: the cluster's head", choices=("head",))
    hop_m: float = quantity(250.0, "range of a transmission", at_least=1e-3, at_most=1e9)
    sound_ms: float = quantity(1500.0, "speed of sound", at_least=1e-3, at_most=1e9)
    report_bits: int = quantity(64, "a member's report", at_least=0, at_most=MOST_BITS, whole=True)
    invitation_bits: int = quantity(32, "an invitation to a new member", at_least=0, at_most=MOST_BITS, whole=True)
    handover_bits: int = quantity(256, "the estimate, from old to new head", at_least=0, at_most=MOST_BITS, whole=True)
    wakeup_bits: int = quantity(
        32, "the wake-up of a search, paid by its receivers", at_least=0, at_most=MOST_BITS, whole=True
    )
    battery_j: float | tuple[float, float] = quantity(
        50_000.0, "a node's energy at the start", above=0, at_most=MOST_J, drawn=True
    )

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

    def check(self, scenario: Scenario) -> None:
        """A report must arrive within a period, and an awake node must not take less than a sleeping one."""
        if self.sleep_w > self.listen_w:
            raise ScenarioError(
                f"Modem.sleep_w = {self.sleep_w}: must be at most listen_w = {self.listen_w}, that of an awake node"
            )
        if scenario.period_s < self.report_s:
            raise ScenarioError(
                f"Scenario.period_s = {scenario.period_s}: must be at least {self.report_s:.3g} s, until a report of"
                f" {self.report_bits} bits has arrived"
            )
