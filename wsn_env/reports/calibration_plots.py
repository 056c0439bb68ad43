"""The picture of what a calibration was fitted to: levels, autocovariance, white part and losses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from wsn_env.bluetooth.calibration import Calibration
from wsn_env.bluetooth.covariance import Autocovariance, autocovariance, bias_covariance
from wsn_env.bluetooth.fitting import normal_density
from wsn_env.bluetooth.packets import Packets, concatenate_tracks, local_deviation, residuals
from wsn_env.envs.rendering import colours
from wsn_env.models.recordings.dataset import Track

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

LINE, POINTS, SECOND, FAINT, BARS = colours.BLUE, colours.VERMILION, colours.GREEN, colours.GREY, colours.FAINT
COLUMNS = 4  # of the small multiples


def draw_calibration(tracks: Sequence[Track], calibration: Calibration) -> Figure:
    """Figure of what the calibration was fitted to: levels, autocovariance, white part and losses."""
    from matplotlib.figure import Figure

    packets = concatenate_tracks(tracks)
    residual = residuals(packets, calibration)
    names = calibration.found["receivers"]
    rows = -(-len(names) // COLUMNS)
    figure = Figure(figsize=(13, 2.1 * rows + 8.2), layout="constrained")
    upper, lower = figure.subfigures(2, 1, height_ratios=(2.1 * rows + 0.6, 7.6), squeeze=False).flat
    _draw_levels(upper, rows, packets, calibration)
    panels = lower.subplots(2, 2)
    cells = autocovariance(packets, residual)
    _draw_time(panels[0, 0], cells, calibration)
    _draw_space(panels[0, 1], cells, calibration)
    _draw_white(panels[1, 0], local_deviation(packets, residual), calibration)
    _draw_losses(panels[1, 1], calibration)
    for axes in panels.flat:
        axes.grid(alpha=0.3, linewidth=0.5)
        axes.spines[["top", "right"]].set_visible(False)
    return figure


def _draw_levels(figure: SubFigure, rows: int, packets: Packets, calibration: Calibration) -> None:
    """Level against distance, a panel for every receiver."""
    q, names = calibration.quantities, calibration.found["receivers"]
    panels = figure.subplots(rows, COLUMNS, sharex=True, sharey=True, squeeze=False)
    edges = np.geomspace(packets.distance_m.min(), packets.distance_m.max(), 12)
    for axes, name, receiver in zip(panels.flat, names, range(len(names))):
        heard = packets.receiver == receiver
        distance, level = packets.distance_m[heard], packets.level_db[heard]
        axes.plot(distance, level, ".", color=FAINT, markersize=2.5, alpha=0.45, rasterized=True, label="packet")
        bin_of = np.digitize(distance, edges[1:-1])
        count = np.bincount(bin_of, minlength=11)
        kept = count > 10
        means = (np.bincount(bin_of, values, 11)[kept] / count[kept] for values in (distance, level))
        axes.plot(*means, "o", color=POINTS, markersize=4.5, label="mean over a range of distances")
        ends = np.array([distance.min(), distance.max()])
        p0, n = q["at_1m_db"][receiver], q["exponents"][receiver]
        axes.plot(ends, p0 - 10 * n * np.log10(ends), color=LINE, linewidth=2, label="fitted line")
        axes.set_title(f"{name}:  $P_0$ = {p0:.1f} dBm,  n = {n:.2f}", fontsize=9)
        axes.grid(alpha=0.3, linewidth=0.5)
        axes.spines[["top", "right"]].set_visible(False)
    for axes in panels.flat[len(names) :]:
        axes.remove()
    axes = panels[0, 0]
    axes.set_xscale("log")
    axes.set_xticks(ticks := [tick for tick in (0.5, 1, 2, 5, 10, 20, 50) if edges[0] < tick < edges[-1]])
    axes.set_xticklabels([f"{tick:g}" for tick in ticks])
    axes.minorticks_off()
    figure.supxlabel("distance [m]", fontsize=10)
    figure.supylabel("level [dBm]", fontsize=10)
    handles, labels = axes.get_legend_handles_labels()
    title = "Level against distance, receiver by receiver"
    style = dict(ncols=3, frameon=False, fontsize=10, title_fontsize=12, markerscale=1.5)
    figure.legend(handles, labels, loc="outside upper center", title=title, **style)


def _draw_time(axes: Axes, cells: Autocovariance, calibration: Calibration) -> None:
    """Autocovariance against the lag in time, over all lags in space."""
    fitted = calibration.found["autocovariance_fit"]
    lag, measured, model = _over(cells, 1, slice(None, -1), fitted)
    axes.plot(lag, measured, "o", color=POINTS, label="measured")
    axes.plot(lag, model, color=LINE, label="fitted, at the lags in space that occur")
    grid = np.geomspace(lag.min(), lag.max(), 100)
    drift = fitted["drift_db2"] * np.exp(-grid / fitted["drift_s"])
    text = f"of it the drift: {fitted['drift_db2']:.1f} dB² over {fitted['drift_s']:.1f} s"
    axes.plot(grid, drift, "--", color=SECOND, label=text)
    axes.axhline(0, color="black", linewidth=0.8)
    axes.set(xscale="log", xlabel="lag in time [s]", ylabel="autocovariance [dB²]")
    axes.set_xticks(ticks := [tick for tick in (0.5, 1, 2, 5, 10, 20) if lag.min() < tick < lag.max()])
    axes.set_xticklabels([f"{tick:g}" for tick in ticks])
    axes.minorticks_off()
    axes.set_title("Residuals of a receiver on one track, by lag in time", fontsize=11)
    axes.legend(frameon=False, fontsize=9)


def _draw_space(axes: Axes, cells: Autocovariance, calibration: Calibration) -> None:
    """Autocovariance against the lag in space, on one track and between tracks."""
    fitted = calibration.found["autocovariance_fit"]
    kinds = (("on one track", slice(None, -1), POINTS, "o"), ("from two tracks", slice(-1, None), LINE, "s"))
    for label, part, colour, marker in kinds:
        lag, measured, model = _over(cells, 0, part, fitted)
        axes.plot(lag, measured, marker, color=colour, label=f"{label}: measured")
        axes.plot(lag, model, color=colour, linewidth=1.2, label=f"{label}: fitted")
    axes.axhline(0, color="black", linewidth=0.8)
    axes.set(xlabel="lag in space [m]", ylabel="autocovariance [dB²]")
    axes.set_title("The same by lag in space, and between tracks", fontsize=11)
    text = f"field: {fitted['field_db2']:.1f} dB² over {fitted['field_m']:.2f} m"
    axes.legend(frameon=False, fontsize=9, title=text, title_fontsize=9)


def _over(
    cells: Autocovariance, axis: int, part: slice, fitted: dict[str, float]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean lag, measured and fitted autocovariance in the cells' rows or columns, weighted by pairs."""
    counts = cells.counts[part]
    pairs = np.where(counts, cells.pairs[part], 0)
    lag_s, lag_m = cells.lag_s[part], cells.lag_m[part]
    total = pairs.sum(axis=axis)
    model = bias_covariance(lag_s, lag_m, **fitted)
    kept = total > 0
    return tuple(
        np.where(counts, values * pairs, 0).sum(axis=axis)[kept] / total[kept]
        for values in (lag_s if axis else lag_m, cells.covariance[part], model)
    )


def _draw_white(axes: Axes, deviation: np.ndarray, calibration: Calibration) -> None:
    """Deviations from the local mean against the mixture, each component widened by the local mean's own error."""
    q = calibration.quantities
    deviation = deviation[np.isfinite(deviation)]
    error = max(deviation.var() - calibration.white_db**2, 0)
    low, high = np.percentile(deviation, [0.05, 99.95])
    edges = np.arange(np.floor(low), np.ceil(high) + 1, 0.5)
    axes.hist(deviation, edges.tolist(), density=True, color=BARS, label="measured")
    grid = np.linspace(low, high, 300)
    main = (1 - q["fade_share"]) * normal_density(grid, q["main_db"], q["main_sd_db"] ** 2 + error)
    fade = q["fade_share"] * normal_density(grid, q["fade_db"], q["fade_sd_db"] ** 2 + error)
    axes.plot(grid, main + fade, color=LINE, linewidth=2, label="fitted mixture")
    axes.plot(grid, main, "--", color=SECOND, label="main component")
    axes.plot(grid, fade, "-.", color=POINTS, label="fading")
    normal = normal_density(grid, 0, calibration.white_db**2 + error)
    axes.plot(grid, normal, ":", color="black", label="one normal distribution")
    axes.set(xlabel="residual minus its local mean [dB]", ylabel="density [1/dB]", ylim=(0, None))
    axes.set_title(f"White part, widened by the {error:.1f} dB² that the local mean errs by", fontsize=11)
    axes.legend(frameon=False, fontsize=9)


def _draw_losses(axes: Axes, calibration: Calibration) -> None:
    """Share of lost packets by receiver with 95 % intervals, over all, and after a loss."""
    q, found = calibration.quantities, calibration.found
    loss = np.array(found["loss_by_receiver"])
    error = 1.96 * np.sqrt(loss * (1 - loss) / found["advertisements"])
    places = np.arange(len(loss))
    axes.bar(places, 100 * loss, color=BARS, edgecolor=FAINT)
    axes.errorbar(places, 100 * loss, 100 * error, fmt="none", ecolor="black", elinewidth=1, capsize=2)
    lines = ("loss", "all packets", LINE, "-"), ("loss_after_loss", "after a loss", POINTS, "--")
    for name, text, colour, style in lines:
        value = 100 * q[name]
        axes.axhline(value, color=colour, linestyle=style, linewidth=1.8, label=f"{text}: {value:.1f} %")
    axes.set_xticks(places, found["receivers"], rotation=35, ha="right", fontsize=8)
    axes.set(ylabel="lost [%]", ylim=(0, 100 * max(q["loss_after_loss"], (loss + error).max()) * 1.3))
    axes.set_title("Lost packets by receiver, with 95 % intervals", fontsize=11)
    axes.legend(frameon=False, fontsize=9, loc="upper right", ncols=2)
