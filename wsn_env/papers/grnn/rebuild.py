"""Fingerprints and an iterated cubature Kalman filter (Lan, Nie et al.): its comparisons beside ours.

A target that carries a node is located from the strength of signals between it and eight anchors. A general regression
network (Specht, 1991) turns strengths into a position; fruit fly optimisation (Pan, 2012) chooses its width; a cubature
Kalman filter with a constant velocity follows, iterated or not. Beside it stand linear least squares (eq. 9), nonlinear
least squares, nearest fingerprints, and on the strengths themselves the extended, unscented, cubature and iterated
cubature filters and a particle filter.

The text's figures are lost for the greater part, so the numbers are our reading: a field of 200 m x 200 m; eight
anchors on its border (ring8) or four corners and four inside (mix8), all heard everywhere; strength -40 - 30 lg d dB,
noise 3 dB a sample; 50 s from (20, 15) m at (10, 5), (2, 6), (-8, 2), (-3, -9) m/s for 12.5 s each; filters with white
acceleration of 3 m^2/s^3 (here constant within a period, with sd sqrt(3 / T) m/s^2: the same but for T^3/4 m^2 in the
position); a map of 441 points, 10 m apart, each the mean of 10 samples, and 400 random points to choose the width by.
A filter begins with the network's fix of its first period, at rest with a sd of 10 m/s. "ICKF" on the strengths does
so, too, and therefore is not without the network: beside it stands one begun in the field's middle.

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
from wsn_env.papers.claim import write_and_print_claims
from wsn_env.papers.coverage import write_coverage
from wsn_env.papers.grnn import figures, tables
from wsn_env.papers.grnn.claims import judge_claims, list_expectations
from wsn_env.papers.grnn.comparison import compare, errors_of_methods
from wsn_env.papers.grnn.coverage import COVERAGE
from wsn_env.papers.grnn.pitfalls import pitfalls
from wsn_env.papers.grnn.strengths import listen
from wsn_env.papers.grnn.systems import COMPARED_S, PERIODS_S, play_paper
from wsn_env.papers.grnn.targets import many_targets
from wsn_env.papers.sheet import Sheet, prepare_folder, write_sheet


def reproduce(out: Path, runs: int, progress: Progress | None = None) -> None:
    """Play every comparison, write every file to `out` and print tables, claims and expected figures."""
    prepare_folder(out)
    with progress_bar(progress) as show:
        results = play_paper(runs, show)
    heard = {period_s: listen(period_s, runs) for period_s in PERIODS_S}
    compared, searches = errors_of_methods(results, heard[COMPARED_S]), tables.widths(runs)
    sheets = {
        "errors": tables.errors(results),
        "equal_information": tables.equal_information(results),
        "poor_start": tables.poor_start(results),
        "iteration": tables.iteration(results),
        "smoothing": tables.smoothing(heard),
        "comparison": compare(compared),
        "width": tables.width_table(searches),
        "bound": Sheet(("anchors", "bound of one period m"), list(results.bound_m.items())),
        "pitfalls": pitfalls(runs),
        "targets": many_targets(),
    }
    for name, sheet in sheets.items():
        write_sheet(out / f"{name}.csv", sheet)
    figures.write_figures(out, results, heard[COMPARED_S], compared)
    _show_tables(out, sheets, runs)
    write_coverage(out / "coverage.md", COVERAGE)
    expectations = list_expectations(results, searches, compared)
    write_and_print_claims(out, judge_claims(results, searches), expectations)


def _show_tables(out: Path, sheets: dict[str, Sheet], runs: int) -> None:
    tables.show_errors(out, sheets["errors"], runs)
    tables.show_equal_information(out, sheets["equal_information"])
    tables.show_poor_start(out, sheets["poor_start"])
    tables.show_smoothing(out, sheets["smoothing"])
    titles = {
        "iteration": "Iteration with a fix to begin with, 3 dB",
        "comparison": "Methods compared, T = 0.5 s",
        "width": "Width of the network",
        "bound": "Static Cramer-Rao bound, root mean square along the path",
        "pitfalls": "How not to evaluate, T = 1 s",
        "targets": "Many targets, T = 0.5 s, the first 2.5 s",
    }
    for name, title in titles.items():
        tables.show_measured(out / f"{name}.md", title, sheets[name])
