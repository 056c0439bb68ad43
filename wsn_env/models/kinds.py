"""Kinds: a measurement, a detection rule, a motion or a radio is one class in one file.

Its fields are its settings, `constants` makes the numbers of them that kernels read, and its static functions are what
it does, compiled. Kernels pick the functions by the *type* of the constants: each kind's record has a type of its own,
marked with its name and a stamp of its code, so that a kernel is compiled for the kinds that meet in a scenario, is
found again on disk while their code is the same, and never runs with a kind that it does not know.
"""

from __future__ import annotations

import inspect
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cache, partial
from importlib import import_module
from pkgutil import iter_modules
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numba import types
from numba.core.errors import TypingError
from numba.extending import overload

from wsn_env.compiled.arrays import record
from wsn_env.compiled.kernels import COUNTING, FAST, LEAN, fast, lean_piece
from wsn_env.compiled.stamp import plain_function, stamp
from wsn_env.models.quantity import ScenarioError, Section

if TYPE_CHECKING:
    from wsn_env.scenario import Scenario


@dataclass(frozen=True)
class Kind(Section):
    """Base of all kinds. A role (measurement, ...) is a direct subclass; its kinds are that class's subclasses."""

    abstract: ClassVar[bool] = True  # no kind itself; said by each base class anew
    role: ClassVar[str]
    required: ClassVar[tuple[str, ...]]  # functions that every kind of the role has to have
    optional: ClassVar[tuple[str, ...]]  # functions for which the role has a default

    allocates: ClassVar[bool] = True  # whether its functions may make arrays; those that need not are a little faster

    def constants(self, scenario: Scenario) -> dict[str, float]:
        """Numbers for the kind's functions, by name; here every setting that is a number.

        Args:
            scenario: the Scenario that the kind is part of.
        """
        values: dict[str, Any] = {item.name: getattr(self, item.name) for item in fields(self)}
        optional = [item.name for item in fields(self) if item.metadata.get("allowed", {}).get("optional")]
        values |= {name: np.nan for name in optional if values[name] is None}  # the type must not hang on the value
        kinds: Any = int, float, np.number
        return {name: value for name, value in values.items() if isinstance(value, kinds)}

    def check_functions(self) -> None:
        """Raise ScenarioError unless the kind has every function that its role requires."""
        for name in self.required:
            if not callable(getattr(type(self), name, None)):
                a_role = f"{'an' if self.role[0] in 'aeiou' else 'a'} {self.role}"
                raise ScenarioError(
                    f"{type(self).__name__} has no {name}(...): {a_role} must have {', '.join(self.required)}"
                )


_chosen: deque[Any] = deque(maxlen=20)
_marked: dict[str, type[Kind]] = {}  # kinds by the mark in the type of their constants; of those alike, any


def constants_type(kind: Kind, scenario: Scenario) -> np.dtype[np.void]:
    """The type of a kind's record of constants: its mark, and the constants by name.

    Kinds that do the same (by settings alone do the shipped radios differ) have one type, so that one kernel does.
    """
    kind.check_functions()
    numbers = kind.constants(scenario)
    own: Any = type(kind)  # mypy takes no class of dataclasses for hashable
    mark = f"{kind.role.replace(' ', '_')}_{_code_stamp(own)}"
    _marked[mark] = own
    return record([(mark, "i1"), *((name, _number_type(value)) for name, value in numbers.items())])


def fill_constants(row: np.ndarray, kind: Kind, scenario: Scenario) -> None:
    """Write a kind's constants into its record."""
    for name, value in kind.constants(scenario).items():
        row[name] = value


def made_constants(kind: Kind, scenario: Scenario) -> np.ndarray:
    """A kind's constants, an array of one."""
    made = np.zeros(1, constants_type(kind, scenario))
    fill_constants(made, kind, scenario)
    return made


def _number_type(value) -> str:
    return "i8" if isinstance(value, (bool, int, np.integer)) else "f8"


@cache
def _code_stamp(kind: type[Kind]) -> str:
    own: dict[str, Any] = {name: inspect.getattr_static(kind, name, None) for name in (*kind.required, *kind.optional)}
    compiled = {name: plain_function(each) for name, each in sorted(own.items()) if isinstance(each, staticmethod)}
    named = [(name, each.__module__, each.__qualname__) for name, each in compiled.items() if each is not None]
    return stamp(*compiled.values(), more=[kind.allocates, *named])


def by_kind(function: Callable[..., Any]) -> Any:
    """What kernels call for a role's function: that of the kind whose constants are the first argument.

    Args:
        function: of the role, for its name.
    """
    dispatching = _dispatcher(function, False)
    dispatching.fast_twin = _dispatcher(function, True)
    return dispatching


def _dispatcher(function: Callable, quick: bool) -> Any:
    name = function.__name__

    def dispatching(constants, *arguments):  # in plain Python
        return getattr(_kind_of(constants.dtype.names[0], name), name)(constants, *arguments)

    dispatching.__module__, dispatching.__doc__ = function.__module__, function.__doc__
    dispatching.__qualname__ = f"by_kind.{name}{'_fast' if quick else ''}"
    for allocates, options in ((True, COUNTING), (False, LEAN)):
        chosen = partial(_implementation, name, allocates, quick)
        more = {"fastmath": FAST} if quick else {}
        overload(dispatching, jit_options=options | more, strict=False)(_typing(chosen))
    return dispatching


def _typing(choose: Callable[[Any], Any]) -> Callable[..., Any]:
    def typing(constants, *arguments):
        return choose(constants)

    return typing


def _implementation(name: str, allocates: bool, quick: bool, constants: Any) -> Any:
    """A kind's function, if it may allocate as said; else None."""
    if not isinstance(constants, types.Record):
        raise TypingError(f"{name}: takes a kind's constants first, not {constants}")
    kind = _kind_of(next(iter(constants.fields)), name)
    if kind.allocates != allocates:
        return None
    own = plain_function(getattr(kind, name))
    _chosen.append(own)
    return _quick(own) if quick else own


def chosen_codes() -> list[Any]:
    """The code of the functions that kernels were last compiled with: where compiling fails, one of the last."""
    return [function.__code__ for function in _chosen]


def _kind_of(mark: str, name: str) -> type[Kind]:
    kind = _marked.get(mark)
    if kind is None:
        raise TypingError(f"{name}: {mark} marks no kind")
    if getattr(kind, name, None) is None:
        raise TypingError(f"{kind.__name__} has no {name}(...)")
    return kind


@cache
def _quick(function: Any) -> Any:
    return fast(lean_piece(function)).py_func


class Registry:
    """The kinds of a role by name: that of the file in the role's package that the class stands in."""

    def __init__(self, role: type[Kind], package: str) -> None:
        self.role: type[Kind] = role
        self._package = package

    @property
    def kinds(self) -> dict[str, type[Kind]]:
        """Every shipped kind."""
        role: Any = self.role  # as in `constants_type`
        return _found(role, self._package)


@cache
def _found(role: type[Kind], package: str) -> dict[str, type[Kind]]:
    found: dict[str, type[Kind]] = {}
    for module in iter_modules(import_module(package).__path__, f"{package}."):
        for value in vars(import_module(module.name)).values():
            if isinstance(value, type) and issubclass(value, role) and value.__module__ == module.name:
                if not vars(value).get("abstract", False):
                    found[module.name.rpartition(".")[2]] = value
    return found
