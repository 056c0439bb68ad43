"""Files that are whole or absent, and folders that one run at a time writes into."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryFile

LOCK_FILE = ".wsn.lock"

_held: dict[tuple[int, Path], int] = {}  # by process and folder: how often


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Gives a temporary name beside `path` to write to; it is renamed at the end, or removed if there is an error.

    What killed processes have left under such names for the same file is removed.

    Raises:
        ValueError: the path is of something that must not be replaced.
    """
    path = Path(path)
    check_replaceable(path)
    _remove_temporary_files_of_dead_processes(path)
    temporary = path.with_name(f".{os.getpid()}.{path.name}")
    try:
        with naming(path, temporary):
            yield temporary
            os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def naming(path: str | Path, temporary: Path | None = None) -> Iterator[None]:
    """What goes wrong with a file names it: a full disk does not. The temporary name is no user's."""
    try:
        yield
    except OSError as problem:
        if problem.errno is None or problem.filename not in (None, temporary, str(temporary)):
            raise
        raise OSError(problem.errno, problem.strerror, str(path)) from None


def check_replaceable(path: str | Path) -> None:
    """See that a path is free or a regular file.

    Raises:
        ValueError: it is a folder, a device, a pipe, a symbolic link: writing would replace it.
    """
    path = Path(path)
    if path.is_symlink():
        raise ValueError(f"{path}: is a symbolic link: must be a regular file, or not exist yet")
    if path.is_dir():
        raise ValueError(f"{path}: is a folder: must be a regular file, or not exist yet")
    if path.exists() and not path.is_file():
        raise ValueError(f"{path}: is a device or a pipe: must be a regular file, or not exist yet")


def check_writable(path: str | Path) -> None:
    """Make the folder of a file to be, and see that the file can be written there, before time is spent.

    Raises:
        ValueError: it cannot, or something is there that must not be replaced.
    """
    path = Path(path)
    check_replaceable(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=path.parent):
            pass
    except OSError as problem:
        raise _not_writable(path.parent, problem) from None


@contextmanager
def alone_in(folder: str | Path, names: Iterable[str] = ()) -> Iterator[None]:
    """Make a folder and let no other process write into it meanwhile; the lock ends with the process, however it ends.

    Args:
        folder: that a run writes into.
        names: of its files, which are seen to be replaceable before time is spent.

    Raises:
        ValueError: another run writes into it, it is no folder, or files cannot be written there.
    """
    folder = Path(folder)
    there = folder.exists()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise _not_writable(folder, problem) from None
    for name in names:
        check_replaceable(folder / name)
    key = os.getpid(), folder.resolve()
    if key in _held:
        _held[key] += 1
        try:
            yield
        finally:
            _held[key] -= 1
        return
    lock = folder / LOCK_FILE
    check_replaceable(lock)
    file = _lock(lock)
    _held[key] = 1
    try:
        yield
    finally:
        del _held[key]
        with suppress(OSError):  # Windows removes no open file: there it stays, unlocked
            lock.unlink()
        os.close(file)
        if not there:
            with suppress(OSError):  # one that nothing was written into goes again
                folder.rmdir()


def _lock(path: Path) -> int:
    """An open file that is locked and stands under the path."""
    while True:
        try:
            file = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        except OSError as problem:
            raise _not_writable(path.parent, problem) from None
        try:
            _try_to_lock(file)
            if _same_file(file, path):
                try:
                    os.ftruncate(file, 0)
                    os.write(file, str(os.getpid()).encode())
                except OSError as problem:
                    path.unlink()
                    raise _not_writable(path.parent, problem) from None
                return file
        except BlockingIOError:
            process = os.read(file, 20).decode(errors="replace").strip()
            os.close(file)
            by = f" (process {process})" if process.isdecimal() else ""
            raise ValueError(
                f"{path.parent}: another run{by} writes into this folder: wait for its end, or name another folder"
            ) from None
        except BaseException:
            os.close(file)
            raise
        os.close(file)  # its run has just ended and removed it


def _try_to_lock(file: int) -> None:
    """Lock an open file, or raise BlockingIOError where another process has; where there are no locks, go on."""
    try:
        import fcntl
    except ImportError:  # Windows
        import msvcrt

        os.lseek(file, 2**30, os.SEEK_SET)  # beyond what is read
        try:
            msvcrt.locking(file, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined, unused-ignore]
        except OSError as problem:
            raise BlockingIOError(problem.errno, problem.strerror) from None
        finally:
            os.lseek(file, 0, os.SEEK_SET)
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise
    except OSError:  # a file system without locks
        return


def _same_file(file: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(file), os.stat(path))
    except FileNotFoundError:
        return False


def _not_writable(folder: Path, problem: OSError) -> ValueError:
    return ValueError(f"{folder}: must be a folder that files can be written to: {problem.strerror or problem}")


def _remove_temporary_files_of_dead_processes(path: Path) -> None:
    """Those of `replacing`, for the same path."""
    pattern = re.compile(rf"\.([0-9]{{1,9}})\.{re.escape(path.name)}")
    try:
        names = os.listdir(path.parent)
    except OSError:
        return
    for name in names:
        match = pattern.fullmatch(name)
        left = path.with_name(name)
        if match and left.is_file() and not left.is_symlink() and not _is_alive(int(match[1])):
            left.unlink(missing_ok=True)


def _is_alive(process: int) -> bool:
    """Whether there is such a process; on Windows, where asking would end it, any."""
    if os.name != "posix" or process == 0:
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:  # another user's
        return True
    return True
