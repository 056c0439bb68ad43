"""An environment serves one thread at a time: compiled code writes its arrays without Python's lock."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import wraps
from typing import Any, Concatenate, ParamSpec, Protocol, TypeVar

P = ParamSpec("P")
R = TypeVar("R")


class Busy:
    """Held while an environment works. Those of copies and of unpickled environments are free."""

    def __init__(self) -> None:
        lock = threading.RLock()  # the same thread may come again: after an interrupt, say
        self.acquire, self.release = lock.acquire, lock.release

    def __reduce__(self) -> tuple[Any, ...]:
        return Busy, ()


class HasBusy(Protocol):
    """An environment."""

    _busy: Busy


E = TypeVar("E", bound=HasBusy)


def one_thread(method: Callable[Concatenate[E, P], R]) -> Callable[Concatenate[E, P], R]:
    """A method of an environment that is refused while another thread is in one."""

    @wraps(method)
    def guarded(self: E, /, *args: P.args, **kwargs: P.kwargs) -> R:
        busy = self._busy
        if not busy.acquire(False):
            raise RuntimeError(
                f"{type(self).__name__}.{method.__name__}: the environment is being stepped by another thread: give"
                " each thread an environment of its own, or let them take turns"
            )
        try:
            return method(self, *args, **kwargs)
        finally:
            busy.release()

    return guarded
