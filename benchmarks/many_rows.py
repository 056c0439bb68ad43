"""Batches far past the cores, of 500 particles: from 1,000 to 100,000 rows a row takes the same time and memory, within
a tenth, and all cores together make at least 95 % of their number times the periods of one.

    python -m benchmarks.many_rows [--rounds N] [--short] [--json FILE]

Each size has a process of its own. Two vector environments, one with one thread and one with all, have turns of some
periods each, on the wall clock. Memory is what a process grows by, at its peak, from before the environment is made to
the end of some periods; and then by further periods, in which nothing may come.
"""

import json
import subprocess
import sys
import time

import gymnasium as gym
import numpy as np
from rich.console import Console

from benchmarks.memory import CLEAR, HERE, resident_bytes
from benchmarks.race import Claim, Options, Result, Table, Times, figure, interleave, main
from benchmarks.vector import ID, MENU_ENTRY
from wsn_env.compiled.kernels import available_threads

SIZES, SHORT_SIZES = (64, 1000, 10_000, 100_000), (64, 256)
PARTICLES = 500
ROW_PERIODS = 300_000  # in a turn, at least two periods of every row
PERIODS = 20  # that memory is watched for
ONE, ALL = "one thread", "all threads"
MANY = 1000  # rows, from which on sizes are compared
AT_MOST, OF_CORES = 1.1, 0.95


def measure(options: Options, console: Console) -> Result:
    """A child a size."""
    threads = available_threads()
    found = {}
    for rows in SHORT_SIZES if options.short else SIZES:
        console.print(f"{rows:,} rows", style="dim")
        found[rows] = run_child("print_times", rows, options) | run_child("print_memory", rows, options)
    times = {rows: Times(one["seconds"]) for rows, one in found.items()}
    many = [rows for rows in found if rows >= MANY] or list(found)
    single = [times[rows].median(ONE) for rows in many]
    each = [found[rows]["bytes"] for rows in many if found[rows]["bytes"]]
    speed = min(times[rows].ratio(ONE, ALL) for rows in many)
    span = f"{many[0]:,} to {many[-1]:,} rows"
    return Result(
        name="many_rows",
        title="Many rows",
        text=f"{ID} with {PARTICLES} particles, moving the head to the nearest node with 3 further members. A row's"
        f" period; the same shared among {threads} threads; what a process grows by for a row, and how much of that"
        f" comes in {PERIODS} periods after the first two.",
        claims=[
            Claim(f"a row's period, slowest over fastest, {span}", AT_MOST, max(single) / min(single), at_most=True),
            Claim(
                f"memory of a row, largest over smallest, {span}",
                AT_MOST,
                max(each) / min(each) if each else None,
                at_most=True,
                why=f"no {CLEAR}",
            ),
            Claim(f"{threads} threads: speed over one, {span}", OF_CORES * threads, speed),
        ],
        tables=[table(found, times)],
        figures={str(rows): one for rows, one in found.items()},
        packages=["gymnasium"],
    )


def table(found: dict[int, dict], times: dict[int, Times]) -> Table:
    """A line a size."""
    lines = []
    for rows, one in times.items():
        low, high = one.spread(ONE, ALL)
        own = found[rows]["bytes"]
        memory = [f"{own:,.0f}", f"{100 * found[rows]['later_bytes'] / own:.2f} %"] if own else ["", ""]
        speed = f"{figure(one.ratio(ONE, ALL))} ({figure(low)}-{figure(high)})"
        cells = [f"{1e6 * one.median(ONE):.2f}", f"{1e6 * one.median(ALL):.2f}", speed]
        lines.append([f"{rows:,}", *cells, *memory])
    columns = ["rows", "us", "us, all threads", "speed over one (quartiles)", "bytes a row", "that come later"]
    return Table("A row's period", columns, lines)


def run_child(function: str, rows: int, options: Options) -> dict:
    """What a function of this module prints in a process of its own."""
    program = f"from benchmarks.many_rows import *; {function}({rows}, Options({options.rounds}, {options.short}))"
    child = subprocess.run([sys.executable, "-c", program], cwd=HERE, capture_output=True, text=True, check=True)
    return json.loads(child.stdout.splitlines()[-1])


def print_times(rows: int, options: Options) -> None:
    """In the child: seconds a row's period by threads and round."""
    periods = 2 if options.short else max(2, ROW_PERIODS // rows)
    calls = {name: stepper(rows, threads, periods) for name, threads in ((ONE, 1), (ALL, None))}
    few = Options(min(options.rounds, 9), options.short)
    units = dict.fromkeys(calls, rows * periods)
    print(json.dumps({"seconds": interleave(calls, few, units, time.perf_counter, turn_s=0.0).seconds}))


def print_memory(rows: int, options: Options) -> None:
    """In the child: bytes a row that the process grows by, and those of them that come after the first two periods."""
    stepper(2, None, 2)()  # the code is loaded
    if not CLEAR.exists():
        print(json.dumps({"bytes": None, "later_bytes": None}))
        return
    before = resident_bytes("VmRSS")
    CLEAR.write_text("5", encoding="utf-8")  # the peak begins anew
    step = stepper(rows, None, 1)
    step(), step()
    first = resident_bytes("VmHWM")
    for _ in range(PERIODS):
        step()
    last = resident_bytes("VmHWM")
    print(json.dumps({"bytes": (last - before) / rows, "later_bytes": (last - first) / rows}))


def stepper(rows: int, threads: int | None, periods: int):
    """A call that steps all rows for some periods, through ends and resets."""
    envs = gym.make_vec(
        ID, num_envs=rows, vectorization_mode="vector_entry_point", threads=threads, particles=PARTICLES
    )
    envs.reset(seed=0)
    actions = np.full(rows, MENU_ENTRY)

    def call():
        for _ in range(periods):
            envs.step(actions)

    return call


if __name__ == "__main__":
    main(measure, __doc__, one_thread=False)
