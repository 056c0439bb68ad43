"""Received level of a sound in the sea."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from wsn_env.compiled.elementary import F, log, log32
from wsn_env.models.acoustics import absorption_db_per_km
from wsn_env.models.measurement.level import Level
from wsn_env.models.quantity import quantity


@dataclass(frozen=True)
class Sonar(Level):
    """Received level of a sound in the sea: source - 10 k log10(d) - alpha(f) d + noise, d at least `floor_m`.

    Urick's passive sonar equation with Thorp's absorption; k = 1 is cylindrical spreading, 2 spherical, 1.5 the
    customary middle. The source's 120 dB are an assumption of ours.
    """

    source_db: float = quantity(120.0, "source level at 1 m, dB re 1 uPa", at_least=-1e6, at_most=1e6)
    spreading: float = quantity(1.5, "k", above=0, at_most=1000)
    frequency_khz: float = quantity(10.0, "f", at_least=0.4, at_most=1000)
    noise_db: float = quantity(3.0, "sd of a measured level", at_least=1e-6, at_most=1e9)
    floor_m: float = quantity(1.0, "nearer than this the level grows no more", at_least=1e-6, at_most=1e6)

    @property
    def at_1m_db(self) -> float:
        """The source level."""
        return self.source_db

    @property
    def exponent(self) -> float:
        """k, by the name that it has on land."""
        return self.spreading

    @property
    def absorption_db_per_m(self) -> float:
        """alpha(f)."""
        return absorption_db_per_km(self.frequency_khz) / 1000

    @staticmethod
    def level(m: Any, squared: float) -> float:
        near = max(squared, m.floor_m * m.floor_m, 1e-12)
        return m.at_1m - m.slope * log(near) - m.absorption * np.sqrt(near)

    @staticmethod
    def level_slope(m: Any, squared: float) -> float:
        if squared < max(m.floor_m * m.floor_m, 1e-12):
            return 0.0
        return -2.0 * m.slope / squared - m.absorption / np.sqrt(squared)

    @staticmethod
    def weigh(m: Any, px: np.ndarray, py: np.ndarray, log_weights: np.ndarray, node: Any, value: Any) -> None:
        half_precision = F(0.5 / max(m.noise * m.noise, 1e-20))
        sx, sy, z = F(node.x), F(node.y), F(value[0])
        at_1m, slope, floor = F(m.at_1m), F(m.slope), F(max(m.floor_m * m.floor_m, 1e-12))
        absorption = F(m.absorption)
        for i in range(len(px)):
            dx = px[i] - sx
            dy = py[i] - sy
            near = max(dx * dx + dy * dy, floor)
            r = (z - at_1m) + (slope * log32(near) + absorption * np.sqrt(near))
            log_weights[i] -= half_precision * (r * r)
