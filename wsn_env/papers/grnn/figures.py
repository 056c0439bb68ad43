"""The fingerprint system's pictures, each with its CSV."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from wsn_env.envs.rendering.colours import BLACK, BLUE, GREEN, GREY, PURPLE, SKY, VERMILION
from wsn_env.papers.grnn.systems import ANCHORS, EQUAL_INFORMATION, METHODS, PERIODS_S, STARTED, Results
from wsn_env.papers.sheet import Sheet, new_axes, write_sheet
from wsn_env.reports.pictures import write_picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LOOKS: dict[str, dict[str, Any]] = {
    "nonlinear_ls": dict(color=GREY, linestyle=":"),
    "grnn": dict(color=VERMILION, linestyle="--"),
    "grnn_kf": dict(color=GREEN, linestyle="-"),
    "ekf": dict(color=SKY, linestyle="-."),
    "ckf": dict(color=BLUE, linestyle="-."),
    "ickf": dict(color=BLACK, linestyle="-"),
}
TRACKED_S = 0.5


def write_figures(out: Path, results: Results) -> None:
    """Every figure's CSV and PNG."""
    start, path = error_after_start(results), tracks(results)
    write_sheet(out / "fig_start.csv", start)
    write_sheet(out / "fig_track.csv", path)
    write_picture(out / "fig_period.png", draw_periods(results))
    write_picture(out / "fig_start.png", draw_start(start))
    write_picture(out / "fig_track.png", draw_track(path))


def error_after_start(results: Results) -> Sheet:
    """RMS over the runs in each period after a start in the field's middle, 0.5 dB."""
    names, columns = [], []
    for anchors in ANCHORS:
        for method in STARTED:
            names.append(f"{anchors}_{method}_rms_m")
            columns.append(results.start(method, anchors, "field").rms_per_period_m())
    time = TRACKED_S * np.arange(1, len(columns[0]) + 1)
    return Sheet(("time_s", *names), list(zip(time, *columns, strict=True)))


def tracks(results: Results) -> Sheet:
    """The first run's target, fixes and filtered track at T = .5 s."""
    fixes, filtered = results.method("grnn", TRACKED_S), results.method("grnn_kf", TRACKED_S)
    columns = np.hstack([fixes.target_m[0], fixes.estimate_m[0], filtered.estimate_m[0]])
    names = [f"{what}_{axis}_m" for what in ("target", "grnn", "grnn_kf") for axis in "xy"]
    return Sheet(("period", *names), [(k + 1, *row) for k, row in enumerate(columns)])


def draw_periods(results: Results) -> Figure:
    """Error against sampling period, as sampled and at an equal information rate (rmse.csv, equal_information.csv)."""
    figure, axes = new_axes("Error against sampling period, ring8, 3 dB", "sampling period T [s]", "RMSE [m]")
    for method in ("nonlinear_ls", "grnn", "ckf", "ickf", "grnn_kf"):
        rms = [results.method(method, t).pooled_rms_m()[0] for t in PERIODS_S]
        axes.plot(PERIODS_S, rms, marker="o", markersize=4, label=METHODS[method], **LOOKS[method])
    for method in EQUAL_INFORMATION[::2]:
        rms = [results.equal_information(method, t).pooled_rms_m()[0] for t in PERIODS_S]
        look = LOOKS[method] | dict(linestyle=(0, (1, 2)))
        axes.plot(PERIODS_S, rms, marker="s", markersize=3, label=f"{METHODS[method]}, √(1 s / T) dB", **look)
    axes.axhline(results.bound_m["ring8"], color=PURPLE, linewidth=1, label="Cramér-Rao bound, one period")
    axes.set_xscale("log")
    axes.set_xticks(PERIODS_S, [f"{t:g}" for t in PERIODS_S])
    axes.minorticks_off()
    axes.set_ylim(0, 26)
    axes.legend(frameon=False, ncols=3, loc="upper center", fontsize=8)
    return figure


def draw_start(sheet: Sheet) -> Figure:
    """After a poor start."""
    title = "A start in the middle of the field, 0.5 dB"
    figure, axes = new_axes(title, "time [s]", "RMS error over the runs [m]")
    time, *columns = (np.array(column) for column in zip(*sheet.rows, strict=True))
    for name, values in zip(sheet.columns[1:], columns, strict=True):
        anchors, method = name.split("_")[:2]
        look = LOOKS[method] | dict(linestyle="-" if anchors == "ring8" else "--")
        axes.plot(time, values, label=f"{METHODS[method]}, {anchors}", **look)
    axes.set_yscale("log")
    axes.set_yticks((1, 2, 5, 10, 20, 50), ["1", "2", "5", "10", "20", "50"])
    axes.minorticks_off()
    axes.legend(frameon=False, ncols=2)
    return figure


def draw_track(sheet: Sheet) -> Figure:
    """One run in the field."""
    figure, axes = new_axes("GRNN fixes and their Kalman filter, T = 0.5 s, one run", "x [m]", "y [m]")
    figure.set_size_inches(5.6, 5.6)
    _, *columns = (np.array(column) for column in zip(*sheet.rows, strict=True))
    axes.plot(*columns[:2], color=GREY, linewidth=3, label="target")
    axes.plot(*columns[2:4], ".", color=VERMILION, markersize=4, label=METHODS["grnn"])
    axes.plot(*columns[4:], color=GREEN, linewidth=1.3, label=METHODS["grnn_kf"])
    axes.plot(*zip(*ANCHORS["ring8"]), "k^", markersize=7, label="anchors", clip_on=False)
    axes.set(xlim=(0, 200), ylim=(0, 200), aspect="equal")
    axes.legend(frameon=False, ncols=2, loc="lower right")
    return figure
