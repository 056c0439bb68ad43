"""Pre-DC: prediction-based dynamic clustering (Xiang & Guo, 2013), its Table 2 and Figs. 1 and 3-8 beside ours.

A system of the paper is a (policy, tracker) pair:

    static          every node awake, and no memory: the plain mean of what the detecting nodes measure in a period;
                    periods without a detection are left out
    ekf             the two nodes nearest to the prediction, extended Kalman filter with q = 0.03 m/s^2
    pre_dc          Pre-DC clusters, particle filter with pooled fusion (eqs. 9-15)
    pre_dc_joint    the same with joint fusion, which the paper does not have

Our reading of the paper's experiment, where its text is silent or ambiguous: each detecting node measures a position
with sd 1.75 m (eq. 7); the target goes straight along the diagonal from (5, 5) m at 0.9 m/s an axis, without noise; the
filter has q = 0.02 m/s^2; the first mean is drawn from N(truth, P0), P0 = diag(1, .01, 1, .01); detection is a draw
with p(d) in each period; nobody searches for a lost target. Table 1 holds for the rest (225 nodes, P = 5000, 100 s).

**Two tables, and why they differ.** Table 2 compares systems, and its static one has no filter: with n detecting nodes
its error is that of one period's mean, about 1.75 sqrt(2 / n) m, however long it has followed the target. The
environments' own comparison gives every policy the same tracker (same_tracker.csv). Then the static cluster, too,
averages over time; it hears more nodes than Pre-DC and so has the *lower* error, for about three times Pre-DC's
energy at 225 nodes. What Pre-DC saves is energy; that its error is the lowest is due to the trackers that it is
compared with. A claim that also holds with one tracker "holds"; one that needs the paper's trackers "holds under a
stated reading". In that table nearest1 always lets the nearest node lead, as the EKF system does, and the centroid
policy, which has no motion model, seldom finds a target again that it has lost, as there is no search.

**Fig. 1** is our reading, p(d) of eqs. 2-3 with Table 1: the text of the figure that we have is unsure.
**Fig. 4.** The static system keeps every node awake and forms no cluster, so its energy is taken to be that of its
reports alone, the reading least favourable to Pre-DC, which is charged for everything. (The world also charges
invitations to all nodes whenever the head changes; column static_total_mj.)
**Figs. 5-6.** With q = 0.02 m/s^2 a curved path makes the constant velocity filter diverge: it trusts its old heading
and leaves the target behind. So each motion is tracked with its `fitting_q` (0.2 m/s^2 for the curved ones), and
the network searches for lost tracks, as the environments do; without the search about two circles in a hundred are
lost. The diagonal needs neither.
"""

from __future__ import annotations

from pathlib import Path

from wsn_env.evaluation.progress import Progress, progress_bar
from wsn_env.papers.claim import write_and_print_claims
from wsn_env.papers.coverage import write_coverage
from wsn_env.papers.pre_dc import figures
from wsn_env.papers.pre_dc.claims import PAPER_RMS_M, judge_claims, list_expectations
from wsn_env.papers.pre_dc.coverage import COVERAGE
from wsn_env.papers.pre_dc.systems import NODES, SAME_TRACKER, SYSTEMS, Results, play_paper
from wsn_env.papers.rollout import standard_error
from wsn_env.papers.sheet import Sheet, prepare_folder, show_table, write_sheet


def reproduce(out: Path, runs: int, progress: Progress | None = None) -> None:
    """Play the paper's experiments, write every file to `out` and print both tables, claims and expected figures."""
    prepare_folder(out)
    with progress_bar(progress) as show:
        results = play_paper(runs, show)
    table, same = table2(results), same_tracker(results)
    claims, expectations = judge_claims(results), list_expectations(results)
    write_sheet(out / "table2.csv", table)
    write_sheet(out / "same_tracker.csv", same)
    figures.write_figures(out, results)
    _show_tables(out, table, same, runs)
    write_coverage(out / "coverage.md", COVERAGE)
    write_and_print_claims(out, claims, expectations)


def table2(results: Results) -> Sheet:
    """Table 2: mean over runs of the RMS [m], the paper's and ours."""
    rows = []
    for nodes in NODES:
        for name in SYSTEMS:
            rms = results.system_rms_m(name, nodes)
            paper = PAPER_RMS_M.get((name, nodes))
            rows.append((nodes, name, paper, rms.mean(), standard_error(rms), len(rms)))
    return Sheet(("nodes", "system", "paper_rms_m", "rms_m", "stderr_m", "runs"), rows)


def same_tracker(results: Results) -> Sheet:
    """The comparison with one tracker for all, at 225 nodes; energy is the mean of a period."""
    rows = []
    for policy in SAME_TRACKER:
        record = results.same_tracker(policy)
        rms = record.rms_m()
        rows.append((policy, rms.mean(), standard_error(rms), record.energy_mj.mean()))
    return Sheet(("policy", "rms_m", "stderr_m", "energy_mj"), rows)


def _show_tables(out: Path, table: Sheet, same: Sheet, runs: int) -> None:
    rows = []
    for i in range(0, len(table.rows), len(SYSTEMS)):
        cells = table.rows[i : i + len(SYSTEMS)]
        rows.append([str(cells[0][0])] + [f"{p or '-'} / {rms:.3f} ({se:.3f})" for _, _, p, rms, se, _ in cells])
    caption = f"mean RMS [m]: paper / ours (standard error); {runs} runs, static {SYSTEMS['static'].runs_factor * runs}"
    show_table(out / "table2.md", "Table 2", ("nodes", *SYSTEMS), rows, caption)
    cells = [(name, f"{rms:.3f} ({se:.3f})", f"{energy:.4f}") for name, rms, se, energy in same.rows]
    caption = "225 nodes, particle filter with pooled fusion for every policy"
    show_table(
        out / "same_tracker.md", "One tracker for all", ("policy", "RMS [m]", "energy [mJ/period]"), cells, caption
    )
