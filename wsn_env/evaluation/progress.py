"""The progress bar of long work, on stderr."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

Progress = Callable[[int, int, str], None]  # done, total, what


_shown: list[object] = []  # the bar of this process, if there is one


@contextmanager
def progress_bar(instead: Progress | None = None) -> Iterator[Progress]:
    """A bar with the time left, as a function progress(done, total, what); or what is given `instead` of it.

    Work within work that has a bar gets none of its own.
    """
    if instead is not None:
        yield instead
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    console = Console(stderr=True)
    if _shown or not (console.is_terminal or console.is_jupyter):  # there older versions of rich print an empty line
        yield no_progress
        return
    columns = TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    with Bar(*columns, console=console, transient=True) as bar:
        _shown.append(bar)
        try:
            task = bar.add_task("", total=None)
            yield lambda done, total, what: bar.update(task, completed=done, total=total, description=what)
        finally:
            _shown.clear()


def no_progress(done: int, total: int, what: str) -> None:
    """Tell nobody."""
