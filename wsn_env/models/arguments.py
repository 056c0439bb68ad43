"""Arguments of public functions, held against their annotations: one rule for all."""

from __future__ import annotations

import collections.abc
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache, wraps
from inspect import Parameter, signature
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, ParamSpec, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

from wsn_env.models.quantity import NUMBERS, plain, short, suggest

P = ParamSpec("P")
R = TypeVar("R")
LISTS = (Sequence, Iterable, list, tuple)
WORDS = {
    NoneType: "None",
    bool: "True or False",
    int: "a whole number",
    float: "a number",
    str: "a text",
    Path: "a path",
    np.ndarray: "an array of numbers",
    collections.abc.Callable: "a function",
    Mapping: "a dict",
    dict: "a dict",
}


def checked_but(*own: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """A function that refuses arguments of other types than its annotations tell, before it does anything.

    NumPy's scalars and arrays of no dimension become Python's numbers. Annotations that say nothing here, such as Any,
    are left to the function.

    Args:
        own: arguments that the function checks itself, in words that tell more.

    Raises:
        ValueError: names the argument, its value and what is allowed.
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        taken = signature(function)
        kinds = {name: each.kind for name, each in taken.parameters.items()}
        named = {name for name, kind in kinds.items() if kind is not Parameter.VAR_KEYWORD} - set(own)

        @wraps(function)
        def call(*args: P.args, **kwargs: P.kwargs) -> R:
            try:
                given = taken.bind(*args, **kwargs)
            except TypeError:  # too many, too few: Python says it better
                return function(*args, **kwargs)
            hints = hints_of(function)
            for name in named & given.arguments.keys() & hints.keys():
                given.arguments[name] = check_argument(name, given.arguments[name], hints[name])
            return function(*given.args, **given.kwargs)

        return call

    return decorate


checked = checked_but()


def check_parameters(owner: Any, given: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    """Keywords for a class or function, held against what it tells of them; unknown ones as they are."""
    hints = hints_of(owner)
    return {name: check_argument(prefix + name, value, hints.get(name, Any)) for name, value in given.items()}


hints_of = cache(get_type_hints)


def check_argument(name: str, value: Any, hint: Any, error: type[ValueError] = ValueError) -> Any:
    """The value, NumPy's numbers as Python's.

    Raises:
        error: it is none of those that the annotation tells.
    """
    value = plain(value)
    if _fits(value, hint):
        return value
    words = [each for each in get_args(hint) if isinstance(each, str)] if get_origin(hint) is Literal else []
    if words and isinstance(value, str):
        raise error(f"{name} {short(repr(value))} is unknown: {suggest(value, words)}")
    raise error(f"{name} = {short(repr(value))}: must be {_words(hint)}")


def _fits(value: Any, hint: Any) -> bool:
    kind, parts = get_origin(hint) or hint, get_args(hint)
    if kind in (Union, UnionType):
        if str in parts and any(_is_class(part) and part not in WORDS for part in parts):
            return True  # a name that stands for an object: the function knows which there are
        return any(_fits(value, part) for part in parts)
    if kind is Literal:
        return any(type(value) is type(part) and value == part for part in parts)
    if kind is float:
        return isinstance(value, NUMBERS) and not isinstance(value, bool)
    if kind is int:
        return isinstance(value, int) and not isinstance(value, bool)
    if kind is Path:
        return isinstance(value, os.PathLike)
    if kind is np.ndarray:
        return isinstance(value, np.ndarray) and value.dtype.kind in "biuf"
    if kind in LISTS:
        fixed = kind is tuple and Ellipsis not in parts
        if fixed and parts and isinstance(value, (list, tuple)):
            return len(value) == len(parts) and all(map(_fits, map(plain, value), parts))
        items = isinstance(value, (Iterable, np.ndarray)) and not isinstance(value, (str, bytes, Mapping))
        return items and (not parts or kind is Iterable or all(_fits(plain(each), parts[0]) for each in value))
    if kind is collections.abc.Callable:
        return callable(value)
    if getattr(kind, "_is_protocol", False):
        return not isinstance(value, type) and all(callable(getattr(value, name, None)) for name in _methods(kind))
    return isinstance(value, kind) if _is_class(kind) else True


def _is_class(kind: Any) -> bool:
    """One that tells what belongs to it: no protocol."""
    return isinstance(kind, type) and kind not in (Any, object) and not getattr(kind, "_is_protocol", False)


def _methods(protocol: Any) -> list[str]:
    return [name for name, own in vars(protocol).items() if callable(own) and not name.startswith("_")]


def _words(hint: Any) -> str:
    kind, parts = get_origin(hint) or hint, get_args(hint)
    if getattr(kind, "_is_protocol", False):
        return f"a {kind.__name__}, with {' and '.join(_methods(kind))}"
    if kind in (Union, UnionType):
        return " or ".join(dict.fromkeys(_words(part) for part in parts))
    if kind is Literal:
        return f"one of {', '.join(map(repr, parts))}"
    if kind is tuple and Ellipsis not in parts:
        return f"{len(parts)} of {_words(parts[0])}".replace(" a ", " ")
    if kind in LISTS:
        return f"a list of {_words(parts[0])}".replace(" a ", " ") if parts else "a list"
    return WORDS.get(kind, f"a {getattr(kind, '__name__', kind)}")
