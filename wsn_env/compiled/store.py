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
import secrets
import shutil
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from itertools import count
from pathlib import Path
from types import FunctionType
from typing import Any

import numba
import numpy as np
from numba.core import event
from numba.core.bytecode import FunctionIdentity
from numba.core.errors import NumbaError

from wsn_env.compiled.stamp import options_text, stamp

KEPT = 60  # folders of one kernel: of other kinds, and of other versions that may come back
SOURCE, SUMS = "kernel.py", "sums.txt"
THE_SAME_TIME = 1_000_000_000  # s: Numba compares when a source file was changed

NOT_KEPT = "compiled kernels cannot be kept in {} ({}); set NUMBA_CACHE_DIR to a folder that can be written to"

NAMING = "random"  # of what kernels are made of: see _name_apart

compiled: list[str] = []  # names of the kernels compiled (not loaded) in this process
_opened: dict[object, str] = {}  # kernels by Numba's dispatcher
_unkept: dict[object, str] = {}  # why those cannot be kept
_folders: list[Path] = []  # of the kernels opened
_lock = threading.RLock()


def store_folder() -> Path:
    """Where kernels are kept."""
    given = numba.config.CACHE_DIR
    if given:
        return Path(given) / "wsn_env"
    try:
        home = Path.home()
    except RuntimeError:  # a user who is only a number, as containers have
        home = Path("/nonexistent")
    if sys.platform == "win32":
        folder = Path(os.environ.get("LOCALAPPDATA") or home / "AppData" / "Local")
    elif sys.platform == "darwin":
        folder = home / "Library" / "Caches"
    else:
        folder = Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache")
    return folder / "wsn_env" / "kernels"


def check_store() -> None:
    """See that kernels can be kept.

    Raises:
        ValueError: they cannot.
    """
    folder = store_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        why = _why_not_writable(folder)
    except OSError as problem:
        why = problem.strerror or str(problem)
    if why:
        raise ValueError(NOT_KEPT.format(folder, why))


def open_kernel(
    function: FunctionType, options: dict[str, Any], arguments: tuple[Any, ...], kinds: np.dtype | None = None
) -> tuple[Any, Any]:
    """The compiled function, from the store if it is there, and what it returns for these arguments.

    Args:
        kinds: the type of the constants that it is made for, where it takes any.
    """
    with _lock:
        _name_apart()
        name = f"{function.__module__}.{function.__qualname__}"
        more = NAMING + options_text(options) + ("" if kinds is None else repr(kinds))
        folder = store_folder() / f"{name}-{stamp(function, more=more)}"
        try:
            _prepare(folder, function)
            with _alone_in(folder):
                return _open_kept(folder, function, options, arguments)
        except OSError as problem:  # the store's: kernels raise none
            dispatcher = numba.jit(**options)(function)
            _opened[dispatcher] = name
            _unkept[dispatcher] = problem.strerror or str(problem)
            return dispatcher, dispatcher(*arguments)


def _open_kept(
    folder: Path, function: FunctionType, options: dict[str, Any], arguments: tuple[Any, ...]
) -> tuple[Any, Any]:
    """The function of a kernel's folder, and its result; what is missing there is compiled."""
    name = folder.name.rpartition("-")[0]
    why = _why_not_writable(folder)
    if why:  # Numba reads only where it may write
        folder = _copy(folder)
    dispatcher = _dispatcher(function, options, folder)
    _throw_away_damaged(folder)
    for attempt in range(2):
        _opened[dispatcher] = name
        if why:
            _unkept[dispatcher] = why
        before = len(compiled)
        try:
            result = _without_collecting(dispatcher, arguments)
            break
        except NumbaError:  # the function's own mistake
            raise
        except Exception as problem:  # what unpickling a damaged index raises can be anything
            if attempt or not _files(folder):
                raise
            _throw_away(folder, repr(problem))
            dispatcher = _dispatcher(function, options, folder)
    if not why:
        _folders.append(folder)
        _sign(folder, anew=len(compiled) > before)
    return dispatcher, result


def _name_apart() -> None:
    """Let what is compiled next have names that no other process gives.

    Numba names functions by module, name, types and a number that each process counts from 1, and types of records by
    a number of the process, too. Two kernels that were compiled by two processes would share names for different code,
    and in a third, which loads both, the second would call the functions of the first.
    """
    FunctionIdentity._unique_ids = count(secrets.randbits(62))


@contextmanager
def _alone_in(folder: Path) -> Iterator[None]:
    """No other process opens this kernel meanwhile: it would compile the same, and write over what is signed here."""
    with ExitStack() as held:
        try:
            import fcntl

            fcntl.flock(held.enter_context(open(folder / "lock", "wb")), fcntl.LOCK_EX)
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


def _dispatcher(function: FunctionType, options: dict[str, Any], folder: Path):
    """Numba's, of the same code, said to stand in the store."""
    code = function.__code__.replace(co_filename=str(folder / SOURCE), co_firstlineno=1)
    twin = FunctionType(code, function.__globals__, function.__name__, function.__defaults__, function.__closure__)
    twin.__qualname__, twin.__module__, twin.__doc__ = function.__qualname__, function.__module__, function.__doc__
    return numba.jit(**options, cache=True)(twin)


def _prepare(folder: Path, function: FunctionType) -> None:
    """Make a kernel's folder with its source file, the same for every process; older versions make room."""
    source = folder / SOURCE
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


def _why_not_writable(folder: Path) -> str:
    """What Numba would meet that wrote a kernel of this folder; "" for nothing."""
    try:
        tempfile.TemporaryFile(dir=numba.config.CACHE_DIR or folder).close()
    except OSError as problem:
        return problem.strerror or str(problem)
    return ""


def _copy(folder: Path) -> Path:
    """A kernel's folder copied to where this process may write."""
    own = _own_folder() / folder.name
    (own / "__pycache__").mkdir(parents=True, exist_ok=True)
    for path in _files(folder):
        shutil.copyfile(path, own / "__pycache__" / path.name)
    for name in (SOURCE, SUMS):
        with suppress(FileNotFoundError):
            shutil.copyfile(folder / name, own / name)
    os.utime(own / SOURCE, (THE_SAME_TIME, THE_SAME_TIME))
    return own


@cache
def _own_folder() -> Path:
    """A folder of this process's own, which goes with it."""
    folder = Path(tempfile.mkdtemp(prefix="wsn_env-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


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
            why = _unkept.get(event.data["dispatcher"])
            if why is None:
                _say_once("compiling (once on this machine, up to a minute; `wsn compile` does all of it) ...")
            else:
                _say_once(f"compiling at every start, up to a minute: {NOT_KEPT.format(store_folder(), why)}")

    def on_end(self, event):
        pass


event.register("numba:compile", _Watch())


@cache
def _say_once(text: str) -> None:
    print(f"wsn_env: {text}", file=sys.stderr, flush=True)
