"""Joint association events: which target has made which of a node's measurements, each at most one of each.

There are up to (n + 1)^M of them for n measurements of M targets. Measurement after measurement, all that matters of
those before is which targets have been given one: so sums over 2^M sets of targets replace the sum over events.
"""

import numpy as np

from wsn_env.compiled.kernels import piece


@piece
def weights_of_others(chances: np.ndarray, fits: np.ndarray, false: np.ndarray) -> np.ndarray:
    """What is left of the weight of all joint events when one target's own part is taken out.

    An event's weight is the product of `chances[s] * fits[s, j]` over the targets s that have made a measurement j,
    of `1 - chances[s]` over those that have made none, and of `false[j]` over the measurements of no target:
    Fortmann, Bar-Shalom & Scheffe (1983), eq. 30, with a density of false measurements of each one's own.

    Args:
        chances: (M,) probability that the node detects each target.
        fits: (M, n) density of each measurement, if it is of the target; 0: it cannot be.
        false: (n,) density of false measurements there, times their mean number.

    Returns: (M, n + 1). Entry (s, j): the sum over the events in which s has made j, without chances[s] * fits[s, j].
        Entry (s, n): over those in which s has made none, without 1 - chances[s].
    """
    targets, n = fits.shape
    sets = 1 << targets
    before, after = np.zeros((n + 1, sets)), np.zeros((n + 1, sets))  # by the targets that the others may not take
    before[0, 0] = 1.0
    for taken in range(sets):
        after[n, taken] = 1.0
        for s in range(targets):
            if not taken >> s & 1:
                after[n, taken] *= 1.0 - chances[s]
    for j in range(n):
        for taken in range(sets):
            before[j + 1, taken] = false[j] * before[j, taken]
            for s in range(targets):
                if taken >> s & 1:
                    before[j + 1, taken] += chances[s] * fits[s, j] * before[j, taken ^ (1 << s)]
    for j in range(n - 1, -1, -1):
        for taken in range(sets):
            after[j, taken] = false[j] * after[j + 1, taken]
            for s in range(targets):
                if not taken >> s & 1:
                    after[j, taken] += chances[s] * fits[s, j] * after[j + 1, taken | (1 << s)]
    rest = np.zeros((targets, n + 1))
    for s in range(targets):
        for taken in range(sets):
            if not taken >> s & 1:
                for j in range(n):
                    rest[s, j] += before[j, taken] * after[j + 1, taken | (1 << s)]
                rest[s, n] += before[n, taken] * after[n, taken | (1 << s)]
    return rest
