"""A number of an observation: what it means, its unit, its range."""

from __future__ import annotations

from typing import NamedTuple

BOUND = 10.0  # what observations are clipped to, above and below


class Feature(NamedTuple):
    """One of a table {name: Feature} whose order is that of the columns."""

    meaning: str
    unit: str = ""
    low: float = -BOUND
    high: float = BOUND


def share(meaning: str) -> Feature:
    """Of a whole, or a probability."""
    return Feature(meaning, "", 0.0, 1.0)


def flag(meaning: str) -> Feature:
    """0 or 1."""
    return Feature(meaning, "0 or 1", 0.0, 1.0)


def amount(meaning: str, unit: str = "") -> Feature:
    """Not negative."""
    return Feature(meaning, unit, 0.0)
