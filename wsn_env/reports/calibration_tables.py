"""Tables of a calibration: in the terminal and in calibration.md."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import sqrt
from pathlib import Path

import numpy as np

from wsn_env.bluetooth.calibration import Calibration
from wsn_env.bluetooth.packets import HeldOut, held_out_residuals
from wsn_env.evaluation.files import replacing
from wsn_env.models.recordings.calibration_file import SCALARS
from wsn_env.models.recordings.dataset import Track
from wsn_env.reports.calibration_plots import draw_calibration
from wsn_env.reports.pictures import write_picture
from wsn_env.reports.tables import wide_console

CALIBRATION_FILES = ("calibration.md", "calibration.png")
SOURCE = (
    "F. S. Danis, A. T. Naskali, A. T. Cemgil, C. Ersoy: An Indoor Localization Dataset and Data Collection Framework "
    "with High Precision Position Annotation. Pervasive and Mobile Computing 81, 2022"
)


def save_calibration_report(
    tracks: Sequence[Track], whole: Calibration, parts: Sequence[Calibration], out: Path
) -> None:
    """Write calibration.md and calibration.png into a folder.

    Args:
        whole: the calibration by all the tracks.
        parts: those that leave out one track each, or none.
    """
    text = "\n".join(_markdown(tracks, whole, parts))
    with replacing(out / CALIBRATION_FILES[0]) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")
    write_picture(out / CALIBRATION_FILES[1], draw_calibration(tracks, whole), dpi=120)


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
    meanings = {name: meaning for name, (meaning, _) in SCALARS.items()}
    for name, meaning in (meanings | {"at_1m_db": "mean of P0, dBm", "exponents": "mean of n"}).items():
        row = [name, meaning, f"{_mean(whole, name):.4g}"]
        if parts:
            values = np.array([_mean(part, name) for part in parts])
            error = sqrt((len(values) - 1) * values.var())
            row += [f"{error:.2g}", f"{values.min():.4g} to {values.max():.4g}"] if error else ["", ""]
        rows.append(row)
    return header, rows


def _markdown(tracks: Sequence[Track], whole: Calibration, parts: Sequence[Calibration]) -> list[str]:
    """Lines of calibration.md."""
    q, found, fitted = whole.quantities, whole.found, whole.found["autocovariance_fit"]
    held = held_out_residuals(tracks, whole, parts)
    against = "the calibration that left out its track" if parts else "this calibration"
    lines = [
        "# Calibration",
        "",
        f"{found['packets']} packets of {len(tracks)} tracks ({', '.join(whole.tracks)}) at {len(q['exponents'])} "
        f"receivers. For the public tracks of the data set cite: {SOURCE} (CC0).",
        *(line for track in tracks if track.note for line in ("", track.note)),
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
