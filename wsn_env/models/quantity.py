"""Quantities that say what they mean and check what they are: the bricks of a scenario."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable
from dataclasses import dataclass, field, fields
from typing import Any
from unicodedata import category

import numpy as np

NO_TEXT = ("Cc", "Cs", "Zl", "Zp")  # Unicode's control characters, lone surrogates, separators of lines, paragraphs
NUMBERS: Any = (int, float, np.integer, np.floating)


class ScenarioError(ValueError):
    """A quantity is not what it may be; the message names it, its value and what is allowed."""


class UnknownQuantity(ScenarioError):
    """There is no quantity of this name."""

    def __init__(self, owner: str, name: str, known: Iterable[str]) -> None:
        super().__init__(f"{owner} has no quantity {name!r}: {suggest(name, known)}")
        self.owner, self.name, self.known = owner, name, tuple(known)

    def __reduce__(self) -> tuple[Any, ...]:
        return UnknownQuantity, (self.owner, self.name, self.known)


class UnknownKeyword(ScenarioError, TypeError):
    """An environment has no such argument, and its scenario no such quantity.

    Also a TypeError in Python's words: there are libraries that try arguments, and go by that.
    """

    def __init__(self, message: str) -> None:
        super().__init__(message.partition(" was raised from the environment creator")[0])  # which gym.make adds


def quantity(default: Any, meaning: str, **allowed: Any) -> Any:
    """A field with its meaning and what is allowed, in the words of `check_quantity`."""
    return field(default=default, metadata={"meaning": meaning, "allowed": allowed})


def described(default: Any, meaning: str) -> Any:
    """A field that its section checks itself."""
    return field(default=default, metadata={"meaning": meaning})


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
    drawn: bool = False,
) -> None:
    """Raise ScenarioError unless `value` is allowed for the field `name` of `owner`.

    Args:
        above, at_least, at_most, below: bounds.
        whole: whole numbers only.
        choices: these values only.
        optional: None too.
        drawn: also a pair (low, high) of them, between which it is drawn log-uniformly for each episode.
    """
    if value is None and optional:
        return
    if choices is not None:
        if value not in choices:
            raise ScenarioError(f"{owner}.{name} = {value!r:.80}: allowed are {', '.join(map(str, choices))}")
        return

    def fits(number: Any) -> bool:
        return (
            isinstance(number, NUMBERS)
            and not isinstance(number, bool)
            and abs(number) < math.inf
            and (not whole or number == int(number))
            and (above is None or number > above)
            and (at_least is None or number >= at_least)
            and (at_most is None or number <= at_most)
            and (below is None or number < below)
        )

    if drawn and isinstance(value, (tuple, list)):
        good = len(value) == 2 and all(map(fits, value)) and value[0] <= value[1] and (value[0] == 0) == (value[1] == 0)
    else:
        good = fits(value)
    if not good:
        bounds = (("above", above), ("at least", at_least), ("at most", at_most), ("below", below))
        given = [(words, bound) for words, bound in bounds if bound is not None]
        rules = " and ".join(f"{words} {bound if isinstance(bound, int) else f'{bound:g}'}" for words, bound in given)
        kind = f"{'a whole' if whole else 'a finite'} number {rules}".rstrip()
        pair = ", or a pair of such, 0 < low <= high" if drawn else ""
        raise ScenarioError(f"{owner}.{name} = {value!r:.80}: must be {kind}{pair}")


def whole_number(name: str, value: Any, least: int, most: int | None = None) -> int:
    """Python's int of an argument that may be NumPy's.

    Raises:
        ValueError: unless it is a whole number in least..most; the message names the argument.
    """
    value = plain(value)
    whole = isinstance(value, int) and not isinstance(value, bool)
    if not whole or value < least or (most is not None and value > most):
        rule = f"a whole number, at least {least}" if most is None else f"in {least}..{most}, a whole number"
        raise ValueError(f"{name} = {short(repr(value))}: must be {rule}")
    return int(value)


def plain(value: Any) -> Any:
    """Python's own number for one of NumPy (an array of no dimension, too), in tuples and lists too; anything else as
    it is."""
    if isinstance(value, np.generic) or (isinstance(value, np.ndarray) and value.ndim == 0):
        return value.item()
    return type(value)(map(plain, value)) if type(value) in (tuple, list) else value


@dataclass(frozen=True)
class Section:
    """Base of all sections: checks every quantity when it is made."""

    def __post_init__(self) -> None:
        for item in fields(self):
            value, allowed = plain(getattr(self, item.name)), item.metadata.get("allowed")
            if allowed is not None:
                if allowed.get("drawn") and isinstance(value, (np.ndarray, list)):
                    value = tuple(plain(list(value)))
                check_quantity(type(self).__name__, item.name, value, **allowed)
                if value is not None and "choices" not in allowed:
                    # 10 is 10.0: kernels are compiled for the types of constants.
                    number = int if allowed.get("whole") else float
                    value = tuple(map(number, value)) if isinstance(value, tuple) else number(value)
            object.__setattr__(self, item.name, value)


def span(value: float | tuple[float, float]) -> tuple[float, float]:
    """(lowest, highest) of a quantity that may be drawn for each episode."""
    return value if isinstance(value, tuple) else (value, value)


def short(text: str, most: int = 80) -> str:
    """A text for a message: on one line, cut where it is long."""
    text = " ".join(text.split())
    return text if len(text) <= most else f"{text[: most - 4]} ..."


def is_line(text: Any) -> bool:
    """Whether it is one line of text, as tables, pages, pictures and files can show it: no control characters."""
    return isinstance(text, str) and text.strip() != "" and not any(category(letter) in NO_TEXT for letter in text)


def suggest(name: str, known: Iterable[object]) -> str:
    """What to write instead of an unknown name."""
    names = sorted(map(str, known))
    near = difflib.get_close_matches(name, names, n=3, cutoff=0.5)
    return f"did you mean {' or '.join(near)}?" if near else f"known are {short(', '.join(names), 300) or 'none'}"


def parse_overrides(pairs: Iterable[str]) -> dict[str, Any]:
    """{"nodes": 400} from ["nodes=400"]; values are numbers, pairs of them (low..high), true/false, none, or words."""
    overrides: dict[str, Any] = {}
    for pair in pairs:
        name, equals, text = pair.partition("=")
        if not equals:
            raise ValueError(f"{pair!r}: must be name=value")
        words: dict[str, Any] = {"true": True, "false": False, "none": None}
        value: Any = words.get(text.lower(), text)
        if value is text:
            low, pair, high = text.partition("..")
            for kind in (int, float):
                try:
                    value = (float(low), float(high)) if pair else kind(text)
                    break
                except ValueError:
                    continue
        overrides[name] = value
    return overrides
