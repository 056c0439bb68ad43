"""A clock for `interleave` that only runs while something is being timed."""

from __future__ import annotations

import time
from collections.abc import Callable


class Stopwatch:
    """Counts what happens within `with watch:`, so that a call can prepare its work uncounted.

    Args:
        clock: CPU time of the process, or time.perf_counter.
    """

    def __init__(self, clock: Callable[[], float] = time.process_time):
        self._clock = clock
        self._started = 0.0
        self.seconds = 0.0

    def __enter__(self) -> None:
        self._started = self._clock()

    def __exit__(self, *_) -> None:
        self.seconds += self._clock() - self._started

    def __call__(self) -> float:
        """Seconds counted so far."""
        return self.seconds
