"""The figures of Xiang & Guo (2013) and its eqs. 2-3: what each shows, as CSV and as a picture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from wsn_env.envs.rendering.colours import BLACK, BLUE, DARK, GREEN, GREY, VERMILION
from wsn_env.evaluation.intervals import standard_error
from wsn_env.models.detection.radius import Detection
from wsn_env.papers.pre_dc.cluster import draw_cluster, list_cluster, play_until
from wsn_env.papers.pre_dc.flow_chart import draw_flow_chart
from wsn_env.papers.pre_dc.systems import MOTIONS, PARTICLES, SYSTEMS, Results
from wsn_env.papers.sheet import Sheet, by_period, new_axes, tidy, write_sheet
from wsn_env.reports.pictures import write_picture
from wsn_env.scenario import Scenario
from wsn_env.scenario.sensing import detection_probability

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

STATIC, EKF, PRE_DC = VERMILION, BLUE, BLACK
LOOKS: dict[str, tuple[str, dict[str, Any]]] = {  # system: label, style of its line
    "static": ("static-cluster", dict(color=STATIC, linestyle="--")),
    "ekf": ("EKF, 2 nodes, q = 0.03 (fitted)", dict(color=EKF, linestyle="-.")),
    "ekf_same_q": ("EKF, 2 nodes, q = 0.02", dict(color=GREEN, linestyle=":")),
    "pre_dc": ("Pre-DC", dict(color=PRE_DC, linestyle="-")),
}
TRACKS: dict[str, tuple[str, dict[str, Any]]] = {
    "straight": ("diagonal", dict(color=PRE_DC, linestyle="-")),
    "sine": ("sine", dict(color=EKF, linestyle="--")),
    "circle": ("circle", dict(color=STATIC, linestyle="-.")),
    "turns": ("random turns", dict(color=GREEN, linestyle=":")),
}


def write_figures(out: Path, results: Results) -> None:
    """Every figure's CSV and PNG."""
    detection, situation = Detection(), play_until(SYSTEMS["pre_dc"].trial(225, 1))
    sheets = {
        "detection": detection_curve(detection),
        "fig1": list_cluster(situation),
        "fig3": error_per_period(results),
        "fig4": energy_per_period(results),
        "fig5": tracks(results),
        "fig6": error_on_tracks(results),
        "fig7": error_of_particles(results, 0),
        "fig8": error_of_particles(results, 1),
    }
    pictures = {
        "detection": draw_detection(sheets["detection"], detection),
        "fig1": draw_cluster(situation),
        "fig2": draw_flow_chart(),
        "fig3": draw_error(sheets["fig3"]),
        "fig4": draw_energy(sheets["fig4"]),
        "fig5": draw_tracks(results),
        "fig6": draw_error_on_tracks(sheets["fig6"]),
        "fig7": draw_particles(sheets["fig7"], "x", 7),
        "fig8": draw_particles(sheets["fig8"], "y", 8),
    }
    for name, sheet in sheets.items():
        write_sheet(out / f"{name}.csv", sheet)
    for name, picture in pictures.items():
        write_picture(out / f"{name}.png", picture)


# --- figures as tables --------------------------------------------------------------------------------------


def detection_curve(detection: Detection) -> Sheet:
    """Eqs. 2-3: p(d)."""
    distance = np.linspace(0.0, 15.0, 151)
    p = detection_probability(distance, Scenario(detection=detection))
    return Sheet(("distance_m", "probability"), list(zip(distance, p, strict=True)))


def error_per_period(results: Results) -> Sheet:
    """Fig. 3: RMS over the runs in each period, of the systems at 225 nodes."""
    columns = [results.system(name).rms_per_period_m(SYSTEMS[name].heard_only) for name in LOOKS]
    return by_period([f"{name}_rms_m" for name in LOOKS], columns)


def energy_per_period(results: Results) -> Sheet:
    """Fig. 4: mean energy in each period at 225 nodes."""
    static = results.system("static")
    columns = [static.report_mj, static.energy_mj, results.system("ekf").energy_mj, results.system("pre_dc").energy_mj]
    names = ("static_reports_mj", "static_total_mj", "ekf_mj", "pre_dc_mj")
    return by_period(names, [energy.mean(axis=0) for energy in columns])


def tracks(results: Results) -> Sheet:
    """Fig. 5: the first run's target and estimate on four tracks."""
    rows = []
    for motion in MOTIONS:
        record = results.motion(motion)
        for k, (target, estimate) in enumerate(zip(record.target_m[0], record.estimate_m[0], strict=True)):
            rows.append((motion, k + 1, *target, *estimate))
    return Sheet(("track", "period", "target_x_m", "target_y_m", "estimate_x_m", "estimate_y_m"), rows)


def error_on_tracks(results: Results) -> Sheet:
    """Fig. 6: RMS over the runs in each period on those tracks."""
    columns = [results.motion(motion).rms_per_period_m() for motion in MOTIONS]
    return by_period([f"{motion}_rms_m" for motion in MOTIONS], columns)


def error_of_particles(results: Results, axis: int) -> Sheet:
    """Figs. 7-8: error along x (0) or y (1) against the number of particles."""
    rows = []
    for count in PARTICLES:
        errors = results.particles(count).axis_rms_m(axis)
        rows.append((count, errors.mean(), standard_error(errors), len(errors)))
    return Sheet(("particles", f"rms_{'xy'[axis]}_m", "stderr_m", "runs"), rows)


# --- figures as pictures ------------------------------------------------------------------------------------


def draw_detection(sheet: Sheet, detection: Detection) -> Figure:
    """Eqs. 2-3."""
    title = "Eqs. 2-3: probability of detection"
    figure, axes = new_axes(title, "distance d to the target [m]", "p(d)")
    distance, p = map(np.array, zip(*sheet.rows, strict=True))
    axes.plot(distance, p, color=PRE_DC)
    inner = (1 - detection.softness) * detection.radius_m
    marks = ((inner, "(1 - δ) r"), (detection.radius_m, "r"), (detection.reach_m, "(1 + δ) r"))
    for x, name in marks:
        axes.axvline(x, color=GREY, linewidth=0.8, linestyle=":")
        axes.annotate(name, (x, 0.675), xytext=(3, 0), textcoords="offset points", fontsize=9, color=DARK)
    axes.set(xlim=(0, 15), ylim=(0, 0.72))
    return figure


def draw_error(sheet: Sheet) -> Figure:
    """Fig. 3."""
    figure, axes = new_axes("Fig. 3: error of the three systems, 225 nodes", "time [s]", "RMS error over the runs [m]")
    _lines(axes, sheet, LOOKS)
    return figure


def draw_energy(sheet: Sheet) -> Figure:
    """Fig. 4."""
    figure, axes = new_axes(
        "Fig. 4: energy of the three systems, 225 nodes", "time [s]", "mean energy of a period [mJ]"
    )
    looks = {
        "static": ("static-cluster, reports only", LOOKS["static"][1]),
        "ekf": ("EKF, 2 nodes", LOOKS["ekf"][1]),
        "pre_dc": LOOKS["pre_dc"],
    }
    kept = Sheet(sheet.columns[:2] + sheet.columns[3:], [(*row[:2], *row[3:]) for row in sheet.rows])
    _lines(axes, kept, looks)
    return figure


def draw_tracks(results: Results) -> Figure:
    """Fig. 5: four fields."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.5, 7.6), layout="constrained")
    for axes, motion in zip(figure.subplots(2, 2, sharex=True, sharey=True).flat, MOTIONS, strict=True):
        record = results.motion(motion)
        axes.plot(*record.target_m[0].T, color=GREY, linewidth=3.5, label="target")
        axes.plot(*record.estimate_m[0].T, color=EKF, linewidth=1.1, marker=".", markersize=3.5, label="estimate")
        axes.set(title=TRACKS[motion][0], xlim=(0, 100), ylim=(0, 100), aspect="equal")
        axes.label_outer()
        tidy(axes)
    for axes in figure.axes:
        axes.set_xlabel("x [m]" if axes in figure.axes[2:] else "")
        axes.set_ylabel("y [m]" if axes in figure.axes[::2] else "")
    figure.axes[0].legend(frameon=False, loc="upper left")
    figure.suptitle("Fig. 5: Pre-DC on four tracks, the first run of each, 225 nodes")
    return figure


def draw_error_on_tracks(sheet: Sheet) -> Figure:
    """Fig. 6."""
    figure, axes = new_axes(
        "Fig. 6: error of Pre-DC on four tracks, 225 nodes", "time [s]", "RMS error over the runs [m]"
    )
    _lines(axes, sheet, TRACKS)
    return figure


def draw_particles(sheet: Sheet, name: str, number: int) -> Figure:
    """Figs. 7-8, with two standard errors on either side."""
    title = f"Fig. {number}: error of Pre-DC in {name}, 225 nodes (bars: two standard errors)"
    figure, axes = new_axes(title, "number of particles", f"RMS error in {name} [m]")
    count, rms, error, _ = map(np.array, zip(*sheet.rows, strict=True))
    axes.errorbar(count, rms, yerr=2 * error, color=PRE_DC, marker="o", markersize=4, capsize=3, linewidth=1.4)
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter("{x:.0f}")
    axes.set_ylim(bottom=0)
    axes.annotate(f"{rms[-1]:.2f} m", (count[-1], rms[-1]), xytext=(0, 10), textcoords="offset points", ha="center")
    return figure


def _lines(axes: Axes, sheet: Sheet, looks: dict[str, tuple[str, dict[str, Any]]]) -> None:
    """A line for every column but the first."""
    time, *columns = (np.array(column, dtype=float) for column in zip(*sheet.rows, strict=True))
    for values, (label, style) in zip(columns, looks.values(), strict=True):
        axes.plot(time, values, label=label, linewidth=1.5, **style)
    axes.set(xlim=(0, time[-1] + 1), ylim=(0, 1.3 * np.nanmax(columns)))
    axes.legend(frameon=False, ncols=2, loc="upper center")
