"""Published systems rebuilt: for each its tables, figures and claims beside ours. `reproduce` finds them by name."""

from __future__ import annotations

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
    for paper, module in PAPERS.items():
        if name in (paper, "all"):
            folder = Path(out) / paper if name == "all" else Path(out)
            with alone_in(folder):
                import_module(module).reproduce(folder, runs, progress)
