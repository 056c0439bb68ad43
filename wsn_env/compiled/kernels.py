"""How kernels are compiled: `kernel` for what Python calls, `piece` for what kernels are made of.

`lean_kernel` and `lean_piece` do without Numba's reference counts, an atomic operation for every row of an array taken,
which cost more than a period's physics. They must allocate nothing: Numba raises "NRT required" where one does.

Strict by construction: no fastmath, no BLAS, no libm; `fast` compiles the same source a second time without that. The
GIL is released, so that `over_rows` can share a batch among threads; rows never meet, so the number of threads cannot
change a bit.
"""

import functools
import hashlib
import os
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import FunctionType

import numba
import numpy as np
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.dispatcher import Dispatcher

PACKAGE = Path(__file__).parents[1]
SERIAL_ROWS = 8  # up to here one thread is faster than handing work out

FAST = {"reassoc", "contract", "arcp", "nsz"}  # not nnan, ninf: infinities and NaN mean what they mean
FAST_MODULES = (  # the filter; the world stays strict
    "wsn_env.filters.kernels",
    "wsn_env.filters.likelihood",
    "wsn_env.filters.resampling",
    "wsn_env.compiled.elementary",
    "wsn_env.compiled.draws",
)

# fastmath=False is said aloud: a piece that says nothing takes over what its first caller has.
piece = numba.njit(error_model="numpy", nogil=True, fastmath=False, _nrt=True)
inline_piece = numba.njit(error_model="numpy", nogil=True, fastmath=False, _nrt=True, forceinline=True)  # in long loops
lean_piece = numba.njit(error_model="numpy", nogil=True, fastmath=False, _nrt=False)
spliced = numba.njit(error_model="numpy", nogil=True, fastmath=False, _nrt=False, inline="always")  # may return arrays


def kernel(function):
    """Compile a function for Python to call, cached on disk."""
    return _cached(piece(function))


def lean_kernel(function):
    """A kernel of lean pieces only."""
    return _cached(lean_piece(function))


@functools.cache
def fast(dispatcher):
    """The twin of a kernel or piece whose sums and products the compiler may regroup and fuse.

    Its results agree to rounding, but differ from processor to processor. The pieces that the function names get a
    twin of their own, since a function compiled once keeps its rules wherever it is called from; pieces of other than
    FAST_MODULES stay strict, and so do those named through their module (`draws.stream`). The twin's own name keeps
    the two apart in the cache.
    """
    function = dispatcher.py_func
    seen = {name: function.__globals__.get(name) for name in function.__code__.co_names}
    pieces = {name: value for name, value in seen.items() if isinstance(value, Dispatcher)}
    twins = {name: fast(value) for name, value in pieces.items() if value.py_func.__module__ in FAST_MODULES}
    twin = FunctionType(function.__code__, function.__globals__ | twins, function.__name__, function.__defaults__)
    twin.__qualname__ = f"{function.__qualname__}_fast"
    compiled = numba.jit(**dispatcher.targetoptions | {"fastmath": FAST})(twin)
    return _cached(compiled) if isinstance(dispatcher._cache, _PackageCache) else compiled


def _cached(dispatcher):
    try:
        dispatcher._cache = _PackageCache(dispatcher.py_func)
    except RuntimeError:  # no folder that could be written to: compiled anew in every process
        pass
    return dispatcher


class _PackageCache(FunctionCache):
    """Numba's cache, stale as soon as *any* file with kernels changes.

    Numba looks at the kernel's own file only and would serve old code after an edit in a file of its pieces.
    """

    def __init__(self, function):
        super().__init__(function)
        self._cache_file = IndexDataCacheFile(
            cache_path=self._cache_path,
            filename_base=self._impl.filename_base,
            source_stamp=(self._impl.locator.get_source_stamp(), kernels_stamp()),
        )

    def load_overload(self, sig, target_context):
        found = super().load_overload(sig, target_context)
        if found is None:
            _announce()
        return found


@functools.cache
def kernels_stamp() -> str:
    """Digest of every file of the package that has kernels."""
    texts = (path.read_bytes() for path in sorted(PACKAGE.rglob("*.py")))
    return hashlib.sha256(b"".join(text for text in texts if b"compiled.kernels" in text)).hexdigest()


@functools.cache
def _announce() -> None:
    say = "wsn_env: compiling (once on this machine, up to a minute; `wsn compile` does all of it) ..."
    print(say, file=sys.stderr, flush=True)


_pools: dict[int, ThreadPoolExecutor] = {}
os.register_at_fork(after_in_child=_pools.clear)  # a child has none of its parent's threads


def over_rows(kernel, rows: int, threads: int, *arguments) -> int:
    """Call kernel(start, stop, *arguments) over 0..rows, shared among threads.

    Args:
        kernel: works on rows start..stop - 1 only.
        rows: B.
        threads: how many to use at most; a small batch stays in the caller's.

    Returns: the sum of what the calls return (rows that they count), 0 for nothing.
    """
    if threads == 1 or rows <= SERIAL_ROWS:
        return kernel(0, rows, *arguments) or 0
    if threads not in _pools:
        _pools[threads] = ThreadPoolExecutor(threads - 1, thread_name_prefix="wsn_env")
    bounds = [rows * i // threads for i in range(threads + 1)]
    others = [_pools[threads].submit(kernel, a, b, *arguments) for a, b in zip(bounds[1:], bounds[2:]) if b > a]
    own = kernel(0, bounds[1], *arguments) or 0
    return own + sum(job.result() or 0 for job in others)


def threads_for(marked, threads: int) -> int:
    """How many threads serve a kernel that works in the marked rows (B,) only: waking them for a few takes longer."""
    return threads if np.count_nonzero(marked) > SERIAL_ROWS else 1


def available_threads() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
