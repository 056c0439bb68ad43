"""The tables: Table 2 of Xiang & Guo (2013), and what stands behind its figures and claims."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from wsn_env.evaluation.intervals import Measured, standard_error
from wsn_env.papers.pre_dc.expected import EXPECTED_TIMES, PAPER_RMS_M
from wsn_env.papers.pre_dc.measures import (
    STATIC_ENERGY,
    difference,
    periods_tracked,
    quarters,
    sd_over_periods_m,
    static_energy_mj,
    system_sd_m,
)
from wsn_env.papers.pre_dc.systems import (
    FOLLOWED,
    LIFETIME_POLICIES,
    NODES,
    PARTICLES,
    SAME_TRACKER,
    SYSTEMS,
    Results,
    motion_trial,
)
from wsn_env.papers.sheet import Sheet, show_sheet, show_table, write_sheet

TITLES = {
    "static": "static",
    "ekf": "EKF, 2 nodes, q = 0.03 (fitted)",
    "ekf_same_q": "EKF, 2 nodes, q = 0.02",
    "ekf_three": "EKF, 3 nodes, q = 0.02",
    "pre_dc": "Pre-DC, q = 0.02",
    "pre_dc_joint": "Pre-DC, joint fusion",
}
EKFS = ("ekf", "ekf_same_q", "ekf_three")


def write_tables(out: Path, results: Results) -> None:
    """Every table as CSV and Markdown, and on the terminal."""
    table = table2(results)
    write_sheet(out / "table2.csv", table)
    _show_table2(out / "table2.md", table)
    for name, (title, make) in TABLES.items():
        sheet = make(results)
        write_sheet(out / f"{name}.csv", sheet)
        show_sheet(out / f"{name}.md", title, sheet)


def table2(results: Results) -> Sheet:
    """Table 2: mean over runs of the RMS [m], the paper's and ours."""
    rows = []
    for nodes in NODES:
        for name in SYSTEMS:
            rms = results.system_rms_m(name, nodes)
            paper = PAPER_RMS_M.get((name, nodes))
            rows.append((nodes, name, paper, rms.mean(), standard_error(rms), len(rms)))
    return Sheet(("nodes", "system", "paper_rms_m", "rms_m", "stderr_m", "runs"), rows)


def _show_table2(path: Path, table: Sheet) -> None:
    rows = []
    for i in range(0, len(table.rows), len(SYSTEMS)):
        cells = table.rows[i : i + len(SYSTEMS)]
        shown = (f"{paper:.3f} / " if paper else "" for _, _, paper, *_ in cells)
        ours = (f"{rms:.3f} ({error:.3f})" for *_, rms, error, _ in cells)
        rows.append([str(cells[0][0]), *map("".join, zip(shown, ours, strict=True))])
    show_table(path, "Table 2: RMS m, paper / ours", ("nodes", *(TITLES[name] for name in SYSTEMS)), rows)


def against_ekf(results: Results) -> Sheet:
    """By how much each EKF's RMS exceeds Pre-DC's, paired; negative: Pre-DC's is larger."""
    rows: list[tuple] = []
    for nodes in NODES:
        pre_dc = results.system_rms_m("pre_dc", nodes)
        excess = (difference(results.system_rms_m(name, nodes), pre_dc) for name in EKFS)
        rows.append((nodes, *(figure for pair in excess for figure in pair)))
    columns = (column for name in EKFS for column in (f"{TITLES[name]} m", f"stderr of {name} m"))
    return Sheet(("nodes", *columns), rows)


def same_tracker(results: Results) -> Sheet:
    """The comparison with one tracker for all, at 225 nodes; energy is the mean of a period."""
    records = {policy: results.same_tracker(policy) for policy in SAME_TRACKER}
    records["pre_dc with Φ0 alone"] = results.as_printed()
    rows = [
        (policy, *Measured.mean(record.rms_m()), *Measured.mean(record.energy_mj.mean(axis=1)))
        for policy, record in records.items()
    ]
    return Sheet(("policy", "RMS m", "stderr m", "energy mJ a period", "stderr mJ"), rows)


def energy(results: Results) -> Sheet:
    """Pre-DC's energy beside the static system's, as this is read, by the number of nodes."""
    rows = []
    for reading, title in STATIC_ENERGY.items():
        for nodes in NODES:
            static = static_energy_mj(results, reading, nodes)
            pre_dc = results.system("pre_dc", nodes).energy_mj.mean(axis=1)
            share, error = Measured.ratio(100 * pre_dc, static)
            expected = EXPECTED_TIMES.get((reading, nodes))
            means = *Measured.mean(static), *Measured.mean(pre_dc)
            figures = *means, share, error, *Measured.ratio(static, pre_dc), expected
            rows.append((f"{title}, {nodes} nodes", *figures))
    columns = ("static mJ a period", "stderr", "Pre-DC mJ a period", "stderr", "Pre-DC's share %", "stderr")
    return Sheet(("static's energy", *columns, "static / Pre-DC", "stderr", "expected"), rows)


def systems(results: Results) -> Sheet:
    """How much the error of a run varies over its periods, and what a period costs, at 225 nodes."""
    records = {name: results.system(name) for name in SYSTEMS}
    spreads = {TITLES[name]: (system_sd_m(results, name), record) for name, record in records.items()}
    cluster = results.same_tracker("static_cluster")
    spreads["static cluster, one tracker"] = sd_over_periods_m(cluster), cluster
    rows = [
        (title, *Measured.mean(spread), *Measured.mean(record.energy_mj.mean(axis=1)))
        for title, (spread, record) in spreads.items()
    ]
    columns = ("sd of the error over the periods m", "stderr m", "energy mJ a period", "stderr mJ")
    return Sheet(("system", *columns), rows)


def stability(results: Results) -> Sheet:
    """Figs. 5-6: RMS in each quarter of the run and over all of it."""
    rows = []
    for motion, tracking in FOLLOWED:
        record = results.motion(motion, tracking)
        figures = (figure for pair in (*quarters(record), record.pooled_rms_m()) for figure in pair)
        q = motion_trial(motion, results.runs, tracking).scenario.filter_q
        search = ", no search" if tracking == "as read" else ""
        rows.append((f"{motion}, q = {q:g}{search}", *figures))
    columns = (column for i in range(1, 5) for column in (f"quarter {i}: RMS m", "stderr m"))
    return Sheet(("track and filter", *columns, "whole run: RMS m", "stderr m"), rows)


def particles(results: Results) -> Sheet:
    """Figs. 7-8: error along the axes against the number of particles, and what 5,000 of them gain, paired."""
    best = results.particles(5000).rms_m()
    rows = []
    for count in PARTICLES:
        record = results.particles(count)
        x, y = (Measured.mean(record.axis_rms_m(axis)) for axis in (0, 1))
        rows.append((count, *x, *y, *difference(record.rms_m(), best)))
    columns = ("RMS in x m", "stderr m", "RMS in y m", "stderr m", "excess over 5000 particles m", "stderr m")
    return Sheet(("particles", *columns), rows)


def lifetime(results: Results) -> Sheet:
    """How long a network with small batteries follows the target."""
    rows = [(policy, *Measured.mean(periods_tracked(results.lifetime(policy)))) for policy in LIFETIME_POLICIES]
    return Sheet(("policy", "periods", "stderr"), rows)


TABLES: dict[str, tuple[str, Callable[[Results], Sheet]]] = {
    "against_ekf": ("RMS of EKF minus that of Pre-DC", against_ekf),
    "same_tracker": ("One tracker for all, 225 nodes", same_tracker),
    "energy": ("Energy beside static's", energy),
    "systems": ("Variation of the error over the periods, and energy, 225 nodes", systems),
    "stability": ("Figs. 5-6: RMS by quarter of the run", stability),
    "particles": ("Figs. 7-8: RMS by number of particles", particles),
    "lifetime": ("Periods until the target is lost for good", lifetime),
}
