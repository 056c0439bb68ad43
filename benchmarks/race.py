"""Races: implementations have turns in every round, in one process, so that a ratio is of times from the same minutes.

A claim file measures, and returns a `Result`: tables, claims with their verdicts, and plots. `main` gives all of them
the same command line:

    python -m benchmarks.filter_step [--rounds N] [--short] [--json FILE]
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from rich.console import Console
from rich.table import Table as RichTable

from wsn_env.evaluation.files import replacing

ROUNDS, TURN_S = 15, 0.05
SHORT_ROUNDS, SHORT_TURN_S = 3, 0.004
ONE_THREAD = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "NUMBA_NUM_THREADS": "1",
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1",
}


# --- turns --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Options:
    """How long a measurement may take."""

    rounds: int = ROUNDS
    short: bool = False  # a glance of seconds: fewer and shorter turns, smaller grids

    @property
    def turn_s(self) -> float:
        """What an implementation gets in a round."""
        return SHORT_TURN_S if self.short else TURN_S


class Times:
    """Seconds a unit of work, by implementation and round."""

    def __init__(self, seconds: dict[str, list[float]]):
        self.seconds = seconds

    def median(self, name: str) -> float:
        """Over the rounds."""
        return statistics.median(self.seconds[name])

    def ratio(self, name: str, base: str) -> float:
        """How many times as long as `base` it takes: the median over rounds of the ratio within a round."""
        return statistics.median(self._ratios(name, base))

    def spread(self, name: str, base: str) -> tuple[float, float]:
        """The quartiles over rounds of this ratio."""
        ratios = sorted(self._ratios(name, base))
        return ratios[len(ratios) // 4], ratios[-1 - len(ratios) // 4]

    def _ratios(self, name: str, base: str) -> list[float]:
        return [a / b for a, b in zip(self.seconds[name], self.seconds[base])]


def interleave(
    calls: dict[str, Callable[[], object]],
    options: Options,
    units: dict[str, int] | None = None,
    clock: Callable[[], float] = time.process_time,
    turn_s: float | None = None,
    warm: bool = True,
) -> Times:
    """Give every implementation a turn in every round.

    Args:
        calls: by name, a function without arguments.
        units: how many units of work a call is (rows, steps); 1 unless given.
        clock: CPU time of the process (for one thread), or time.perf_counter.
        turn_s: length of a turn; the options' unless given. A turn is at least one call.
        warm: find out first how many calls make a turn; without, a turn is a single call.
    """
    units = units or {}
    turn_s = options.turn_s if turn_s is None else turn_s
    repeats = dict.fromkeys(calls, 1)
    for name, call in calls.items() if warm else ():
        call()
        repeats[name] = max(1, round(turn_s / max(_seconds(call, 2, clock), 1e-9)))
    seconds: dict[str, list[float]] = {name: [] for name in calls}
    for _ in range(options.rounds):
        for name, call in calls.items():
            seconds[name].append(_seconds(call, repeats[name], clock) / units.get(name, 1))
    return Times(seconds)


def _seconds(call: Callable[[], object], repeats: int, clock: Callable[[], float]) -> float:
    """Seconds of a call, on average."""
    start = clock()
    for _ in range(repeats):
        call()
    return (clock() - start) / repeats


def pin_to_one_thread() -> None:
    """One core; and BLAS, OpenMP and XLA, which read it when they are loaded, on one thread: starts it anew."""
    if any(os.environ.get(name) != value for name, value in ONE_THREAD.items()):
        os.environ.update(ONE_THREAD)
        os.execv(sys.executable, [sys.executable, *sys.orig_argv[1:]])
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


# --- results ------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Claim:
    """A figure that ought to reach a target."""

    what: str
    target: float
    measured: float | None  # None: could not be measured here
    unit: str = "x"  # or "%"
    at_most: bool = False  # the target is an upper bound
    why: str = ""  # it could not be measured
    case: str = ""  # claims that differ in their case only are one line of the page

    @property
    def holds(self) -> bool | None:
        """None: not measured."""
        if self.measured is None:
            return None
        return self.measured <= self.target if self.at_most else self.measured >= self.target

    @property
    def verdict(self) -> str:
        """In words."""
        return {True: "holds", False: "missed", None: f"not measured: {self.why}"}[self.holds]

    def cells(self) -> list[str]:
        """What, target, measured, verdict."""
        sign = "<=" if self.at_most else ">="
        measured = "" if self.measured is None else self.written(self.measured)
        what = f"{self.what} ({self.case})" if self.case else self.what
        return [what, f"{sign} {self.written(self.target)}", measured, self.verdict]

    def written(self, value: float) -> str:
        """With its unit."""
        return f"{figure(value)}{'x' if self.unit == 'x' else f' {self.unit}'}"


@dataclass(frozen=True)
class Table:
    """Ready to print: the first column is text, the others are figures."""

    title: str
    columns: list[str]
    rows: list[list[str]]


@dataclass(frozen=True)
class Plot:
    """Lines (x, y) by name, on log axes; its drawing is docs/performance_<name>.svg."""

    name: str
    title: str
    x: str
    y: str
    lines: dict[str, list[tuple[float, float]]]


@dataclass
class Result:
    """What a claim file found."""

    name: str
    title: str
    text: str = ""  # a paragraph for the page
    claims: list[Claim] = field(default_factory=list)
    tables: list[Table] = field(default_factory=list)
    plots: list[Plot] = field(default_factory=list)
    skipped: dict[str, str] = field(default_factory=dict)  # implementations by name: why
    figures: dict = field(default_factory=dict)  # unrounded, for other programs
    packages: list[str] = field(default_factory=list)  # distributions whose versions matter
    machine: dict = field(default_factory=dict)

    def show(self, console: Console) -> None:
        """Tables, what was skipped, verdicts."""
        for table in self.tables:
            console.print(_rich(table.title, table.columns, table.rows))
        for name, reason in self.skipped.items():
            console.print(f"skipped: {name} ({reason})", highlight=False)
        if self.claims:
            rows = [claim.cells() for claim in self.claims]
            console.print(_rich("Claims", ["claim", "target", "measured", "verdict"], rows))

    def save(self, path: Path) -> None:
        """As JSON; the folder is made."""
        path.parent.mkdir(parents=True, exist_ok=True)
        claims = [asdict(claim) | {"holds": claim.holds} for claim in self.claims]
        with replacing(path) as temporary:
            temporary.write_text(json.dumps(asdict(self) | {"claims": claims}, indent=1) + "\n", encoding="utf-8")

    @classmethod
    def load(cls, path: Path) -> Result:
        """From JSON."""
        values = json.loads(Path(path).read_text(encoding="utf-8"))
        claims = [Claim(**{key: value for key, value in claim.items() if key != "holds"}) for claim in values["claims"]]
        tables, plots = [Table(**table) for table in values["tables"]], [Plot(**plot) for plot in values["plots"]]
        return cls(**values | {"claims": claims, "tables": tables, "plots": plots})


def figure(value: float) -> str:
    """Three digits, thousands in groups."""
    return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.3g}"


def _rich(title: str, columns: list[str], rows: list[list[str]]) -> RichTable:
    table = RichTable(title=title)
    for i, column in enumerate(columns):
        table.add_column(column, justify="right" if i else "left")
    for row in rows:
        table.add_row(*row)
    return table


def machine_facts(packages: list[str]) -> dict:
    """Processor, cores, cache, Python, and the versions of packages that are installed."""
    versions = {}
    for package in dict.fromkeys(["wsn_env", "numpy", "numba", *packages]):
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            continue
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "l2_bytes": l2_bytes(),
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
        "packages": versions,
    }


def l2_bytes() -> int:
    """Size of a core's second level cache; 1 MiB where the system does not say."""
    text = _read("/sys/devices/system/cpu/cpu0/cache/index2/size").strip()
    return int(text[:-1]) * 1024 if text.endswith("K") else 2**20


def _processor() -> str:
    for line in _read("/proc/cpuinfo").splitlines():
        if line.startswith("model name"):
            return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def _read(path: str) -> str:
    try:
        return Path(path).read_text(encoding="utf-8")
    except OSError:
        return ""


# --- command line -------------------------------------------------------------------------------------------


def parser(description: str | None) -> argparse.ArgumentParser:
    """--rounds, --short, --json."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, help=f"turns of each ({ROUNDS}; {SHORT_ROUNDS} with --short)")
    parser.add_argument("--short", action="store_true", help="a glance: seconds instead of minutes")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the result to this file")
    return parser


def main(measure: Callable[[Options, Console], Result], description: str | None, one_thread: bool = True) -> None:
    """Parse, measure, show, save."""
    arguments = parser(description).parse_args()
    if one_thread:
        pin_to_one_thread()
    console = Console()
    rounds = arguments.rounds or (SHORT_ROUNDS if arguments.short else ROUNDS)
    result = measure(Options(rounds, arguments.short), console)
    result.machine = machine_facts(result.packages)
    result.show(console)
    if arguments.json:
        result.save(arguments.json)
