"""The native vector environment of 64 rows against 64 single environments in Gymnasium's SyncVectorEnv, one thread: at
least 1.2 times the steps/s with 5000 particles, where the filter takes most of both, and 4 times with 500.

    python -m benchmarks.vector [--rounds N] [--short] [--json FILE]

First both have to give the same bits. A turn is an episode of every row with its reset, so that the resets count as
often as they come. Also environment steps/s against rows, with all threads on the wall clock.
"""

import contextlib
import os
import time
from collections.abc import Callable

import gymnasium as gym
import numpy as np
from rich.console import Console

from benchmarks.race import Claim, Options, Plot, Result, Table, Times, figure, interleave, main
from wsn_env.compiled.kernels import available_threads
from wsn_env.scenario import Scenario

ID = "wsn_env/PreDC-v0"
FIXED = dict(filter_q=0.05)  # the filter of the others, with one motion; modes of motion cost a tenth to a third more
MENU_ENTRY = 10 + 3  # the nearest node leads, with 3 further members
ROWS = 64
TARGETS = {5000: 1.2, 500: 4.0}  # by particles
NATIVE, SYNC = "vector environment", "SyncVectorEnv"
MODES = {NATIVE: "vector_entry_point", SYNC: "sync"}
PLOT_ROWS, SHORT_ROWS, SYNC_ROWS = (1, 4, 16, 64, 256, 1024), (1, 4, 16), 64
MANY = 256  # from so many rows on a turn is long enough to be the only one


def measure(options: Options, console: Console) -> Result:
    """Check, race for both numbers of particles, plot."""
    result = Result(
        name="vector",
        title="Vector environment",
        text=f"{ROWS} rows of {ID}, moving the head to the nearest node with 3 further members, one thread. The time of"
        " a row's step, its share of the resets included.",
    )
    lines = []
    with one_core():
        for particles, target in TARGETS.items():
            steps = count_equal_steps(particles)
            console.print(f"P = {particles}: both give the same bits for {steps} steps, resets among them")
            times = race(particles, ROWS, options)
            result.claims.append(
                Claim(
                    f"vector environment: speed over SyncVectorEnv, P = {particles}", target, times.ratio(SYNC, NATIVE)
                )
            )
            result.figures[str(particles)] = times.seconds
            low, high = times.spread(SYNC, NATIVE)
            spread = f"{figure(times.ratio(SYNC, NATIVE))} ({figure(low)}-{figure(high)})"
            lines.append([f"{particles:,}", *(f"{1e6 * times.median(name):.1f}" for name in MODES), spread])
    columns = ["particles", "native, us/step", "SyncVectorEnv, us/step", "ratio (quartiles)"]
    result.tables.append(Table(f"{ROWS} rows, one thread", columns, lines))
    title = "Environment steps/s against rows (P = 5000)"
    result.plots.append(Plot("env_rows", title, "rows B", "environment steps/s", against_rows(options, console)))
    result.packages = ["gymnasium"]
    return result


def make(name: str, rows: int, threads: int = 1, **overrides) -> gym.vector.VectorEnv:
    """One of MODES; single environments have one thread anyhow."""
    more = {"threads": threads} if name == NATIVE else {}
    return gym.make_vec(ID, num_envs=rows, vectorization_mode=MODES[name], **more, **(FIXED | overrides))


def count_equal_steps(particles: int, rows: int = 8, periods: int = 6, steps: int = 20) -> int:
    """How many steps were compared: observations, rewards and ends, for random actions, over several short episodes.

    Raises:
        SystemExit: if they differ.
    """
    native, sync = (make(name, rows, particles=particles, periods=periods) for name in MODES)
    rng = np.random.default_rng(0)
    _check_equal([native.reset(seed=7)[0]], [sync.reset(seed=7)[0]], 0)
    for step in range(1, steps + 1):
        actions = rng.integers(native.single_action_space.n, size=rows)
        _check_equal(native.step(actions)[:4], sync.step(actions)[:4], step)
    return steps


def _check_equal(native, sync, step: int) -> None:
    if not all(np.array_equal(a, b) for a, b in zip(native, sync, strict=True)):
        raise SystemExit(f"native and SyncVectorEnv differ in step {step}: no race")


def race(particles: int, rows: int, options: Options) -> Times:
    """Seconds a step of a row, by implementation."""
    calls = {name: episode(make(name, rows, particles=particles)) for name in MODES}
    return interleave(calls, options, dict.fromkeys(calls, rows * Scenario.named(ID).periods), warm=not options.short)


def episode(envs: gym.vector.VectorEnv) -> Callable[[], None]:
    """A call that steps all rows through an episode and the reset after it."""
    envs.reset(seed=0)
    actions = np.full(envs.action_space.shape, MENU_ENTRY)

    def call():
        truncated = np.zeros(envs.num_envs, bool)
        while not truncated.all():
            truncated = envs.step(actions)[3]
        envs.step(actions)  # autoreset: all rows begin

    return call


def against_rows(options: Options, console: Console) -> dict[str, list[tuple[float, float]]]:
    """(B, steps/s) by implementation."""
    threads, periods = available_threads(), Scenario.named(ID).periods
    everybody = f"{NATIVE}, {threads} threads"
    lines: dict[str, list[tuple[float, float]]] = {f"{NATIVE}, 1 thread": [], everybody: [], SYNC: []}
    for rows in SHORT_ROWS if options.short else PLOT_ROWS:
        console.print(f"environments, {rows} rows", style="dim")
        few = Options(1 if rows >= MANY else min(options.rounds, 5), options.short)
        units = dict.fromkeys(lines, rows * periods)
        with one_core():
            calls = {f"{NATIVE}, 1 thread": episode(make(NATIVE, rows))}
            if rows <= SYNC_ROWS:
                calls[SYNC] = episode(make(SYNC, rows))
            found = interleave(calls, few, units, warm=not options.short)
            for name in calls:
                lines[name].append((rows, 1 / found.median(name)))
        call = episode(make(NATIVE, rows, threads))
        found = interleave({everybody: call}, few, units, clock=time.perf_counter, warm=not options.short)
        lines[everybody].append((rows, 1 / found.median(everybody)))
    return lines


@contextlib.contextmanager
def one_core():
    """Stay on one core, as `pin_to_one_thread` does, but only for a while."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(cores)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, cores)


if __name__ == "__main__":
    main(measure, __doc__, one_thread=False)
