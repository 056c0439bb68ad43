"""No report says of which target it is: the nearest neighbour."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from wsn_env.models.association.fit import fit
from wsn_env.models.association.unknown import Unknown, track_of
from wsn_env.models.measurement.base import weigh


@dataclass(frozen=True)
class Nearest(Unknown):
    """No report says of which target it is: of each node's measurements a head takes the one nearest to its prediction.

    Nearest in standard deviations, whatever the other targets may have made.
    """

    @staticmethod
    def associate(a: Any, heard: Any, tracks: np.ndarray, own: int, cloud: Any, c: Any) -> None:
        """Weigh the particles with what one node has measured; as Unknown.associate."""
        node, values, shares = heard
        best, least = -1, a.association_sds * a.association_sds
        if len(values) == 1 and len(tracks) == 1 and a.clutter == 0.0:  # nothing else can have made it
            least = np.inf
        for j in range(len(values)):
            found = fit(node, values[j], track_of(tracks, own), c)
            if found.squares <= least:
                best, least = j, found.squares
        if best >= 0:
            corrected = fit(node, values[best], track_of(tracks, own), c).corrected
            for k in range(5):
                tracks[own, k] = corrected[k]
            shares[best] = 1.0
            weigh(c.measurement, cloud.x[0], cloud.x[2], cloud.log_weights, node, values[best])
