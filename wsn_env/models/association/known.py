"""Every report says of which target it is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from wsn_env.models.association.base import Association
from wsn_env.models.association.robust import weigh_robustly
from wsn_env.models.measurement.base import AtHead, weigh_period


@dataclass(frozen=True)
class Known(Association):
    """Every report says of which target it is (the default): tagged targets, or one alone."""

    @staticmethod
    def weigh_reports(a: Any, head: AtHead, c: Any, maps: np.ndarray, scratch: Any) -> None:
        if c.tracking.robust:
            weigh_robustly(head, c, scratch)
        else:
            weigh_period(c.measurement, head, c, maps, scratch)
