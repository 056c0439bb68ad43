"""The tables and pictures of the underwater system."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from wsn_env.envs.rendering.colours import BLUE, GREEN, GREY, PURPLE, SKY, VERMILION, YELLOW
from wsn_env.models.acoustics import absorption_db_per_km, ambient_noise_db
from wsn_env.models.state import PURPOSES
from wsn_env.papers.rollout import Record
from wsn_env.papers.sheet import Sheet, by_period, new_axes, write_sheet
from wsn_env.papers.underwater.claims import energy_j
from wsn_env.papers.underwater.systems import (
    HANDOVERS,
    HYSTERESES_DB,
    PARTICLES,
    RESAMPLING_NOISES,
    RESAMPLINGS,
    SMOOTH,
    THRESHOLDS_DB,
    Results,
    lost,
)
from wsn_env.reports.pictures import write_picture
from wsn_env.scenario import Scenario

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = dict(zip(PURPOSES, (SKY, GREEN, YELLOW, BLUE, PURPLE, GREY), strict=True))
LOOKS: dict[str, dict[str, Any]] = {
    "systematic": dict(color=VERMILION),
    "spread": dict(color=BLUE),
    "carried": dict(linestyle="-"),
    "redrawn": dict(linestyle="--"),
}
FREQUENCIES_KHZ = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)


def write_figures(out: Path, results: Results) -> None:
    """Every table as CSV, and three pictures."""
    sheets = {
        "acoustics": acoustics(),
        "resampling": resampling(results),
        "error": error_per_period(results),
        "thresholds": thresholds(results),
        "hysteresis": hysteresis(results),
    }
    for name, sheet in sheets.items():
        write_sheet(out / f"{name}.csv", sheet)
    write_picture(out / "error.png", draw_error(sheets["error"]))
    write_picture(out / "thresholds.png", draw_thresholds(results))
    write_picture(out / "energy.png", draw_energy(results))


def acoustics() -> Sheet:
    """Absorption (Thorp) and ambient noise (Wenz) against frequency."""
    rows = [(f, absorption_db_per_km(f), ambient_noise_db(f)) for f in FREQUENCIES_KHZ]
    return Sheet(("frequency_khz", "absorption_db_per_km", "noise_db"), rows)


def resampling(results: Results) -> Sheet:
    """Every cell of the resampling table."""
    rows = []
    for noise in RESAMPLING_NOISES:
        for particles in PARTICLES:
            for handover in HANDOVERS:
                for name in RESAMPLINGS:
                    cell = noise, particles, handover, name
                    record = results.resampling(*cell)
                    rows.append((*cell, *record.pooled_rms_m(), lost(record).mean(), results.runs))
    columns = ("noise_m2s3", "particles", "handover", "resampling", "rmse_m", "stderr_m", "lost", "runs")
    return Sheet(columns, rows)


def error_per_period(results: Results) -> Sheet:
    """Mean error over the runs in each period: smooth motion, 300 particles."""
    cells = [(name, handover) for name in RESAMPLINGS for handover in HANDOVERS]
    errors = [
        np.sqrt(results.resampling(SMOOTH, 300, handover, name).square_error()).mean(axis=0) for name, handover in cells
    ]
    return by_period([f"{name}_{handover}_m" for name, handover in cells], errors)


def thresholds(results: Results) -> Sheet:
    """Error, reports and energy by purpose against the threshold, with and without what silence tells."""
    rows = []
    for threshold_db in THRESHOLDS_DB:
        radius_m = Scenario.named("Underwater-v0", threshold_db=threshold_db).radius_m
        for silent in (False, True):
            record = results.threshold(threshold_db, silent)
            rows.append((threshold_db, radius_m, silent, *record.pooled_rms_m(), *_costs(record)))
    return Sheet(("threshold_db", "radius_m", "silence_told", "rmse_m", "stderr_m", *COSTS), rows)


def hysteresis(results: Results) -> Sheet:
    """Error, handovers and energy by purpose against the head's hysteresis."""
    rows = []
    for hysteresis_db in HYSTERESES_DB:
        record = results.hysteresis(hysteresis_db)
        rows.append((hysteresis_db, *record.pooled_rms_m(), record.handover.mean(), *_costs(record)))
    return Sheet(("hysteresis_db", "rmse_m", "stderr_m", "handovers", *COSTS), rows)


COSTS = ("reports", "energy_j", *(f"{purpose}_j" for purpose in PURPOSES))


def _costs(record: Record) -> tuple[float, ...]:
    return record.delivered.mean(), record.energy_mj.mean() / 1e3, *energy_j(record).values()


def draw_error(sheet: Sheet) -> Figure:
    """How systematic resampling loses the target."""
    figure, axes = new_axes("Smooth motion, 300 particles", "period (5 s)", "mean error over the runs [m]")
    period, *columns = (np.array(column, dtype=float) for column in zip(*sheet.rows, strict=True))
    for name, values in zip(sheet.columns[1:], columns, strict=True):
        resampling, handover, _ = name.split("_")
        label = f"{resampling}, particles {handover}"
        axes.plot(period, values, label=label, linewidth=1.5, **LOOKS[resampling], **LOOKS[handover])
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
            label = "listening, sleeping" if purpose == "sensing" else purpose
            axes.bar(names, joules, bottom=base, label=label, color=COLOURS[purpose])
        base += joules
    axes.legend(frameon=False)
    return figure
