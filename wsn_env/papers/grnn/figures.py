"""The fingerprint system's pictures, each with its CSV."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from wsn_env.envs.rendering.colours import BLACK, BLUE, GREEN, GREY, PURPLE, SKY, VERMILION
from wsn_env.filters.linear import LinearModel
from wsn_env.papers.grnn.comparison import FIRST, PAIRS, PARTICLE, SMOOTHED
from wsn_env.papers.grnn.strengths import Heard, filter_walk, likely_walk, smooth_walk
from wsn_env.papers.grnn.systems import (
    ANCHORS,
    COMPARED_S,
    EQUAL_INFORMATION,
    METHODS,
    PERIODS_S,
    STARTED,
    Results,
    scenario_as_read,
)
from wsn_env.papers.sheet import Sheet, new_axes, tidy, write_sheet
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
DISTRIBUTED: dict[str, dict[str, Any]] = {  # methods whose distribution is drawn
    FIRST: dict(color=GREY),
    PAIRS: dict(color=GREY, linestyle="--"),
    METHODS["nonlinear_ls"]: dict(color=GREY, linestyle=":"),
    METHODS["grnn"]: LOOKS["grnn"],
    SMOOTHED: dict(color=PURPLE),
    METHODS["grnn_kf"]: LOOKS["grnn_kf"],
    METHODS["ickf"]: LOOKS["ickf"],
    PARTICLE: dict(color=SKY, linestyle=":"),
}
TRACKED_S = COMPARED_S
ANCHOR = 1  # the strength that is drawn: that at the middle of the lower edge


def write_figures(out: Path, results: Results, heard: Heard, compared: dict[str, np.ndarray]) -> None:
    """Every figure's CSV and PNG.

    Args:
        heard: the strengths at T = .5 s.
        compared: method: (R, K) error in every period there [m].
    """
    start, path, levels, shares = error_after_start(results), tracks(results), strengths(heard), distribution(compared)
    write_sheet(out / "fig_start.csv", start)
    write_sheet(out / "fig_track.csv", path)
    write_sheet(out / "fig_strength.csv", levels)
    write_sheet(out / "fig_distribution.csv", shares)
    write_picture(out / "fig_period.png", draw_periods(results))
    write_picture(out / "fig_start.png", draw_start(start))
    write_picture(out / "fig_track.png", draw_track(path))
    write_picture(out / "fig_strength.png", draw_strength(levels))
    write_picture(out / "fig_distribution.png", draw_distribution(shares))


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


def strengths(heard: Heard) -> Sheet:
    """The strength at one anchor in the first run: without noise, as heard, filtered, smoothed."""
    step = likely_walk(heard) * heard.period_s**0.5
    filtered, variance, _ = filter_walk(heard.strengths, step)
    smoothed = smooth_walk(filtered, variance, step)
    anchor = np.asarray(ANCHORS["ring8"])[[ANCHOR]]
    true = LinearModel(scenario_as_read("grnn")).expected(heard.target_m[0], anchor)[:, 0]
    time = heard.period_s * np.arange(1, len(true) + 1)
    columns = (true, *(values[0, :, ANCHOR] for values in (heard.strengths, filtered, smoothed)))
    return Sheet(("time_s", "true_dbm", "heard_dbm", "filtered_dbm", "smoothed_dbm"), list(zip(time, *columns)))


def distribution(compared: dict[str, np.ndarray]) -> Sheet:
    """What error a share of all periods of all runs does not exceed, a column a method."""
    shares = np.linspace(0, 1, 101)
    columns = [np.quantile(error, shares) for error in compared.values()]
    return Sheet(("share", *(f"{name} [m]" for name in compared)), list(zip(shares, *columns, strict=True)))


def draw_periods(results: Results) -> Figure:
    """RMSE and mean error against sampling period (errors.csv), RMSE also at an equal information rate."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 4.2), layout="constrained")
    first, second = figure.subplots(1, 2, sharey=True)
    for method in ("nonlinear_ls", "grnn", "ckf", "ickf", "grnn_kf"):
        records = [results.method(method, t) for t in PERIODS_S]
        mean = [np.sqrt(record.square_error()).mean() for record in records]
        for axes, figures in ((first, [record.pooled_rms_m()[0] for record in records]), (second, mean)):
            axes.plot(PERIODS_S, figures, marker="o", markersize=4, label=METHODS[method], **LOOKS[method])
    for method in EQUAL_INFORMATION[::2]:
        rms = [results.equal_information(method, t).pooled_rms_m()[0] for t in PERIODS_S]
        look = LOOKS[method] | dict(linestyle=(0, (1, 2)))
        first.plot(PERIODS_S, rms, marker="s", markersize=3, label=f"{METHODS[method]}, √(1 s / T) dB", **look)
    first.axhline(results.bound_m["ring8"], color=PURPLE, linewidth=1, label="Cramér-Rao bound, one period")
    first.set(title="Root mean square error, ring8, 3 dB", ylabel="error [m]", ylim=(0, 28))
    second.set(title="Mean error")
    for axes in (first, second):
        axes.set(xscale="log", xlabel="sampling period T [s]")
        axes.set_xticks(PERIODS_S, [f"{t:g}" for t in PERIODS_S])
        axes.minorticks_off()
        tidy(axes)
    first.legend(frameon=False, ncols=2, loc="upper center", fontsize=8)
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


def draw_strength(sheet: Sheet) -> Figure:
    """One anchor's strength."""
    figure, axes = new_axes("Strength at one anchor, T = 0.5 s, one run", "time [s]", "strength [dBm]")
    time, true, heard, filtered, smoothed = (np.array(column) for column in zip(*sheet.rows, strict=True))
    axes.plot(time, heard, ".", color=VERMILION, markersize=4, label="heard")
    axes.plot(time, true, color=GREY, linewidth=3, label="without noise")
    axes.plot(time, filtered, color=GREEN, label="Kalman filter")
    axes.plot(time, smoothed, color=BLUE, linestyle="--", label="smoother (looks ahead)")
    axes.legend(frameon=False, ncols=2)
    return figure


def draw_distribution(sheet: Sheet) -> Figure:
    """Cumulative distribution of the error."""
    figure, axes = new_axes("Error at T = 0.5 s, all periods of all runs", "error [m]", "share of periods")
    shares, *columns = (np.array(column) for column in zip(*sheet.rows, strict=True))
    errors = dict(zip(sheet.columns[1:], columns, strict=True))
    for name, look in DISTRIBUTED.items():
        axes.plot(errors[f"{name} [m]"], shares, label=name, **look)
    axes.set(xlim=(0, 60), ylim=(0, 1))
    axes.legend(frameon=False, loc="lower right", fontsize=8)
    return figure
