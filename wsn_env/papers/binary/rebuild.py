"""Binary sensors: locating and tracking with one bit (Zhou, Cheng & Xing, 2009), its experiments beside ours.

600 nodes in 500 m x 500 m sense within R = 60 m; in every period of T = 1 s those whose state has changed since the
last report it to a sink. The target goes from (0, 500) m at (10, -10) m/s; what counts is the steady part, 15 to 40 s.
All nodes are awake, and a first search tells the sink who detects at the start.

A system is a tracker (see filters/boundary.py) and where it starts:

    raw            the least-squares fix of each period, the true velocity given
    paper          recursive least squares over fixes shifted by its own velocity, from the edge of the field
    paper_inside   the same from where the whole disc has entered the field, at 7 s
    mid, ekf       the filter of mid-period fixes and that of single ranges, from inside
    particle       the particle filter on the whole bitmap, from inside: a silent node tells something, too
    centroid       the mean of the nodes that detect, each of which reports in every period; centroid_rls filters it

Our reading where the text is ambiguous: all pairs of boundary nodes make the equations of a fix; a fix is moved on by
(T/2) v with the same sign for nodes entered and left; fewer than four boundary nodes give way to the centroid; the
covariance is predicted before the gain is taken. `readings` tries the others.

**Means and medians.** A fix from few nodes is sometimes almost singular, so that the RMS of `raw` hangs on a handful
of periods.
**Faults.** One misread bit in a thousand makes false boundary nodes that ruin least squares; a gate keeps them out. A
lost report leaves the bitmap wrong until the node changes again; a refresh in every so many periods heals it, at the
price of every node's report.
**Lifetime.** Batteries of 5 mJ and random waypoints at the same speed, for 2,000 periods: when nodes have died.
**Unequal radii.** Eqs. 3-8 need no R where all nodes have the same. Where each has its own, a tracker that knows them
puts their squares into the equations; one that does not errs.
"""

from __future__ import annotations

from pathlib import Path

from wsn_env.evaluation.progress import Progress, progress_bar
from wsn_env.papers.binary import tables
from wsn_env.papers.binary.claims import judge_claims
from wsn_env.papers.binary.coverage import COVERAGE
from wsn_env.papers.binary.expected import list_expectations
from wsn_env.papers.binary.figures import write_figures
from wsn_env.papers.binary.results import Results, play_paper
from wsn_env.papers.binary.study import Study
from wsn_env.papers.claim import write_and_print_claims
from wsn_env.papers.coverage import write_coverage
from wsn_env.papers.sheet import Sheet, prepare_folder, show_sheet, write_sheet


def reproduce(out: Path, runs: int, progress: Progress | None = None) -> None:
    """Play the paper's experiments, write every file to `out` and print tables, claims and expected figures."""
    prepare_folder(out)
    with progress_bar(progress) as show:
        results = play_paper(runs, show)
    study = Study(results)
    write_figures(out, results)
    for name, (title, sheet, caption) in list_tables(results, study).items():
        write_sheet(out / f"{name}.csv", sheet)
        show_sheet(out / f"{name}.md", title, sheet, caption)
    write_coverage(out / "coverage.md", COVERAGE)
    write_and_print_claims(out, judge_claims(study), list_expectations(study))


def list_tables(results: Results, study: Study) -> dict[str, tuple[str, Sheet, str]]:
    """By file: title, table, caption."""
    runs = f"{results.runs} runs, 15 to 40 s; in brackets standard errors over the runs"
    found = {"systems": ("Systems", tables.systems(results), runs)}
    for name, (_, _, heading) in tables.SWEEPS.items():
        found[name] = (f"Error over the {heading}", tables.sweep(results, name), runs)
        found[f"{name}_antnp"] = (f"Transmitting nodes over the {heading}", tables.counts(results, name), runs)
    fixes = "well-conditioned fixes with the true velocity, but for the last row"
    cost = "mean errors; transmitting nodes and energy are those of paper"
    return found | {
        "crossings": ("Sampling periods from which the centroid is better", tables.crossings(results), runs),
        "readings": ("Readings", tables.readings(study), fixes),
        "faults": ("Faults", tables.faults(results), cost),
        "unequal": ("Unequal radii", tables.unequal_radii(results), "mean errors"),
    }
