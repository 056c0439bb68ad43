"""A radio whose price grows with the square of the distance."""

from __future__ import annotations

from dataclasses import dataclass

from wsn_env.models.quantity import quantity
from wsn_env.models.radio.base import Link


@dataclass(frozen=True)
class Radio(Link):
    """Energy per bit (eq. 5); sleeping costs nothing, and every node hears every other."""

    tx_nj_per_bit: float = quantity(50.0, "e1: sending, whatever the distance", at_least=0, at_most=1e12)
    amplifier_pj_per_bit_m2: float = quantity(150.0, "e2: sending, times distance squared", at_least=0, at_most=1e15)
    rx_nj_per_bit: float = quantity(100.0, "e_r: receiving", at_least=0, at_most=1e12)
    sensing_nj: float = quantity(0.0, "energy of an awake node's sensing, per period", at_least=0, at_most=1e18)

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
