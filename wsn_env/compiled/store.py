"""Compiled kernels on disk, by content.

Each kernel has a folder named by the stamp of all that it reaches (`stamp`), and in it a file that Numba takes for the
kernel's source; Numba's own cache (`cache=True`) does the rest beside it. So a kernel is found again exactly while
nothing that it computes has changed, whatever happened to files, lines and docstrings.

The folder is NUMBA_CACHE_DIR where that is set, else one of the user's own: ~/.cache/wsn_env or what the system has
for it. Checksums beside the files tell damage; what is damaged is thrown away and compiled anew.
"""

from __future__ import annotations

import atexit
import gc
import hashlib
import inspect
import os
import shutil
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from pathlib import Path
from types import FunctionType
from typing import Any

import numba
import numpy as np
from numba.core import event
from numba.core.errors import NumbaError

from wsn_env.compiled.stamp import options_text, stamp

KEPT = 60  # folders of one kernel: of other kinds, and of other versions that may come back
SUMS = "sums.txt"
THE_SAME_TIME = 1_000_000_000  # s: Numba compares when a source file was changed

compiled: list[str] = []  # names of the kernels compiled (not loaded) in this process
_opened: dict[object, str] = {}  # kernels by Numba's dispatcher
_folders: list[Path] = []  # of the kernels opened
_lock = threading.RLock()


def store_folder() -> Path:
    """Where kernels are kept."""
    given = numba.config.CACHE_DIR
    if given:
        return Path(given) / "wsn_env"
    if sys.platform == "win32":
        home = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        home = Path.home() / "Library" / "Caches"
    else:
        home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return home / "wsn_env" / "kernels"


def open_kernel(
    function: FunctionType, options: dict[str, Any], arguments: tuple[Any, ...], kinds: np.dtype | None = None
) -> tuple[Any, Any]:
    """The compiled function, from the store if it is there, and what it returns for these arguments.

    Args:
        kinds: the type of the constants that it is made for, where it takes any.
    """
    with _lock:
        name = f"{function.__module__}.{function.__qualname__}"
        more = options_text(options) + ("" if kinds is None else repr(kinds))
        folder = store_folder() / f"{name}-{stamp(function, more=more)}"
        try:
            source = _prepare(folder, function)
        except OSError as problem:
            _say_once(f"compiled kernels cannot be kept in {store_folder()} ({problem.strerror}); set NUMBA_CACHE_DIR")
            dispatcher = numba.jit(**options)(function)
            _opened[dispatcher] = name
            return dispatcher, dispatcher(*arguments)
        with _alone_in(folder):
            _throw_away_damaged(folder)
            dispatcher = _dispatcher(function, options, source)
            _opened[dispatcher] = name
            before = len(compiled)
            try:
                result = _without_collecting(dispatcher, arguments)
            except NumbaError:  # the function's own mistake
                raise
            except Exception as problem:  # what unpickling a damaged index raises can be anything
                if not _files(folder):
                    raise
                _throw_away(folder, repr(problem))
                dispatcher = _dispatcher(function, options, source)
                _opened[dispatcher] = name
                result = _without_collecting(dispatcher, arguments)
            _folders.append(folder)
            _sign(folder, anew=len(compiled) > before)
        return dispatcher, result


@contextmanager
def _alone_in(folder: Path) -> Iterator[None]:
    """No other process opens this kernel meanwhile: it would compile the same, and write over what is signed here."""
    with ExitStack() as held:
        try:
            import fcntl

            fcntl.flock(held.enter_context(open(folder / "lock", "w")), fcntl.LOCK_EX)
        except (ImportError, OSError):  # on Windows, or in a folder that can only be read: both compile
            pass
        yield


def _without_collecting(dispatcher, arguments: tuple[Any, ...]):
    """A first call. Compiling makes millions of objects; to look for garbage among them takes 8 % of its time."""
    collects = gc.isenabled()
    gc.disable()
    try:
        return dispatcher(*arguments)
    finally:
        if collects:
            gc.enable()


def _dispatcher(function: FunctionType, options: dict[str, Any], source: Path):
    """Numba's, of the same code, said to stand in the store."""
    code = function.__code__.replace(co_filename=str(source), co_firstlineno=1)
    twin = FunctionType(code, function.__globals__, function.__name__, function.__defaults__, function.__closure__)
    twin.__qualname__, twin.__module__, twin.__doc__ = function.__qualname__, function.__module__, function.__doc__
    return numba.jit(**options, cache=True)(twin)


def _prepare(folder: Path, function: FunctionType) -> Path:
    """The source file in a kernel's folder, the same for every process; older versions make room."""
    source = folder / "kernel.py"
    if not source.exists():
        folder.mkdir(parents=True, exist_ok=True)
        try:
            text = inspect.getsource(function)
        except (OSError, TypeError):
            text = f"# {function.__module__}.{function.__qualname__}\n"
        temporary = folder / f".{os.getpid()}.py"
        temporary.write_text(text, encoding="utf-8")
        os.utime(temporary, (THE_SAME_TIME, THE_SAME_TIME))
        os.replace(temporary, source)
        stem = folder.name.rpartition("-")[0]
        others = [other for other in folder.parent.glob(f"{stem}-*") if other.name.rpartition("-")[0] == stem]
        for old in sorted(others, key=_age)[KEPT:]:
            shutil.rmtree(old, ignore_errors=True)
    elif source.stat().st_mtime != THE_SAME_TIME:  # copied, or touched
        with suppress(OSError):
            os.utime(source, (THE_SAME_TIME, THE_SAME_TIME))
    return source


def _age(folder: Path) -> float:
    try:
        return -folder.stat().st_mtime
    except OSError:
        return 0.0


def _files(folder: Path) -> list[Path]:
    """Numba's files of a kernel."""
    places = [folder / "__pycache__"]
    if numba.config.CACHE_DIR:  # Numba makes a folder there by the source's
        places += [path for path in Path(numba.config.CACHE_DIR).glob(f"{folder.name}_*") if path.is_dir()]
    return sorted(path for place in places for path in place.glob("*.nb[ic]"))


def _sum(path: Path) -> str:
    return hashlib.blake2b(path.read_bytes(), digest_size=16).hexdigest()


def _sums(folder: Path) -> dict[str, str]:
    try:
        lines = (folder / SUMS).read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        return {}
    return dict(line.split(" ", 1)[::-1] for line in lines if " " in line)


def _throw_away_damaged(folder: Path) -> None:
    """A data file whose checksum is another than it was. Indexes grow, Numba itself finds out about those."""
    sums = _sums(folder)
    for path in _files(folder):
        if path.name in sums and path.suffix == ".nbc" and sums[path.name] != _sum(path):
            _throw_away(folder, f"{path.name} has changed")
            return


def _throw_away(folder: Path, why: str) -> None:
    name = folder.name.rpartition("-")[0]
    print(f"wsn_env: the kept kernel {name} is damaged ({why}); compiling it anew", file=sys.stderr, flush=True)
    for path in [*_files(folder), folder / SUMS]:
        with suppress(OSError):
            path.unlink()


def _sign(folder: Path, anew: bool = False) -> None:
    """Write down the checksums of the data files that have none yet, or of all."""
    sums = {} if anew else _sums(folder)
    new = {path.name: _sum(path) for path in _files(folder) if path.suffix == ".nbc" and path.name not in sums}
    if new:
        try:
            temporary = folder / f".{os.getpid()}.txt"
            text = "".join(f"{digest} {name}\n" for name, digest in (sums | new).items())
            temporary.write_text(text, encoding="utf-8")
            os.replace(temporary, folder / SUMS)
        except OSError:
            pass  # unsigned: the index tells


@atexit.register
def _sign_all() -> None:
    for folder in dict.fromkeys(_folders):
        with suppress(OSError):
            _sign(folder)


class _Watch(event.Listener):
    """Says so when a kernel is compiled, and remembers which."""

    def on_start(self, event):
        name = _opened.get(event.data.get("dispatcher"))
        if name is not None:
            compiled.append(name)
            _say_once("compiling (once on this machine, up to a minute; `wsn compile` does all of it) ...")

    def on_end(self, event):
        pass


event.register("numba:compile", _Watch())


@cache
def _say_once(text: str) -> None:
    print(f"wsn_env: {text}", file=sys.stderr, flush=True)
