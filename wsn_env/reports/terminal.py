"""stdout and stderr, whatever they are: an ASCII terminal, a pipe that nobody reads any more, a full disk, nothing."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

NOBODY_READS = 1  # exit status where whoever read the output has gone, which is no error: rich has the same


@contextmanager
def any_terminal() -> Iterator[None]:
    """Letters that stdout cannot show are replaced; what is printed has been written at the end, or raises OSError."""
    for stream in (sys.stdout, sys.stderr):
        if getattr(stream, "errors", "") == "strict" and hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")
    try:
        yield
        if sys.stdout is not None:
            sys.stdout.flush()
    except OSError:
        _drop_what_cannot_be_written()
        raise


def _drop_what_cannot_be_written() -> None:
    """Else Python tries once more at its end, and says so in lines of its own."""
    try:
        sys.stdout.flush()
    except OSError:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)
    except (AttributeError, ValueError):  # none, or closed
        pass
