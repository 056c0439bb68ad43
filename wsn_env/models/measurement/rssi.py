"""Received strength in dB."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wsn_env.models.measurement.level import Level
from wsn_env.models.quantity import quantity


@dataclass(frozen=True)
class Rssi(Level):
    """Received strength in dB: reference - 10 n log10(max(d, floor)) + noise (eq. 1 in its log-distance form)."""

    reference_dbm: float = quantity(-40.0, "level at 1 m", at_least=-1e6, at_most=1e6)
    exponent: float = quantity(2.5, "path loss exponent n", above=0, at_most=1000)
    noise_db: float = quantity(3.0, "sd", at_least=1e-6, at_most=1e9)
    floor_m: float = quantity(1.0, "nearer than this the level grows no more", at_least=1e-6, at_most=1e6)

    @property
    def at_1m_db(self) -> float:
        """The reference."""
        return self.reference_dbm

    @property
    def fingerprint_unit(self) -> float:
        """1 dB."""
        return 1.0

    def squared_ranges(self, values: np.ndarray, most_m: float) -> tuple[np.ndarray, np.ndarray]:
        """Squared distances that strengths (n,) speak of, by eq. 1 turned round, and their sds to first order [m^2].

        Args:
            most_m: a weaker strength is taken to come from this far.
        """
        lg = (self.reference_dbm - values) / (5 * self.exponent)
        squared = np.minimum(10 ** np.minimum(lg, 2 * np.log10(most_m)), most_m**2)
        return squared, squared * (self.noise_db * np.log(10) / (5 * self.exponent))
