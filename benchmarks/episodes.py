"""What an episode costs beside its periods: its reset and its end take at most 3 % of an episode of 100 periods.

    python -m benchmarks.episodes [--rounds N] [--short] [--json FILE]

Rows of a vector environment, one thread. Told in periods of a row, too: pickling and unpickling (a checkpoint, a copy
for another process), the reference with all nodes awake, which is asked for, and drawing a frame.
"""

import pickle
from collections.abc import Callable
from contextlib import nullcontext

import gymnasium as gym
import numpy as np
from rich.console import Console

from benchmarks.race import Claim, Options, Result, Table, Times, figure, interleave, main
from benchmarks.stopwatch import Stopwatch
from benchmarks.vector import ID, MENU_ENTRY
from wsn_env.scenario import Scenario

PARTICLES, ROWS, SHORT_ROWS = (500, 5000), 512, 16
SHORT = {"periods": 20}
AT_MOST = 3.0  # % of an episode
PERIOD, LAST = "a period", "the end"
RESET = "reset"
BESIDE = (RESET, "pickle", "unpickle", "reference_all_awake_m", "frame")


def measure(options: Options, console: Console) -> Result:
    """Both particle counts."""
    rows = SHORT_ROWS if options.short else ROWS
    periods = Scenario.named(ID).periods
    result = Result(
        name="episodes",
        title="Episodes",
        text=f"A row of {rows} of {ID}, one thread, in microseconds and in periods of a row. The"
        " frame is one of a single environment. The end: what the period in which all rows end takes more than others.",
        packages=["gymnasium"],
    )
    lines = []
    for particles in PARTICLES:
        console.print(f"P = {particles}", style="dim")
        times = race(particles, rows, options)
        ends = times.ratio(LAST, PERIOD) - 1.0
        beside = times.ratio(RESET, PERIOD) + ends
        share = 100 * beside / (periods + beside)
        case = f"P = {particles:,}"
        result.claims.append(
            Claim("an episode: share of its reset and its end", AT_MOST, share, "%", at_most=True, case=case)
        )
        result.figures[case] = times.seconds
        lines.append([f"{PERIOD}, {case}", figure(1e6 * times.median(PERIOD)), "1"])
        lines.append([f"{LAST}, {case}", figure(1e6 * ends * times.median(PERIOD)), figure(ends)])
        lines += [
            [f"{what}, {case}", figure(1e6 * times.median(what)), figure(times.ratio(what, PERIOD))] for what in BESIDE
        ]
    result.tables.append(Table("A row", ["what", "us", "periods"], lines))
    return result


def race(particles: int, rows: int, options: Options) -> Times:
    """Seconds a row, by what is done."""
    watch = Stopwatch()
    more = SHORT if options.short else {}
    envs = gym.make_vec(
        ID,
        num_envs=rows,
        vectorization_mode="vector_entry_point",
        threads=1,
        autoreset_mode="Disabled",
        particles=particles,
        **more,
    )
    single = gym.make(ID, particles=particles, render_mode="rgb_array")
    single.reset(seed=0)
    envs.reset(seed=0)
    native, pickled = envs.unwrapped, pickle.dumps(envs.unwrapped)
    before_end = native.scenario.periods - 1
    actions = np.full(rows, MENU_ENTRY)

    def play(counted: bool) -> None:
        envs.reset()
        with watch if counted else nullcontext():
            for _ in range(before_end):
                envs.step(actions)
        with nullcontext() if counted else watch:
            envs.step(actions)

    others: dict[str, Callable[[], object]] = {
        RESET: envs.reset,
        "pickle": lambda: pickle.dumps(native),
        "unpickle": lambda: pickle.loads(pickled),
        "reference_all_awake_m": native.reference_all_awake_m,
        "frame": single.render,
    }
    calls = {PERIOD: lambda: play(True), LAST: lambda: play(False)}
    calls |= {name: _watched(call, watch) for name, call in others.items()}
    units = dict.fromkeys(calls, rows) | {PERIOD: rows * before_end, "frame": 1}
    return interleave(calls, options, units, watch, turn_s=0.0)


def _watched(call: Callable[[], object], watch: Stopwatch) -> Callable[[], None]:
    def watched():
        with watch:
            call()

    return watched


if __name__ == "__main__":
    main(measure, __doc__)
