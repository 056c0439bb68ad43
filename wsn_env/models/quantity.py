"""Quantities that say what they mean and check what they are: the bricks of a scenario."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

NUMBERS: Any = (int, float, np.integer, np.floating)


class ScenarioError(ValueError):
    """A quantity is not what it may be; the message names it, its value and what is allowed."""


def quantity(default: Any, meaning: str, **allowed: Any) -> Any:
    """A field with its meaning and what is allowed, in the words of `check_quantity`."""
    return field(default=default, metadata={"meaning": meaning, "allowed": allowed})


def check_quantity(  # noqa: PLR0913
    owner: str,
    name: str,
    value: Any,
    *,
    above: float | None = None,
    at_least: float | None = None,
    at_most: float | None = None,
    below: float | None = None,
    whole: bool = False,
    choices: tuple[Any, ...] | None = None,
    optional: bool = False,
) -> None:
    """Raise ScenarioError unless `value` is allowed for the field `name` of `owner`.

    Args:
        above, at_least, at_most, below: bounds.
        whole: whole numbers only.
        choices: these values only.
        optional: None too.
    """
    if value is None and optional:
        return
    if choices is not None:
        if value not in choices:
            raise ScenarioError(f"{owner}.{name} = {value!r}: allowed are {', '.join(map(str, choices))}")
        return
    good = (
        isinstance(value, NUMBERS)
        and not isinstance(value, bool)
        and abs(value) < math.inf
        and (not whole or value == int(value))
        and (above is None or value > above)
        and (at_least is None or value >= at_least)
        and (at_most is None or value <= at_most)
        and (below is None or value < below)
    )
    if not good:
        bounds = (("above", above), ("at least", at_least), ("at most", at_most), ("below", below))
        rules = " and ".join(f"{words} {bound}" for words, bound in bounds if bound is not None)
        kind = "a whole number" if whole else "a finite number"
        raise ScenarioError(f"{owner}.{name} = {value!r}: must be {kind} {rules}".rstrip())


@dataclass(frozen=True)
class Section:
    """Base of all sections: checks every quantity when it is made."""

    def __post_init__(self) -> None:
        for item in fields(self):
            if "allowed" in item.metadata:
                value, allowed = getattr(self, item.name), item.metadata["allowed"]
                check_quantity(type(self).__name__, item.name, value, **allowed)
                if allowed.get("whole") and value is not None:
                    object.__setattr__(self, item.name, int(value))


def suggest(name: str, known: Iterable[object]) -> str:
    """What to write instead of an unknown name."""
    names = sorted(map(str, known))
    near = difflib.get_close_matches(name, names, n=3, cutoff=0.5)
    return f"did you mean {' or '.join(near)}?" if near else f"known are {', '.join(names) or 'none'}"


def parse_overrides(pairs: Iterable[str]) -> dict[str, Any]:
    """{"nodes": 400} from ["nodes=400"]; values are numbers, true/false, none, or words."""
    overrides: dict[str, Any] = {}
    for pair in pairs:
        name, equals, text = pair.partition("=")
        if not equals:
            raise ValueError(f"{pair!r}: must be name=value")
        words: dict[str, Any] = {"true": True, "false": False, "none": None}
        value: Any = words.get(text.lower(), text)
        if value is text:
            for kind in (int, float):
                try:
                    value = kind(text)
                    break
                except ValueError:
                    continue
        overrides[name] = value
    return overrides
