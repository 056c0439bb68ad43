"""The filter kernel's time is a + b P B on one thread: every point lies within 20 % of the line for 500 to 50,000
particles, 1 to 1024 rows and P B >= 5000 (35 % where a call's data are beyond the L2 cache).

    python -m benchmarks.filter_scaling [--rounds N] [--short] [--json FILE]

Also every implementation's time against particles, and its filter steps/s against rows.
"""

from collections.abc import Iterable

import numpy as np
from rich.console import Console

from benchmarks.filters import IMPLEMENTATIONS, SLOW_STARTERS, Absent, Implementation, Looped, Problem, enter, kind_of
from benchmarks.race import Claim, Options, Plot, Result, Table, Times, interleave, l2_bytes, main

STRICT = "wsn_env, strict"
PARTICLES, ROWS = (500, 1000, 2000, 5000, 10_000, 20_000, 50_000), (1, 4, 16, 64, 256, 1024)
PLOT_PARTICLES = (500, 1500, 5000, 15_000, 50_000)
LEAST = 5000  # particles in all rows: below, the call itself counts
BYTES, SCRATCH_BYTES = 20, 48  # a particle: state and log weight; and of one row weight, 3 slots, 2 states
WITHIN, BEYOND = 20.0, 35.0  # %
RACED = [name for name in IMPLEMENTATIONS if name not in SLOW_STARTERS]
SHORT_LIMIT = 50_000  # particles in all rows
FEW = 64  # rows, up to which implementations have turns


def measure(options: Options, console: Console) -> Result:
    """The grid and its line, then the two plots."""
    result = Result(name="filter_scaling", title="Scaling of the filter")
    result.skipped = dict.fromkeys(SLOW_STARTERS, "compiles for seconds for every shape")
    grid = kernel_grid(options, console)
    a, b = fit_line(grid)
    deviations = {point: 100 * (seconds / (a + b * point[0] * point[1]) - 1) for point, seconds in grid.items()}
    inside = {
        (p, rows): value for (p, rows), value in deviations.items() if p * (BYTES * rows + SCRATCH_BYTES) <= l2_bytes()
    }
    outside = {point: value for point, value in deviations.items() if point not in inside}
    result.text = (
        f"Strict kernel, positions, m = 4: {1e6 * a:.1f} us + {1e9 * b:.2f} ns a particle. Each entry is the time of a"
        " call, and how far it is from this line."
    )
    result.tables.append(table(grid, deviations))
    for where, points, target in (("within", inside, WITHIN), ("beyond", outside, BEYOND)):
        measured = max(map(abs, points.values()), default=None)
        what = f"filter kernel: distance from a + b P B, a call's data {where} L2"
        result.claims.append(Claim(what, target, measured, "%", at_most=True, why="no such point"))
    by_particles, by_rows = against_particles(options, console, result), against_rows(options, console)
    result.plots = [
        Plot("particles", "One filter step against particles (m = 4 positions, one thread)", "particles P", "us/step",
             {name: [(p, 1e6 * s) for p, s in line] for name, line in by_particles.items()}),
        Plot("rows", "Filter steps/s against rows (P = 5000, m = 4 positions, one thread)", "rows B", "filter steps/s",
             {name: [(rows, rows / s) for rows, s in line] for name, line in by_rows.items()}),
    ]  # fmt: skip
    result.figures = {"a_s": a, "b_s": b, "grid_s": [[*point, seconds] for point, seconds in grid.items()]}
    result.packages = [package for name in by_particles if (package := kind_of(name).package)]
    return result


# --- the line -----------------------------------------------------------------------------------------------


def kernel_grid(options: Options, console: Console) -> dict[tuple[int, int], float]:
    """Seconds a call by (P, B), all points interleaved; their clouds take 2.5 GB."""
    points = [(p, rows) for rows in ROWS for p in PARTICLES if p * rows >= LEAST]
    if options.short:
        points = [(p, rows) for p, rows in points if p * rows <= SHORT_LIMIT]
    console.print(f"filter kernel, {len(points)} sizes", style="dim")
    implementations = {f"{p} x {rows}": enter(STRICT, shared_cloud(p, rows)) for p, rows in points}
    calls = {name: implementation.step for name, implementation in implementations.items()}
    times = interleave(calls, options, turn_s=options.turn_s / 2)
    return {point: times.median(name) for point, name in zip(points, calls)}


def shared_cloud(particles: int, rows: int) -> Problem:
    """A problem whose rows start from one cloud in memory, and differ in their keys."""
    problem = Problem.draw("position", particles, 1)
    parts = {name: np.repeat(getattr(problem, name), rows, axis=0) for name in ("truth", "sensors", "values")}
    parts["prior_mean"] = np.repeat(problem.prior_mean, rows, axis=0)
    parts["particles"] = np.broadcast_to(problem.particles, (rows, 4, particles))
    parts["keys"] = np.random.default_rng(0).integers(2**63, size=rows, dtype=np.uint64)
    return Problem(**problem.__dict__ | parts)


def fit_line(grid: dict[tuple[int, int], float]) -> tuple[float, float]:
    """a, b [s] of the line a + b P B with the least squares of relative deviations."""
    seconds = np.array(list(grid.values()))
    sizes = np.array([p * rows for p, rows in grid])
    columns = np.stack([1 / seconds, sizes / seconds], axis=1)
    (a, b), *_ = np.linalg.lstsq(columns, np.ones(len(seconds)), rcond=None)
    return float(a), float(b)


def table(grid: dict, deviations: dict) -> Table:
    """Particles down, rows across."""
    lines = []
    for p in PARTICLES:
        cells = [f"{_format_time(grid[p, b])} ({deviations[p, b]:+.0f} %)" if (p, b) in grid else "" for b in ROWS]
        lines.append([f"{p:,}", *cells])
    return Table("Filter kernel, time of a call", ["particles", *(f"B = {b}" for b in ROWS)], lines)


def _format_time(seconds: float) -> str:
    return f"{1e6 * seconds:.1f} us" if seconds < 1e-3 else f"{1e3 * seconds:.3g} ms"


# --- the plots ----------------------------------------------------------------------------------------------

Lines = dict[str, list[tuple[int, float]]]


def against_particles(options: Options, console: Console, result: Result) -> Lines:
    """(P, seconds a step) by implementation, one row."""
    sizes = PLOT_PARTICLES[:3] if options.short else PLOT_PARTICLES
    lines: Lines = {}
    for p in sizes:
        console.print(f"every implementation, {p} particles", style="dim")
        entered = _enter_present(RACED, Problem.draw("position", p), result.skipped)
        _add_points(lines, p, interleave({name: each.step for name, each in entered.items()}, _fewer_rounds(options)))
    return lines


def against_rows(options: Options, console: Console) -> Lines:
    """(B, seconds a step of all rows) by implementation, P = 5000."""
    lines: Lines = {}
    for rows in ROWS[:3] if options.short else ROWS:
        console.print(f"every implementation, {rows} rows", style="dim")
        problem = shared_cloud(5000, rows)
        for name in RACED:  # one in memory at a time: with many rows some need gigabytes
            for implementation in _enter_present([name], problem, {}).values():
                once = options.short or rows >= FEW
                times = (
                    _time_once(name, implementation)
                    if once
                    else interleave({name: implementation.step}, _fewer_rounds(options))
                )
                _add_points(lines, rows, times)
    return lines


def _enter_present(names: Iterable[str], problem: Problem, skipped: dict[str, str]) -> dict:
    entered = {}
    for name in names:
        try:
            entered[name] = enter(name, problem)
        except Absent as reason:
            skipped[name] = str(reason)
    return entered


def _add_points(lines: Lines, x: int, times: Times) -> None:
    for name in times.seconds:
        lines.setdefault(name, []).append((x, times.median(name)))


def _fewer_rounds(options: Options) -> Options:
    """A plot on log axes needs no more."""
    return Options(min(options.rounds, 5), options.short)


def _time_once(name: str, implementation: Implementation) -> Times:
    """One step: of many rows it is long enough. Batched ones compile and touch their memory before."""
    if not isinstance(implementation, Looped):
        implementation.step()
    return interleave({name: implementation.step}, Options(rounds=1), turn_s=0.0, warm=False)


if __name__ == "__main__":
    main(measure, __doc__)
