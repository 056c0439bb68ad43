"""The pictures of the underwater system."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from wsn_env.envs.rendering.colours import BLUE, GREEN, GREY, PURPLE, SKY, VERMILION, YELLOW
from wsn_env.models.state import PURPOSES
from wsn_env.papers.rollout import Record
from wsn_env.papers.sheet import Sheet, new_axes
from wsn_env.papers.underwater.expected import energy_j
from wsn_env.papers.underwater.systems import HANDOVERS, RESAMPLINGS, THRESHOLDS_DB, Results
from wsn_env.papers.underwater.tables import PURPOSE_WORDS
from wsn_env.reports.pictures import write_picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = dict(zip(PURPOSES, (SKY, GREEN, YELLOW, BLUE, PURPLE, GREY), strict=True))
LINES: dict[str, Any] = dict(zip(RESAMPLINGS.values(), (VERMILION, GREEN, BLUE), strict=True))
STYLES: dict[str, Any] = dict(zip(HANDOVERS, ("-", "--"), strict=True))


def write_figures(out: Path, results: Results, error: Sheet) -> None:
    """Three pictures.

    Args:
        error: the table of the error in each period.
    """
    write_picture(out / "error.png", draw_error(error))
    write_picture(out / "thresholds.png", draw_thresholds(results))
    write_picture(out / "energy.png", draw_energy(results))


def draw_error(sheet: Sheet) -> Figure:
    """How systematic resampling loses the target."""
    figure, axes = new_axes("Smooth motion, 300 particles", "period (5 s)", "mean error over the runs [m]")
    period, *columns = (np.array(column, dtype=float) for column in zip(*sheet.rows, strict=True))
    for name, values in zip(sheet.columns[1:], columns, strict=True):
        resampling, handover = name.split(", ")
        label = f"{resampling}, particles {handover}"
        axes.plot(period, values, STYLES[handover], label=label, linewidth=1.5, color=LINES[resampling])
    axes.set(xlim=(0, period[-1] + 1))
    axes.set_ylim(bottom=0)
    axes.legend(frameon=False)
    return figure


def draw_thresholds(results: Results) -> Figure:
    """Energy against error."""
    figure, axes = new_axes("Threshold of a report, from 80 to 92 dB", "energy [J per period]", "RMSE [m]")
    for silent, label, colour in ((False, "silence ignored", VERMILION), (True, "silence told", BLUE)):
        records = [results.threshold(threshold_db, silent) for threshold_db in THRESHOLDS_DB]
        energy = [record.energy_mj.mean() / 1e3 for record in records]
        rmse, doubt = zip(*map(Record.pooled_rms_m, records), strict=True)
        axes.errorbar(energy, rmse, yerr=doubt, marker="o", markersize=4, capsize=2, color=colour, label=label)
        for x, y, threshold_db in zip(energy, rmse, THRESHOLDS_DB, strict=True):
            if silent:
                axes.annotate(f"{threshold_db:g}", (x, y), xytext=(5, 4), textcoords="offset points")
    axes.legend(frameon=False)
    return figure


def draw_energy(results: Results) -> Figure:
    """Energy of a period by purpose."""
    figure, axes = new_axes("What the energy is for", "threshold [dB]", "energy [J per period]")
    names = [f"{threshold_db:g}" for threshold_db in THRESHOLDS_DB]
    spent = [energy_j(results.threshold(threshold_db, True)) for threshold_db in THRESHOLDS_DB]
    base = np.zeros(len(names))
    for purpose in PURPOSES:
        joules = np.array([energies[purpose] for energies in spent])
        if joules.any():
            axes.bar(names, joules, bottom=base, label=PURPOSE_WORDS[purpose], color=COLOURS[purpose])
        base += joules
    axes.legend(frameon=False)
    return figure
