"""Tracking under water by the strongest signal (patent CN103152791), its claims beside ours.

The node with the strongest signal is head, every node within one hop of it is a member, a member reports only above a
threshold, the head hands mean and covariance to the next one, and the particle filter sets further copies of a particle
about it instead of on it, until the target leaves the field. The patent gives no figures; what is expected here is an
independent implementation's.

Our reading, in two dimensions (depth comes from a pressure gauge): Underwater-v0's field of 1 km x 1 km, 64 nodes, one
hop of 250 m, periods of 5 s, levels with 3 dB of noise, a threshold of 85 dB. The target cruises from about 2 m/s, with
white acceleration of density 1e-5 m^2/s^3 (smooth, 60 periods), 1e-3 (60) or 3e-2 (rough, 30), and the filter knows
which. It resamples in every period; nobody searches for a lost target; the start is known with sd 20 m and 1 m/s.
A density D is a process noise of sd sqrt(D / T) in periods of T, up to an independent D T^3 / 12 in the variance of a
position: 0.3 m^2 at most.

**Resampling.** "the patent's": one spread for all parents, half the sds of the cloud; "ours": a spread of each parent's
own, half a draw of the cloud's covariance.
**Head.** The node that *reported* the strongest signal in the last period leads in the next one; the patent's nodes
compare the signal of the same period. The target moves 10 m between the two.
**Silence.** A node reports when its level exceeds the threshold, the head like every other, so that a silent one tells
that its level was below: silence told or silence ignored.
**Handover.** "carried": the new head goes on with the particles, which all are sent; "redrawn": it draws them anew from
mean and covariance, as the patent has it.
**Lost.** A run is lost when its mean error over the last ten periods exceeds 100 m.
**Leaving.** Tracks that are not kept inside, until the first period in which the target is outside the field.
**Lifetime.** Batteries of 30 J and random waypoints at 2 m/s, for 1,000 periods: when nodes have died.
**Energy.** An invitation goes to every new member, to all when the head changes; a word to resample to all, each
period. Sleeping costs are with sensing.
"""

from __future__ import annotations

from pathlib import Path

from wsn_env.evaluation.progress import Progress, progress_bar
from wsn_env.papers.claim import write_and_print_claims
from wsn_env.papers.coverage import write_coverage
from wsn_env.papers.sheet import prepare_folder, show_sheet, write_sheet
from wsn_env.papers.underwater.claims import judge_additions, judge_claims
from wsn_env.papers.underwater.coverage import COVERAGE
from wsn_env.papers.underwater.expected import list_expectations
from wsn_env.papers.underwater.figures import write_figures
from wsn_env.papers.underwater.systems import play_system
from wsn_env.papers.underwater.tables import SHOWN, make_tables


def reproduce(out: Path, runs: int, progress: Progress | None = None) -> None:
    """Play the experiments, write every file to `out` and print tables, claims and expected figures."""
    prepare_folder(out)
    with progress_bar(progress) as show:
        results = play_system(runs, show)
    tables = make_tables(results)
    for name, sheet in tables.items():
        write_sheet(out / f"{name}.csv", sheet)
    write_figures(out, results, tables["error"])
    for name, title in SHOWN.items():
        show_sheet(out / f"{name}.md", title, tables[name])
    write_coverage(out / "coverage.md", COVERAGE)
    write_and_print_claims(out, judge_claims(results), list_expectations(results), judge_additions(results))
