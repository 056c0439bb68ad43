"""Which files a user's own code has read: code beside it, data. Results are kept for these files alone.

An audit hook of Python's sees every file that is opened; those count that are opened, at whatever depth, by a module
whose package is watched. Files that a library opens without Python (HDF5, safetensors) are not seen.
"""

from __future__ import annotations

import os
import sys
import sysconfig
from collections.abc import Iterable
from functools import cache
from hashlib import sha256
from importlib.util import source_from_cache
from pathlib import Path
from types import FrameType
from typing import Any

from wsn_env.compiled.store import store_folder

OF_FILES = "wsn_env_own_"  # so begin the names of modules that are files given by path
IMPORTED = ""

_read: dict[str, dict[Path, str]] = {IMPORTED: {}}  # digests of what was read, by watched package; of modules imported
_stamps: dict[Path, tuple[tuple[int, ...], str]] = {}  # when a file was changed last, and its digest


def watch(module: str) -> None:
    """From now on note the files that the modules of a module's package open, themselves or through others."""
    if len(_read) == 1:
        sys.addaudithook(_note)
    _read.setdefault(_package(module), {})


def _package(module: str) -> str:
    return module.partition(".")[0]


def note_file(module: str, path: str | Path) -> None:
    """Note a file for the package of a module, which is watched."""
    _note_file(Path(path), [_read[_package(module)]])


def note_modules() -> None:
    """Note the files of the modules that have been imported and are neither this package's nor installed.

    Each counts as it was when noted first. Those given by path are noted as they are read.
    """
    for name, module in list(sys.modules.items()):
        file = getattr(module, "__file__", None)
        if isinstance(file, str) and not name.startswith(OF_FILES) and Path(file) not in _read[IMPORTED]:
            _note_file(Path(file), [_read[IMPORTED]])


def noted_files(modules: Iterable[str]) -> dict[str, str]:
    """Digests, by path, of what the packages of these modules have read, and of the modules noted."""
    packages = IMPORTED, *map(_package, modules)
    return {str(path): digest for name in packages for path, digest in _read.get(name, {}).items()}


def add_noted(module: str, files: dict[str, str]) -> None:
    """Add what a module has read in another process."""
    watch(module)
    for name, digest in files.items():
        _read[_package(module)].setdefault(Path(name), digest)


def _note_file(path: Path, notes: Iterable[dict[Path, str]]) -> None:
    """Note a file as it is now, unless it is installed, or the system's."""
    path = Path(os.path.abspath(path))
    if path.parent.name == "__pycache__" and path.suffix == ".pyc":
        path = Path(source_from_cache(str(path)))
    if any(path.is_relative_to(folder) for folder in _not_own()) or not path.is_file():
        return
    stat = path.stat()
    stamp = stat.st_mtime_ns, stat.st_size, stat.st_ino
    if path not in _stamps or _stamps[path][0] != stamp:
        _stamps[path] = stamp, file_digest(path) or ""
    for each in notes:
        each[path] = _stamps[path][1]


def sources_of(module: str) -> list[str]:
    """Files of the modules of a module's package, as far as they are imported."""
    top = module.partition(".")[0]
    names = [name for name in sorted(sys.modules) if name == top or name.startswith(f"{top}.")]
    return [str(file) for name in names if (file := getattr(sys.modules[name], "__file__", None))]


def file_digest(path: str | Path) -> str | None:
    """Of a file's content; None: it is no regular file, or cannot be read."""
    try:
        return sha256(Path(path).read_bytes()).hexdigest() if Path(path).is_file() else None
    except OSError:
        return None


@cache
def _not_own() -> tuple[Path, ...]:
    """Folders of installed code, of this package and of the system."""
    installed = (sysconfig.get_paths()[name] for name in ("stdlib", "platstdlib", "purelib", "platlib"))
    package = Path(__file__).parents[1]
    return *map(Path, installed), package, package.parent / "agents", store_folder(), Path("/proc"), Path("/sys")


def _note(event: str, arguments: tuple[Any, ...]) -> None:
    """The audit hook: it must never raise."""
    if event != "open" or not isinstance(arguments[0], (str, bytes, os.PathLike)):
        return
    path, _, flags = arguments
    if flags & (os.O_WRONLY | os.O_TRUNC | os.O_APPEND):
        return
    notes = {}
    frame: FrameType | None = sys._getframe(1)
    while frame is not None:
        name = str(frame.f_globals.get("__name__"))
        if name == __name__ or name.startswith("wsn_env.evaluation."):  # which reads for itself, and calls the others
            break
        if (package := _package(name)) in _read:
            notes[package] = _read[package]
        frame = frame.f_back
    if notes:
        try:
            _note_file(Path(os.fsdecode(path)), notes.values())
        except (OSError, ValueError):
            return
