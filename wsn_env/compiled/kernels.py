"""How kernels are compiled: `kernel` for what Python calls, `piece` for what kernels are made of.

Strict by construction: no fastmath, no BLAS, no libm; `fast` compiles the same source a second time without that. The
GIL is released, so that `over_rows` can share a batch among threads; rows never meet, so the number of threads cannot
change a bit. With NUMBA_DISABLE_JIT=1 everything runs as plain Python.

`lean_kernel` and `lean_piece` do without Numba's reference counts, an atomic operation for every row of an array taken,
which cost more than a period's physics. They must allocate nothing: Numba raises "NRT required" where one does. Nor may
a lean piece return an array to one that counts, which would give it up once too often: what needs room for its rows is
a `kernel` that makes it and hands it on to a lean piece. Where Numba does not know that option, it counts.
"""

from __future__ import annotations

import functools
import os
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from types import FunctionType
from typing import Any, TypeVar

import numba
import numpy as np
from numba.core.options import DefaultOptions

from wsn_env.compiled import store

F = TypeVar("F", bound=Callable[..., Any])

_opening = threading.RLock()
SERIAL_ROWS = 8  # up to here one thread is faster than handing work out
MANY_ROWS = 512  # the same for short work: up to a tenth of a microsecond a row

FAST = {"reassoc", "contract", "arcp", "nsz"}  # not nnan, ninf: infinities and NaN mean what they mean
FAST_MODULES = (  # the filter; the world stays strict
    "wsn_env.filters.kernels",
    "wsn_env.filters.likelihood",
    "wsn_env.filters.resampling",
    "wsn_env.models.association.robust",
    "wsn_env.compiled.elementary",
    "wsn_env.compiled.draws",
)


def _options(**wanted: Any) -> dict[str, Any]:
    """Options of njit; without those that this Numba does not know."""
    # fastmath=False is said aloud: a piece that says nothing takes over what its first caller has.
    wanted["no_cfunc_wrapper"] = True  # for C's callbacks, of which there are none: 6 % of the time of compiling
    known = {name: value for name, value in wanted.items() if hasattr(DefaultOptions, name)}
    return {"nopython": True, "error_model": "numpy", "nogil": True, "fastmath": False} | known


COUNTING: dict[str, Any]
LEAN: dict[str, Any]
COUNTING, LEAN = _options(_nrt=True), _options(_nrt=False)


def _compile(function: F, options: dict[str, Any]) -> F:
    return function if numba.config.DISABLE_JIT else numba.jit(**options)(function)


def piece(function: F) -> F:
    """Compile a function for kernels to call."""
    return _compile(function, COUNTING)


def inline_piece(function: F) -> F:
    """A piece that is copied into whoever calls it: for long loops."""
    return _compile(function, COUNTING | _options(forceinline=True))


def lean_piece(function: F) -> F:
    """A piece that allocates nothing."""
    return _compile(function, LEAN)


class Kernel:
    """A compiled function for Python to call, kept on disk; it is made when it is first called.

    One that takes a scenario's constants (an argument `cs`) is made for each type of them, that is for each combination
    of kinds, and each has a place of its own on disk: two processes never write to one place about different kinds.
    """

    def __init__(self, function: FunctionType, options: dict[str, Any], twin_of: Kernel | None = None) -> None:
        functools.update_wrapper(self, function)
        self.twin_of = twin_of  # of a `fast` one
        self.py_func: FunctionType = function
        self.targetoptions: dict[str, Any] = options
        names = function.__code__.co_varnames[: function.__code__.co_argcount]
        self._place = names.index("cs") if "cs" in names else -1
        self._made: dict[int, tuple[Any, np.dtype]] = {}  # by the type's identity: the compiled function, and the type
        self.call: Callable[..., Any] = self._by_kind if self._place >= 0 else self._first

    def __call__(self, *arguments: Any) -> Any:
        return self.call(*arguments)

    def _by_kind(self, *arguments: Any) -> Any:
        made = self._made.get(id(arguments[self._place].dtype))
        return made[0](*arguments) if made else self._first(*arguments)

    def made_for(self, arguments: tuple[Any, ...]) -> Callable[..., Any]:
        """What is called for such arguments, which have been met before: without Numba's look at their types."""
        if numba.config.DISABLE_JIT:
            return self.call
        dispatcher: Any = self.call if self._place < 0 else self._made[id(arguments[self._place].dtype)][0]
        return dispatcher.overloads[tuple(map(dispatcher.typeof_pyval, arguments))].entry_point

    def _first(self, *arguments: Any) -> Any:
        if numba.config.DISABLE_JIT:
            self.call = np.errstate(over="ignore")(self.py_func)  # random bits wrap around
            return self.call(*arguments)
        with _opening:  # one thread opens it, the others find it
            if self._place < 0:
                if self.call == self._first:
                    self.call, result = store.open_kernel(self.py_func, self.targetoptions, arguments)
                    return result
                return self.call(*arguments)
            kinds = arguments[self._place].dtype
            known = next((made for made, other in self._made.values() if other == kinds), None)
            if known is None:
                made, result = store.open_kernel(self.py_func, self.targetoptions, arguments, kinds)
                self._made[id(kinds)] = made, kinds
                return result
            self._made[id(kinds)] = known, kinds  # another object of a type that is known
        return known(*arguments)

    def __reduce__(self) -> Any:
        if self.twin_of is not None:
            return fast, (self.twin_of,)
        return vars(self)["__qualname__"]  # of its module: pickled by name, as functions are


class Pinned:
    """A kernel for an owner whose arguments are always of the same types: those are looked up at the first call alone.

    To look them up takes longer than a short kernel. Nothing checks later arguments but for their number, and of arrays
    the dimensions and the size of an element.
    """

    def __init__(self, kernel: Kernel) -> None:
        self._kernel = kernel
        self.call: Callable[..., Any] = self._first

    def __call__(self, *arguments: Any) -> Any:
        return self.call(*arguments)

    def _first(self, *arguments: Any) -> Any:
        result = self._kernel.call(*arguments)
        self.call = self._kernel.made_for(arguments)
        return result

    def __reduce__(self) -> tuple[Any, ...]:
        return Pinned, (self._kernel,)


def kernel(function: Any) -> Kernel:
    """Compile a function for Python to call, cached on disk."""
    return Kernel(function, COUNTING)


def lean_kernel(function: Any) -> Kernel:
    """A kernel of lean pieces only."""
    return Kernel(function, LEAN)


@functools.cache
def fast(compiled: Any) -> Any:
    """The twin of a kernel or piece whose sums and products the compiler may regroup and fuse.

    Its results agree to rounding, but differ from processor to processor. The pieces that the function names get a
    twin of their own, since a function compiled once keeps its rules wherever it is called from; pieces of other than
    FAST_MODULES stay strict, and so do those named through their module (`draws.stream`).
    """
    if numba.config.DISABLE_JIT:
        return compiled
    function = compiled.py_func
    named = {name: function.__globals__.get(name) for name in function.__code__.co_names}
    twins = {name: fast(value) for name, value in named.items() if _has_twin(value)}
    twins |= {name: value.fast_twin for name, value in named.items() if hasattr(value, "fast_twin")}  # by kind
    twin = FunctionType(function.__code__, function.__globals__ | twins, function.__name__, function.__defaults__)
    twin.__qualname__, twin.__module__ = f"{function.__qualname__}_fast", function.__module__
    options = compiled.targetoptions | {"fastmath": FAST}
    return Kernel(twin, options, compiled) if isinstance(compiled, Kernel) else numba.jit(**options)(twin)


def _has_twin(value: Any) -> bool:
    function = getattr(value, "py_func", None)
    return function is not None and not isinstance(value, Kernel) and function.__module__ in FAST_MODULES


_pools: dict[int, ThreadPoolExecutor] = {}
if hasattr(os, "register_at_fork"):  # not on Windows
    os.register_at_fork(after_in_child=_pools.clear)  # a child has none of its parent's threads


def over_rows(kernel: Any, rows: int, threads: int, *arguments: Any, together: int = 1) -> int:
    """Call kernel(start, stop, *arguments) over 0..rows, shared among threads.

    Args:
        kernel: works on rows start..stop - 1 only.
        rows: B.
        threads: how many to use at most; a small batch stays in the caller's.
        together: rows 0..together - 1 are one thread's, and so on.

    Returns: the sum of what the calls return (rows that they count), 0 for nothing.
    """
    if threads == 1 or rows <= SERIAL_ROWS:
        return kernel.call(0, rows, *arguments) or 0
    if threads not in _pools:
        _pools[threads] = ThreadPoolExecutor(threads - 1, thread_name_prefix="wsn_env")
    bounds = [rows // together * i // threads * together for i in range(threads + 1)]
    others = [_pools[threads].submit(kernel, a, b, *arguments) for a, b in zip(bounds[1:], bounds[2:]) if b > a]
    own = kernel(0, bounds[1], *arguments) or 0
    return own + sum(job.result() or 0 for job in others)


def bind(kernel: Any, rows: int, threads: int, *arguments: Any) -> Callable[[], int]:
    """`over_rows` for arguments that stay, as a function of none: for a few rows, quicker.

    Args:
        kernel: Pinned, that has been called.
    """
    if threads == 1 or rows <= SERIAL_ROWS:
        return functools.partial(kernel.call, 0, rows, *arguments)
    return functools.partial(over_rows, kernel, rows, threads, *arguments)


def threads_for(marked: np.ndarray, threads: int) -> int:
    """How many threads serve a kernel that works in the marked rows (B,) only: waking them for a few takes longer."""
    return threads if threads > 1 and np.count_nonzero(marked) > SERIAL_ROWS else 1


def threads_for_short(rows: int, threads: int) -> int:
    """How many threads serve a kernel whose work in a row is short."""
    return threads if rows >= MANY_ROWS else 1


@functools.cache
def every_row(rows: int) -> np.ndarray:
    """(B,) bool, all marked; not to be written to."""
    return np.ones(rows, bool)


def available_threads() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
