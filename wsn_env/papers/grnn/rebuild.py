"""Fingerprints and an iterated cubature Kalman filter (Lan, Nie et al.): its comparisons beside ours.

A target that carries a node is located from the strength of signals between it and eight anchors. A general regression
network (Specht, 1991) turns strengths into a position; fruit fly optimisation (Pan, 2012) chooses its width; a cubature
Kalman filter with a constant velocity follows, iterated or not. Beside it stand linear least squares (eq. 9), nonlinear
least squares, and the extended, unscented, cubature and iterated cubature filters on the strengths themselves.

The text's figures are lost for the greater part, so the numbers are our reading: a field of 200 m x 200 m; eight
anchors on its border (ring8) or four corners and four inside (mix8), all heard everywhere; strength -40 - 30 lg d dB,
noise 3 dB a sample; 50 s from (20, 15) m at (10, 5), (2, 6), (-8, 2), (-3, -9) m/s for 12.5 s each; filters with white
acceleration of 3 m^2/s^3 (here constant within a period, with sd sqrt(3 / T) m/s^2: the same but for T^3/4 m^2 in the
position); a map of 441 points, 10 m apart, each the mean of 10 samples, and 400 random points to choose the width by.
A filter begins with the network's fix of its first period, at rest with a sd of 10 m/s.

**The combination** is GRNN + KF: the network's fixes are positions, and for these a cubature filter, iterated or not,
is the Kalman filter. As noise it takes the spread of the fix on the map. Against the filters on the strengths
themselves it gains where the period is long and each period's belief is wide; where it is short they are as good.
**ICKF** is iterated posterior linearisation, which always corrects the prior. To correct the posterior again with the
same strengths, as some do, counts them several times.
**Sampling period.** Every sample has its own noise, so that a shorter period brings more information. At an equal rate
of information (noise sqrt(1 s / T) dB) a longer period is better, if anything: the claim is one about sampling.
**Warning** (pitfalls.csv). Metre-level errors published for such systems come from programs that set the filter back to
the true state in every period, or train the network on the path that it is tested on. Here nothing of the truth reaches
a tracker but through the reports (tests/test_leakage.py), and the Cramer-Rao bound of a single period is 16.8 m: what a
filter gains, it gains by averaging over time. The network lies just below it, since a field known to end at 200 m makes
a biased estimate better than any unbiased one.
"""

from __future__ import annotations

from pathlib import Path

from wsn_env.evaluation.progress import Progress, progress_bar
from wsn_env.filters.fingerprint import training_of
from wsn_env.papers.claim import write_and_print_claims
from wsn_env.papers.coverage import write_coverage
from wsn_env.papers.grnn import figures
from wsn_env.papers.grnn.claims import EXPECTED_RMSE_M, judge_claims, list_expectations
from wsn_env.papers.grnn.coverage import COVERAGE
from wsn_env.papers.grnn.pitfalls import pitfalls
from wsn_env.papers.grnn.systems import (
    ANCHORS,
    EQUAL_INFORMATION,
    METHODS,
    PERIODS_S,
    STARTED,
    STARTS,
    Results,
    play_paper,
    scenario_as_read,
)
from wsn_env.papers.sheet import Sheet, prepare_folder, show_sheet, show_table, write_sheet


def reproduce(out: Path, runs: int, progress: Progress | None = None) -> None:
    """Play every comparison, write every file to `out` and print tables, claims and expected figures."""
    prepare_folder(out)
    with progress_bar(progress) as show:
        results = play_paper(runs, show)
    widths = {search: training_of(scenario_as_read("grnn")).best_width(search) for search in ("golden", "foa")}
    sheets = {
        "rmse": rmse(results),
        "equal_information": equal_information(results),
        "poor_start": poor_start(results),
        "width": Sheet(
            ("search", "width_db", "validation_rmse_m", "evaluations"), [(name, *w) for name, w in widths.items()]
        ),
        "bound": Sheet(("anchors", "static_bound_m"), list(results.bound_m.items())),
        "pitfalls": pitfalls(runs),
    }
    for name, sheet in sheets.items():
        write_sheet(out / f"{name}.csv", sheet)
    figures.write_figures(out, results)
    claims, expectations = judge_claims(results, widths), list_expectations(results, widths)
    _show_tables(out, sheets, runs)
    write_coverage(out / "coverage.md", COVERAGE)
    write_and_print_claims(out, claims, expectations)


def rmse(results: Results) -> Sheet:
    """The main table: root mean square error over all runs and periods, radial and along each axis."""
    rows = []
    for method, expectations in EXPECTED_RMSE_M.items():
        for period_s, expected_m in zip(PERIODS_S, expectations, strict=True):
            record = results.method(method, period_s)
            along = [record.pooled_rms_m(axis)[0] for axis in (0, 1)]
            rows.append((method, period_s, expected_m, *record.pooled_rms_m(), *along))
    return Sheet(("method", "period_s", "expected_m", "rmse_m", "stderr_m", "rmse_x_m", "rmse_y_m"), rows)


def equal_information(results: Results) -> Sheet:
    """The same with noise sqrt(1 s / T) dB."""
    cases = [(method, t) for method in EQUAL_INFORMATION for t in PERIODS_S]
    rows = [(method, t, t**-0.5, *results.equal_information(method, t).pooled_rms_m()) for method, t in cases]
    return Sheet(("method", "period_s", "noise_db", "rmse_m", "stderr_m"), rows)


def poor_start(results: Results) -> Sheet:
    """The first 5 s at T = .5 s and 0.5 dB, from the middle of the field and from a fix."""
    cases = [(anchors, start, method) for anchors in ANCHORS for start in STARTS for method in STARTED]
    rows = [(a, start, method, *results.start(method, a, start).pooled_rms_m()) for a, start, method in cases]
    return Sheet(("anchors", "start", "method", "rmse_m", "stderr_m"), rows)


def _show_tables(out: Path, sheets: dict[str, Sheet], runs: int) -> None:
    rows = []
    for method in METHODS:
        cells = [row for row in sheets["rmse"].rows if row[0] == method]
        rows.append([METHODS[method]] + [f"{row[3]:.2f} ({row[4]:.2f})" for row in cells])
    caption = f"ring8, 3 dB; RMSE [m] (standard error), {runs} runs"
    show_table(
        out / "rmse.md",
        "Error against sampling period",
        ("method", *(f"T = {t:g} s" for t in PERIODS_S)),
        rows,
        caption,
    )
    titles = {
        "equal_information": "At an equal information rate",
        "poor_start": "The first 5 s",
        "width": "Width of the network",
        "pitfalls": "How not to evaluate",
    }
    for name, title in titles.items():
        show_sheet(out / f"{name}.md", title, sheets[name])
