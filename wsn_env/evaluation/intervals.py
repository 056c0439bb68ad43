"""Bootstrap intervals and standard errors over episodes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from math import floor, inf, isfinite, log10
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

RESAMPLES = 2000
DRAWN_SETS = 200  # for a standard error
KEPT_EPISODES = 5000  # the resamples of more take too much memory to keep


@dataclass(frozen=True)
class Summary:
    """A mean, or another figure, and its 95 % bootstrap interval."""

    mean: float
    low: float
    high: float

    def __repr__(self) -> str:
        return f"Summary({self.text})"

    @property
    def text(self) -> str:
        """Rounded to what the interval tells: "-120.3 [-121.5, -119.1]"."""
        width, values = self.high - self.low, (self.mean, self.low, self.high)
        if not 0.0 < width < inf:
            mean, low, high = (f"{value:.6g}" for value in values)
        else:
            digits = max(0, min(9, 1 - floor(log10(width))))
            mean, low, high = (f"{value:.{digits}f}" for value in values)
        return f"{mean} [{low}, {high}]"

    @classmethod
    def of(cls, values: ArrayLike) -> Summary:
        """Percentile bootstrap over episodes, with a fixed seed; no interval for a single episode."""
        episode_values = np.asarray(values, dtype=float)
        if len(episode_values) < 2 or np.ptp(episode_values) == 0:
            return cls(float(episode_values.mean()), float(episode_values.min()), float(episode_values.max()))
        return cls.around(episode_values.mean(), resampled_means(episode_values))

    @classmethod
    def of_root_ratio(cls, values: np.ndarray, references: np.ndarray) -> Summary:
        """sqrt(mean(values) / mean(references)) of pairs, the interval as in `of`."""
        ratio = float(np.sqrt(np.mean(values) / np.mean(references)))
        if len(values) < 2:
            return cls(ratio, ratio, ratio)
        means = resampled_means(np.stack([values, references], axis=1))
        return cls.around(ratio, np.sqrt(means[:, 0] / means[:, 1]))

    @classmethod
    def around(cls, value: float, resampled: np.ndarray) -> Summary:
        """A value and the middle 95 % of what resamples gave for it."""
        low, high = np.percentile(resampled, [2.5, 97.5])
        return cls(float(value), float(low), float(high))


class Measured(NamedTuple):
    """A measured figure and its standard error; as text "1.23 (0.04)", two digits of the error."""

    value: float
    stderr: float

    @classmethod
    def mean(cls, values: np.ndarray) -> Measured:
        """Of values (episodes,)."""
        return cls(float(np.mean(values)), standard_error(values))

    @classmethod
    def ratio(cls, over: np.ndarray, under: np.ndarray) -> Measured:
        """Ratio of the means of pairs (episodes,), by the delta method."""
        found = float(np.mean(over) / np.mean(under))
        return cls(found, standard_error(over - found * under) / float(np.mean(under)))

    @classmethod
    def root_mean(cls, squares: np.ndarray) -> Measured:
        """Root of the mean of squares (episodes,), by the delta method."""
        return cls.mean(squares).root()

    @classmethod
    def root_ratio(cls, squares: np.ndarray, others: np.ndarray) -> Measured:
        """Root of the ratio of the means of squares in pairs (episodes,), by the delta method."""
        return cls.ratio(squares, others).root()

    @classmethod
    def bootstrap(cls, statistic: Callable[[np.ndarray], float], episodes: int) -> Measured:
        """A statistic of all episodes; its standard error is its sd over sets of them drawn with replacement.

        Args:
            statistic: of the episodes by number (episodes,); sets of which it is NaN are left out.
        """
        rng = np.random.default_rng(0)
        values = np.array([statistic(rng.integers(episodes, size=episodes)) for _ in range(DRAWN_SETS)])
        values = values[np.isfinite(values)]
        return cls(statistic(np.arange(episodes)), float(values.std()) if len(values) > 1 else float("nan"))

    def root(self) -> Measured:
        """The figure's square root."""
        root = self.value**0.5
        return Measured(root, self.stderr / (2 * root))

    def __str__(self) -> str:
        if not isfinite(self.stderr) or self.stderr <= 1e-12 * abs(self.value):  # rounding is no doubt
            return f"{self.value:.4g}"
        digits = max(0, 1 - floor(log10(self.stderr)))
        return f"{self.value:.{digits}f} ({self.stderr:.{digits}f})"


def standard_error(values: np.ndarray) -> float:
    """Of the mean of values (episodes,)."""
    return float(np.std(values, ddof=1) / len(values) ** 0.5)


def resampled_means(values: np.ndarray) -> np.ndarray:
    """Means over RESAMPLES bootstrap samples of the episodes, the same for all quantities of so many episodes.

    Args:
        values: (episodes, ...).

    Returns: (RESAMPLES, ...).
    """
    flat = np.asarray(values, float).reshape(len(values), -1)
    means = np.concatenate([shares @ flat for shares in _resampling_weights(len(values))])
    return means.reshape(RESAMPLES, *np.shape(values)[1:])


def _resampling_weights(episodes: int) -> Iterable[np.ndarray]:
    """How often each episode is in each sample, over their number, some samples at a time; kept if not too many."""
    return _cached_resampling_weights(episodes) if episodes <= KEPT_EPISODES else _draw_resampling_weights(episodes)


@lru_cache(maxsize=4)
def _cached_resampling_weights(episodes: int) -> list[np.ndarray]:
    return list(_draw_resampling_weights(episodes))


def _draw_resampling_weights(episodes: int) -> Iterator[np.ndarray]:
    rng, at_once = np.random.default_rng(0), 100
    for _ in range(RESAMPLES // at_once):
        drawn = rng.integers(episodes, size=(at_once, episodes)) + episodes * np.arange(at_once)[:, None]
        yield np.bincount(drawn.ravel(), minlength=at_once * episodes).reshape(at_once, episodes) / episodes
