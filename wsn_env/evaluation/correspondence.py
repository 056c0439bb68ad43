"""Which track follows which of several targets: GOSPA, changes of identity, lost tracks."""

import numpy as np
from scipy.optimize import linear_sum_assignment


class Correspondence:
    """Measures the tracks of several fields, a period after the other.

    A track farther than the cut-off c from a target does not follow it.

    - GOSPA (Rahmathullah, Garcia-Fernandez & Svensson, 2017) with p = 2 and alpha = 2, so that a missed target and the
      track that should be its cost c^2 / 2 each: with as many tracks as targets the root of the least sum, over all
      ways to pair them, of min(distance, c)^2.
    - Swaps as CLEAR MOT counts mismatches (Bernardin & Stiefelhagen, 2008): a target keeps its track while that
      follows it; the others are paired anew, as near as may be, and a target whose new track is not its last one has
      been swapped. Two targets that exchange their tracks are two swaps.
    """

    def __init__(self, fields: int, targets: int, cutoff_m: float) -> None:
        self._cutoff_m, self._shape = cutoff_m, (fields, targets)
        self._squares, self._periods = np.zeros(fields), 0
        self._last = np.tile(np.arange(targets), (fields, 1))  # each target's track, or the last that it had
        self._followed = np.ones((fields, targets), bool)
        self.swaps: np.ndarray = np.zeros(fields, int)

    def note(self, estimates_m: np.ndarray, targets_m: np.ndarray) -> None:
        """A period's tracks and targets (fields * targets, 2) [m]."""
        where = estimates_m.reshape(*self._shape, 2), targets_m.reshape(*self._shape, 2)
        apart = np.linalg.norm(where[1][:, :, None] - where[0][:, None], axis=-1)  # (fields, targets, tracks)
        self._squares += self._least_sums(np.minimum(apart, self._cutoff_m) ** 2)
        self._periods += 1
        kept = np.take_along_axis(apart, self._last[:, :, None], axis=2)[:, :, 0] <= self._cutoff_m
        for field in np.flatnonzero(~(kept & self._followed).all(axis=1)):
            self._pair_anew(field, apart[field])

    def _least_sums(self, costs):
        """The least sum of each field's costs over all pairings."""
        nearest = costs.argmin(axis=2)
        least = costs.min(axis=2).sum(axis=1)  # where no two targets have the same nearest track
        for field in np.flatnonzero((np.sort(nearest) != np.arange(self._shape[1])).any(axis=1)):
            least[field] = costs[field][linear_sum_assignment(costs[field])].sum()
        return least

    def _pair_anew(self, field, apart):
        last, followed = self._last[field], self._followed[field]
        targets = np.arange(len(last))
        keep = followed & (apart[targets, last] <= self._cutoff_m)
        free, tracks = targets[~keep], np.setdiff1d(targets, last[keep])
        followed[:] = keep
        near = apart[np.ix_(free, tracks)]
        for i, j in zip(*linear_sum_assignment(np.where(near <= self._cutoff_m, near, 1e6 * self._cutoff_m))):
            if near[i, j] <= self._cutoff_m:
                self.swaps[field] += last[free[i]] != tracks[j]
                last[free[i]], followed[free[i]] = tracks[j], True

    @property
    def gospa_m(self) -> np.ndarray:
        """(fields,) root of the mean over the periods of GOSPA squared [m]."""
        return np.sqrt(self._squares / max(self._periods, 1))

    @property
    def lost_tracks(self) -> np.ndarray:
        """(fields,) how many targets no track follows now."""
        return (~self._followed).sum(axis=1)
