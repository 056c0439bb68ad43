"""Binary sensors: locating and tracking with one bit (Zhou, Cheng & Xing, 2009), its experiments beside ours.

600 nodes in 500 m x 500 m sense within R = 60 m; in every period of T = 1 s those whose state has changed since the
last report it to a sink. The target goes from (0, 500) m at (10, -10) m/s; what counts is the steady part, 15 to 40 s.
All nodes are awake, and a first search tells the sink who detects at the start.

A system is a tracker (see trackers/boundary.py) and where it starts:

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
"""

from __future__ import annotations

from pathlib import Path

from wsn_env.evaluation.progress import Progress, progress_bar
from wsn_env.papers.binary import figures
from wsn_env.papers.binary.claims import Study, judge_claims, list_expectations
from wsn_env.papers.binary.coverage import COVERAGE
from wsn_env.papers.binary.systems import play_paper
from wsn_env.papers.claim import write_and_print_claims
from wsn_env.papers.coverage import write_coverage
from wsn_env.papers.sheet import prepare_folder, show_sheet


def reproduce(out: Path, runs: int, progress: Progress | None = None) -> None:
    """Play the paper's experiments, write every file to `out` and print tables, claims and expected figures."""
    prepare_folder(out)
    with progress_bar(progress) as show:
        results = play_paper(runs, show)
    study = Study(results)
    claims, expectations = judge_claims(study), list_expectations(study)
    figures.write_figures(out, study)
    show_sheet(out / "systems.md", "Systems", figures.systems(results), f"{runs} runs, 15 to 40 s")
    caption = "fixes with the true velocity, well conditioned"
    show_sheet(out / "readings.md", "Readings", figures.readings(study), caption)
    caption = "flip: misread states; packet_success: of the only try of a report"
    show_sheet(out / "faults.md", "Faults", figures.faults(results), caption)
    write_coverage(out / "coverage.md", COVERAGE)
    write_and_print_claims(out, claims, expectations)
