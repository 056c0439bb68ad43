"""Searches for the network's width: the swarm of Pan (2012), the text's own flies (eqs. 1-3), golden section."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from wsn_env.filters.fingerprint import Training
from wsn_env.filters.width import fruit_flies, golden_section

WidthError = Callable[[float], float]  # at a width [dB]: of the fixes at the validation points [m]
LOW_DB, HIGH_DB = 0.05, 30.0
ITERATIONS = 25  # of eight flies: as many evaluations as Pan's ten flies in twenty
SIDE_M = 200.0
GOLDEN, TRAININGS, PAN = "golden section", "golden section, six trainings", "fruit flies, Pan's"
FLIES, FLIES_IN_M = "fruit flies, the text's, lengths in sides", "fruit flies, the text's, lengths in metres"


@dataclass(frozen=True, eq=False)
class Search:
    """What a search for the width found, in every draw."""

    name: str
    width_db: np.ndarray  # (draws,)
    error_m: np.ndarray  # (draws,) root mean square at the validation points
    evaluations: int

    @property
    def draws(self) -> int:
        return len(self.width_db)


def search_widths(trainings: Sequence[Training], anchors: np.ndarray, draws: int) -> list[Search]:
    """Search in every way: by golden section in each training, with flies as often as `draws` in the first."""
    own = [trainings[0].error] * draws
    return [
        _search(GOLDEN, lambda error, rng: golden_section(error), own[:1]),
        _search(TRAININGS, lambda error, rng: golden_section(error), [training.error for training in trainings]),
        _search(PAN, fruit_flies, own),
        _search(FLIES, lambda error, rng: anchor_flies(error, anchors / SIDE_M, rng), own),
        _search(FLIES_IN_M, lambda error, rng: anchor_flies(error, anchors, rng), own),
    ]


def _search(
    name: str, search: Callable[[WidthError, np.random.Generator], tuple[float, float]], errors: Sequence[WidthError]
) -> Search:
    """One draw for each error to be made small."""
    tried, found = [], []
    for draw, error in enumerate(errors):

        def smell(width: float, error: WidthError = error) -> float:
            tried.append(width)
            return error(width)

        found.append(search(smell, np.random.default_rng(draw)))
    widths, least = np.array(found).T
    return Search(name, widths, least, len(tried) // len(errors))


def anchor_flies(
    error: WidthError, anchors: np.ndarray, rng: np.random.Generator, iterations: int = ITERATIONS
) -> tuple[float, float]:
    """The width with the least error that flies find which set out from the anchors.

        X_i = x_i + d cos a,  Y_i = y_i + d sin a     d uniform in [d_min, d_max], a in [0, 2 pi)     (1)
        D_i = sqrt(X_i^2 + Y_i^2)                                                                     (2)
        S_i = 1 / D_i                                                                                 (3)

    S_i, cut off at the bounds, is the width at which fly i smells the error. The best place of all so far is where
    every fly sets out next. The formulas are lost in part: that d_min and d_max are the least and the greatest distance
    between two anchors, and that they bound a flight, is our reading.

    Args:
        anchors: (S, 2) x_i, y_i, from the origin in the field's corner, in any unit: S_i is in one over it.

    Returns: width, its error, after S * iterations evaluations.
    """
    apart = np.linalg.norm(anchors[:, None] - anchors, axis=-1)[np.triu_indices(len(anchors), 1)]
    place, best, least = anchors, np.nan, np.inf
    for _ in range(iterations):
        flight, angle = rng.uniform(apart.min(), apart.max(), len(anchors)), rng.uniform(0, 2 * np.pi, len(anchors))
        flies = place + flight[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        widths = np.clip(1 / (np.hypot(*flies.T) + 1e-12), LOW_DB, HIGH_DB)
        errors = [error(width) for width in widths]
        leader = int(np.argmin(errors))
        if errors[leader] < least:
            best, least, place = widths[leader], errors[leader], flies[leader]
    return float(best), float(least)
