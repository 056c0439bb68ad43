"""Published systems rebuilt: for each its tables, figures and claims beside ours. `reproduce` finds them by name."""

from __future__ import annotations

from contextlib import ExitStack
from importlib import import_module
from pathlib import Path

from wsn_env.evaluation.files import alone_in
from wsn_env.evaluation.progress import Progress
from wsn_env.models.quantity import suggest, whole_number

PAPERS = {name: f"wsn_env.papers.{name}" for name in ("pre_dc", "binary", "grnn", "underwater")}


def reproduce(name: str, out: str | Path, runs: int = 100, progress: Progress | None = None) -> None:
    """Rebuild a paper's tables, figures and claims, write them to a folder and print the tables and verdicts.

    Args:
        name: one of PAPERS; "all": one after the other, each into a folder of its name.
        out: folder for the files, made if it does not exist.
        runs: Monte Carlo runs for each cell; at least 2, for standard errors.
        progress: called as progress(done, total, what) after every simulated period; None: a bar on the terminal.

    Raises:
        ValueError: for an unknown paper, too few runs, or a folder that another run writes into.
    """
    if name not in (*PAPERS, "all"):
        raise ValueError(f"paper {name!r} is unknown: {suggest(str(name), (*PAPERS, 'all'))}")
    runs = whole_number("runs", runs, 2)  # standard errors need two
    folders = {paper: Path(out) / paper for paper in PAPERS} if name == "all" else {name: Path(out)}
    with ExitStack() as held:
        for folder in folders.values():  # all, before time is spent
            held.enter_context(alone_in(folder))
        for paper, folder in folders.items():
            import_module(PAPERS[paper]).reproduce(folder, runs, progress)
