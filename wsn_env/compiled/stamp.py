"""What a compiled function is made of, as a digest: the code and the constants of everything that it reaches.

Comments, docstrings, line numbers and the names of files do not count, so that editing them compiles nothing anew. A
constant counts wherever it stands, for whoever uses it.
"""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Iterator
from functools import cache
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numba
import numpy as np

DIGITS = 16  # of a stamp


def stamp(*functions: Any, more: object = "") -> str:
    """Hexadecimal digest of some functions and of all that they reach, alike in every process.

    Args:
        functions: Python's or Numba's.
        more: anything else whose repr counts.
    """
    reached: dict[Any, str] = {}
    waiting: list[Any] = [plain_function(function) for function in functions]
    while waiting:
        function = waiting.pop()
        if function not in reached:
            own, others = _contents(function)
            reached[function] = own
            waiting += others
    texts = sorted(f"{function.__module__}.{function.__qualname__} {own}" for function, own in reached.items())
    whole = "\n".join([numba.__version__, np.__version__, repr(more), *texts])
    return hashlib.sha256(whole.encode()).hexdigest()[:DIGITS]


def options_text(options: dict[str, Any]) -> str:
    """Options of compilation, alike in every process."""
    plain = {name: sorted(value) if isinstance(value, (set, frozenset)) else value for name, value in options.items()}
    return repr(sorted(plain.items()))


def plain_function(value: Any) -> FunctionType | None:
    """The Python function behind a compiled one, an intrinsic or a method; None: there is none."""
    for name in ("py_func", "__func__", "__wrapped__"):
        value = getattr(value, name, value)
    return value if isinstance(value, FunctionType) else None


@cache
def _contents(function: FunctionType) -> tuple[str, list[FunctionType]]:
    """What a function itself is, as text, and the functions that it names."""
    code, doc = function.__code__, function.__doc__
    texts, others = [f"{part}" for part in _code(code, doc)], []
    texts.append(repr(function.__defaults__))
    for name, value in sorted(_named(function).items(), key=lambda pair: pair[0]):
        other = plain_function(value)
        if other is not None:
            options, layout = getattr(value, "targetoptions", {}), getattr(value, "__kernel_layout__", "")
            texts.append(f"{name}: {other.__module__}.{other.__qualname__} {options_text(options)} {layout}")
            others.append(other)
        else:
            texts.append(f"{name} = {_value(value)}")
    return hashlib.sha256("\n".join(texts).encode()).hexdigest(), others


def _code(code: CodeType, doc: str | None) -> Iterator[object]:
    yield code.co_code.hex()
    yield code.co_names
    yield code.co_argcount, code.co_kwonlyargcount
    for place, constant in enumerate(code.co_consts):
        if isinstance(constant, CodeType):
            yield from _code(constant, None)
        elif place > 0 or constant != doc:
            yield repr(constant)


def _named(function: FunctionType) -> dict[str, object]:
    """The globals and the variables of outer functions that a function uses; of a module, the members."""
    names = set(_all_names(function.__code__))
    found = {name: function.__globals__[name] for name in names if name in function.__globals__}
    for name, value in inspect.getclosurevars(function).nonlocals.items():
        found[name] = value
    for module in [value for value in found.values() if isinstance(value, ModuleType)]:
        if module.__name__.partition(".")[0] not in ("numpy", "math", "numba"):
            found |= {f"{module.__name__}.{name}": getattr(module, name) for name in names if hasattr(module, name)}
    return found


def _all_names(code: CodeType) -> Iterator[str]:
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _all_names(constant)


def _value(value: object) -> str:
    if isinstance(value, ModuleType):
        return value.__name__
    if isinstance(value, np.ndarray):
        return f"{value.dtype} {value.shape} {value.tobytes().hex()}"
    if isinstance(value, dict):  # kernels read none; what is kept in them changes
        return "dict"
    if isinstance(value, type):
        return f"{value.__module__}.{value.__qualname__} {getattr(value, '_fields', '')}"
    if callable(value):
        return f"{getattr(value, '__module__', '')}.{getattr(value, '__qualname__', type(value).__qualname__)}"
    return repr(value)
