"""A calibration for people: tables, the picture of what it was fitted to, and the command that makes all of it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import sqrt
from pathlib import Path

import numpy as np

from wsn_env.bluetooth.calibration import (
    NUMBERS,
    Autocovariance,
    Calibration,
    CalibrationError,
    Packets,
    autocovariance,
    bias_covariance,
    calibrate,
    gather,
    leave_one_out,
    normal_density,
    residuals,
)
from wsn_env.bluetooth.residual_map import residual_map, save_map
from wsn_env.envs.rendering import colours
from wsn_env.evaluation.files import replacing
from wsn_env.models.quantity import suggest
from wsn_env.models.recordings.dataset import Track, read_dataset
from wsn_env.reports.pictures import write_picture
from wsn_env.reports.tables import wide_console

REPORT_FILES = ("calibration.md", "calibration.png")
SOURCE = (
    "F. S. Danis, A. T. Naskali, A. T. Cemgil, C. Ersoy: An Indoor Localization Dataset and Data Collection Framework "
    "with High Precision Position Annotation. Pervasive and Mobile Computing 81, 2022"
)

LINE, POINTS, SECOND, FAINT, BARS = colours.BLUE, colours.VERMILION, colours.GREEN, colours.GREY, colours.FAINT
COLUMNS = 4  # of the small multiples
LOCAL_S = 1.5  # packets this far apart count 1/e in a local mean


def run_calibrate(folder: Path, out: Path, leave_out: str | None = None, maps: bool = False) -> None:
    """Calibrate recorded tracks; write calibration.json, without_TRACK.json for every track, and the report.

    Args:
        folder: of the data set.
        out: folder to write into; it is made if need be.
        leave_out: name of a track: of the calibrations that leave out one, write only the one without it.
        maps: write the residual map of each calibration, too, as .npz beside it.
    """
    tracks = read_dataset(folder)
    names = [track.name for track in tracks]
    if leave_out is not None and leave_out not in names:
        raise CalibrationError(f"leave_out = {leave_out!r}: no such track; {suggest(leave_out, names)}")
    whole = calibrate(tracks)
    parts = leave_one_out(tracks) if len(tracks) > 1 or leave_out is not None else []
    out.mkdir(parents=True, exist_ok=True)
    written = []
    for calibration in [whole, *(part for part in parts if leave_out in (None, part.left_out))]:
        stem = "calibration" if calibration.left_out is None else f"without_{calibration.left_out}"
        calibration.save(out / f"{stem}.json")
        written.append(f"{stem}.json")
        if maps:
            save_map(residual_map(tracks, calibration), out / f"{stem}.npz")
            written.append(f"{stem}.npz")
    report_calibration(tracks, whole, parts, out)
    print_calibration(whole, parts)
    wide_console().print(f"{out}: {', '.join([*written, *REPORT_FILES])}", markup=False, highlight=False)


def report_calibration(tracks: Sequence[Track], whole: Calibration, parts: Sequence[Calibration], out: Path) -> None:
    """Write calibration.md and calibration.png into a folder.

    Args:
        whole: the calibration by all the tracks.
        parts: those that leave out one track each, or none.
    """
    text = "\n".join(_markdown(tracks, whole, parts))
    with replacing(out / REPORT_FILES[0]) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")
    write_picture(out / REPORT_FILES[1], draw_calibration(tracks, whole), dpi=120)


def print_calibration(whole: Calibration, parts: Sequence[Calibration]) -> None:
    """A row for every quantity."""
    from rich.table import Table

    table = Table(title=f"Calibration by {len(whole.tracks)} tracks, {whole.found['packets']} packets")
    header, rows = quantity_rows(whole, parts)
    for column in header:
        table.add_column(column, justify="left" if column in ("quantity", "meaning") else "right")
    for row in rows:
        table.add_row(*row)
    wide_console().print(table)


def quantity_rows(whole: Calibration, parts: Sequence[Calibration]) -> tuple[list[str], list[list[str]]]:
    """The calibration's numbers with jackknife standard errors over the tracks; lists as their mean."""
    header = ["quantity", "meaning", "value", *(["standard error", "leaving out a track"] if parts else [])]
    rows = []
    meanings = {name: meaning for name, (meaning, _) in NUMBERS.items()}
    for name, meaning in (meanings | {"at_1m_db": "mean of P0, dBm", "exponents": "mean of n"}).items():
        row = [name, meaning, f"{_mean(whole, name):.4g}"]
        if parts:
            values = np.array([_mean(part, name) for part in parts])
            error = sqrt((len(values) - 1) * values.var())
            row += [f"{error:.2g}", f"{values.min():.4g} to {values.max():.4g}"] if error else ["", ""]
        rows.append(row)
    return header, rows


@dataclass(frozen=True)
class HeldOut:
    """Residuals against the calibration that did not see the track, or against the whole one if there is none.

    Args:
        packets: of all tracks.
        residual_db: (N,).
    """

    packets: Packets
    residual_db: np.ndarray


def hold_out(tracks: Sequence[Track], whole: Calibration, parts: Iterable[Calibration]) -> HeldOut:
    """Residuals of every track against the calibration without it."""
    packets = gather(tracks)
    residual = residuals(packets, whole)
    for part in parts:
        chosen = packets.track == [track.name for track in tracks].index(part.left_out)
        residual[chosen] = residuals(packets, part)[chosen]
    return HeldOut(packets, residual)


def local_deviation(packets: Packets, residual: np.ndarray) -> np.ndarray:
    """Residuals minus the mean of their receiver's others near in time, weights exp(-lag / 1.5 s).

    Returns: (N,) dB; NaN where a receiver has no other packet on the track.
    """
    deviation = np.full(len(residual), np.nan)
    for receiver in range(packets.receiver.max() + 1):
        for track in range(packets.track.max() + 1):
            own = np.flatnonzero((packets.receiver == receiver) & (packets.track == track))
            if len(own) < 2:
                continue
            weight = np.exp(-np.abs(packets.time_s[own, None] - packets.time_s[own]) / LOCAL_S)
            np.fill_diagonal(weight, 0)
            total = weight.sum(axis=1)
            mean = np.divide(weight @ residual[own], total, out=np.full(len(own), np.nan), where=total > 0)
            deviation[own] = residual[own] - mean
    return deviation


def draw_calibration(tracks: Sequence[Track], calibration: Calibration):
    """Figure of what the calibration was fitted to: levels, autocovariance, white part and losses."""
    from matplotlib.figure import Figure

    packets = gather(tracks)
    residual = residuals(packets, calibration)
    names = calibration.found["receivers"]
    rows = -(-len(names) // COLUMNS)
    figure = Figure(figsize=(13, 2.1 * rows + 8.2), layout="constrained")
    upper, lower = figure.subfigures(2, 1, height_ratios=(2.1 * rows + 0.6, 7.6))
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


def _draw_levels(figure, rows: int, packets: Packets, calibration: Calibration) -> None:
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


def _draw_time(axes, cells: Autocovariance, calibration: Calibration) -> None:
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


def _draw_space(axes, cells: Autocovariance, calibration: Calibration) -> None:
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


def _over(cells: Autocovariance, axis: int, part: slice, fitted: dict) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
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


def _draw_white(axes, deviation: np.ndarray, calibration: Calibration) -> None:
    """Deviations from the local mean against the mixture, each component widened by the local mean's own error."""
    q = calibration.quantities
    deviation = deviation[np.isfinite(deviation)]
    error = max(deviation.var() - calibration.white_db**2, 0)
    low, high = np.percentile(deviation, [0.05, 99.95])
    edges = np.arange(np.floor(low), np.ceil(high) + 1, 0.5)
    axes.hist(deviation, edges, density=True, color=BARS, label="measured")
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


def _draw_losses(axes, calibration: Calibration) -> None:
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


def _markdown(tracks: Sequence[Track], whole: Calibration, parts: Sequence[Calibration]) -> list[str]:
    """Lines of calibration.md."""
    q, found, fitted = whole.quantities, whole.found, whole.found["autocovariance_fit"]
    held = hold_out(tracks, whole, parts)
    against = "the calibration that left out its track" if parts else "this calibration"
    lines = [
        "# Calibration",
        "",
        f"{found['packets']} packets of {len(tracks)} tracks ({', '.join(whole.tracks)}) at {len(q['exponents'])} "
        f"receivers. For the public tracks of the data set cite: {SOURCE} (CC0).",
        "",
        "    level = P0 - 10 n log10(distance) + field(position) + drift(time) + white",
        "",
        "![What the calibration was fitted to](calibration.png)",
        "",
        "## Quantities",
        "",
        *_table(*quantity_rows(whole, parts)),
    ]
    if parts:
        lines += ["", "Standard errors: jackknife over the tracks, which are few; take them as a rough guide."]
    lines += ["", "## Receivers", "", f"Residuals: against {against}.", "", *_table(*_receiver_rows(whole, held))]
    lines += ["", "## Tracks", "", *_table(*_track_rows(tracks, whole, held))]
    bias, white = whole.bias_db**2, whole.white_db**2
    sums = fitted["field_db2"] + fitted["drift_db2"]
    plain = found["mixture_of_residuals"]
    noise = [
        ("residuals", f"{found['residual_db'] ** 2:.2f}", f"sd {found['residual_db']:.2f} dB"),
        ("bias: 1.2 times the autocovariance at .3 to 2 s", f"{bias:.2f}", f"sd {sqrt(bias):.2f} dB"),
        ("- field", f"{q['field_db'] ** 2:.2f}", f"over {q['field_m']:.2f} m"),
        ("- drift", f"{q['drift_db'] ** 2:.2f}", f"over {q['drift_s']:.1f} s"),
        ("white: the rest", f"{white:.2f}", f"sd {sqrt(white):.2f} dB"),
        ("- main", f"{q['main_sd_db'] ** 2:.2f}", f"{1 - q['fade_share']:.0%} about {q['main_db']:+.2f} dB"),
        ("- fading", f"{q['fade_sd_db'] ** 2:.2f}", f"{q['fade_share']:.0%} about {q['fade_db']:+.2f} dB"),
    ]
    lines += [
        "",
        "## Noise",
        "",
        *_table(["part", "variance dB²", ""], noise),
        "",
        f"Autocovariance: {found['autocovariance_short_db2']:.2f} dB² at .3 to 2 s, "
        f"{found['autocovariance_long_db2']:.2f} dB² at 4.5 to 5.5 s. Fitted over lags in time and in space, field and "
        f"drift are {fitted['field_db2']:.2f} and {fitted['drift_db2']:.2f} dB², in sum {sums:.2f}; above they are "
        f"scaled to {bias:.2f}, which the tracker assumes. The residuals' skewness is {found['skewness']:.2f}. A "
        "mixture fitted to the residuals as if all of them were white, and scaled to the white variance, has a main "
        f"component of {plain['main_db']:+.2f} dB (sd {plain['main_sd_db']:.2f}) and fading of {plain['fade_db']:+.2f} "
        f"dB (sd {plain['fade_sd_db']:.2f}): less skewed, for field and drift are not.",
        "",
        "## Losses",
        "",
        f"{found['advertisements']} advertisements every {q['interval_s']:.4f} s; {100 * q['loss']:.1f} % of their "
        f"packets are lost, {100 * q['loss_after_loss']:.1f} % after a loss. {found['packets_again']} packets came a "
        f"second time, {found['advertisements_unheard']} advertisements were heard by too few receivers to count.",
    ]
    return lines


def _receiver_rows(whole: Calibration, held: HeldOut) -> tuple[list[str], list[list[str]]]:
    header = ["receiver", "x m", "y m", "height m", "P0 dBm", "n", "packets", "residual mean dB", "sd dB", "lost"]
    q, found, rows = whole.quantities, whole.found, []
    for i, name in enumerate(found["receivers"]):
        own = held.residual_db[held.packets.receiver == i]
        figures = (*q["positions"][i], q["heights_m"][i], q["at_1m_db"][i], q["exponents"][i])
        rows.append([name, *(f"{figure:.2f}" for figure in figures), str(len(own))])
        rows[-1] += [f"{own.mean():+.2f}", f"{own.std():.2f}", f"{100 * found['loss_by_receiver'][i]:.1f} %"]
    return header, rows


def _track_rows(tracks: Sequence[Track], whole: Calibration, held: HeldOut) -> tuple[list[str], list[list[str]]]:
    header, rows = ["track", "seconds", "packets", "residual mean dB", "sd dB", "lost"], []
    for i, track in enumerate(tracks):
        own = held.residual_db[held.packets.track == i]
        figures = f"{np.ptp(track.time_s):.0f}", str(len(own)), f"{own.mean():+.2f}", f"{own.std():.2f}"
        rows.append([track.name, *figures, f"{100 * whole.found['loss_by_track'][i]:.1f} %"])
    return header, rows


def _table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Lines of a Markdown table; the first column reads from the left, numbers from the right."""
    marks = [":--" if i == 0 or name in ("meaning", "") else "--:" for i, name in enumerate(header)]
    return [f"| {' | '.join(cells)} |" for cells in (header, marks, *rows)]


def _mean(calibration: Calibration, name: str) -> float:
    return float(np.mean(calibration.quantities[name]))
