"""One step of the particle filter at P = 5000 with the reports of m = 4 members: predict, weigh, mean and covariance,
N_eff, resample. At least 60 times as fast as Stone Soup (100 times with fast=True), 5 times as fast as tuned NumPy (6),
and at half the speed of C (three quarters).

    python -m benchmarks.filter_step [--rounds N] [--short] [--json FILE]

First every implementation has to compute the same posterior. Slowdowns are over wsn_env's strict kernel in the same
round. With --short only positions.
"""

from rich.console import Console

from benchmarks.filters import IMPLEMENTATIONS, SLOW_STARTERS, Problem, enter, kind_of
from benchmarks.filters.agreement import check_agreement
from benchmarks.race import Claim, Options, Result, Table, Times, figure, interleave, main

PARTICLES = 5000
ROWS = 16
STRICT, FAST = "wsn_env, strict", "wsn_env, fast"
MEASUREMENTS = {"position": "positions", "rssi": "log-distance strengths"}
OPPONENTS = {  # how many times as long as ours, strict and fast, they take; in which cases
    "Stone Soup": ((60.0, 100.0), {"Stone Soup, m updates": "m updates, ", "Stone Soup, one update": "one update, "}),
    "tuned NumPy f32": ((5.0, 6.0), {"NumPy f32, tuned": ""}),
}
C, C_SHARES = "C, -O3 -march=native", (50.0, 75.0)  # % of its speed, strict and fast


def measure(options: Options, console: Console) -> Result:
    """Check, then race for both measurements."""
    result = Result(
        name="filter_step",
        title="One filter step",
        text=f"P = {PARTICLES}, m = 4 reports, resampling in every step, one thread. Microseconds a step of a row, and"
        " slowdown against the strict kernel in the same round (median, quartiles). Implementations without a batch"
        f" form have no figures at {ROWS} rows.",
    )
    names = [name for name in IMPLEMENTATIONS if name not in SLOW_STARTERS or not options.short]
    result.skipped |= {name: "a short run" for name in IMPLEMENTATIONS if name not in names}
    for measurement in list(MEASUREMENTS)[: 1 if options.short else None]:
        words = MEASUREMENTS[measurement]
        checks, absent = check_agreement(names, measurement, options.short)
        result.skipped |= absent
        console.print(f"{words}: {len(checks)} implementations compute the same posterior")
        times = {rows: race(list(checks), measurement, rows, options) for rows in (1, ROWS)}
        result.tables.append(table(f"Filter step, {words}", checks, times))
        result.claims += claims(words, times[1], result.skipped)
        result.figures[measurement] = {
            "agreement": checks,
            "seconds": {str(rows): found.seconds for rows, found in times.items()},
        }
        result.packages += [package for name in checks if (package := kind_of(name).package)]
    return result


def race(names: list[str], measurement: str, rows: int, options: Options) -> Times:
    """Times a row; with more than one, only of those who batch."""
    problem = Problem.draw(measurement, PARTICLES, rows)
    entered = {name: enter(name, problem) for name in names if rows == 1 or kind_of(name).batches}
    return interleave(
        {name: implementation.step for name, implementation in entered.items()}, options, dict.fromkeys(entered, rows)
    )


def table(title: str, names, times: dict[int, Times]) -> Table:
    """A line an implementation, slowest first."""
    lines = []
    for name in sorted(names, key=times[1].median, reverse=True):
        line = [name]
        for found in times.values():
            if name not in found.seconds:
                line += ["", ""]
                continue
            low, high = found.spread(name, STRICT)
            line += [f"{1e6 * found.median(name):.1f}", f"{figure(found.ratio(name, STRICT))} ({_span(low, high)})"]
        lines.append(line)
    return Table(title, ["implementation", "us, 1 row", "slowdown", f"us/row, {ROWS} rows", "slowdown"], lines)


def _span(low: float, high: float) -> str:
    return f"{figure(low)}-{figure(high)}"


def claims(words: str, times: Times, absent: dict[str, str]) -> list[Claim]:
    """Each for the strict and the fast kernel, one row."""
    made = []
    for mode, (ours, label) in enumerate(((STRICT, "strict"), (FAST, "fast"))):
        for opponent, (targets, cases) in OPPONENTS.items():
            for name, case in cases.items():
                measured, why = _ratio(times, name, ours, absent)
                what = f"filter step, {label}: speed over {opponent}"
                made.append(Claim(what, targets[mode], measured, why=why, case=case + words))
        share, why = _ratio(times, C, ours, absent)
        share = None if share is None else 100 * share
        what = f"filter step, {label}: share of the speed of C"
        made.append(Claim(what, C_SHARES[mode], share, "%", why=why, case=words))
    return made


def _ratio(times: Times, name: str, ours: str, absent: dict[str, str]) -> tuple[float | None, str]:
    """The ratio, or None and why not."""
    for one in (ours, name):
        if one not in times.seconds:
            return None, absent.get(one, f"no {one}")
    return times.ratio(name, ours), ""


if __name__ == "__main__":
    main(measure, __doc__)
