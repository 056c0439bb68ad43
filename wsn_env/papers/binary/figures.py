"""What the experiments of Zhou, Cheng & Xing (2009) show, as CSV and as pictures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from wsn_env.envs.rendering.colours import BLACK, BLUE, GREEN, GREY, PURPLE, VERMILION
from wsn_env.papers.binary.claims import Study
from wsn_env.papers.binary.readings import boundary_nodes, detecting_nodes
from wsn_env.papers.binary.systems import FAULTS, NODES, PERIODS_S, RADII_M, SWEPT, SYSTEMS, Results, Setting
from wsn_env.papers.sheet import Sheet, by_period, new_axes, write_sheet
from wsn_env.reports.pictures import write_picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LOOKS: dict[str, tuple[str, dict[str, Any]]] = {
    "centroid": ("centroid", dict(color=VERMILION, linestyle="--")),
    "raw": ("fix, v given", dict(color=GREY, linestyle=":")),
    "paper": ("paper's filter", dict(color=BLACK, linestyle="-")),
    "mid": ("mid-period fix", dict(color=BLUE, linestyle="-.")),
    "ekf": ("EKF of ranges", dict(color=GREEN, linestyle="-")),
    "particle": ("particle filter", dict(color=PURPLE, linestyle="--")),
}
SWEEPS: dict[str, tuple[str, tuple[float, ...], str]] = {  # file: field of a setting, its values, label
    "nodes": ("nodes", NODES, "number of nodes N"),
    "radius": ("radius_m", RADII_M, "sensing radius R [m]"),
    "period": ("period_s", PERIODS_S, "sampling period T [s]"),
}


def write_figures(out: Path, study: Study) -> None:
    """Every table and picture."""
    results = study.results
    write_sheet(out / "systems.csv", systems(results))
    write_sheet(out / "readings.csv", readings(study))
    write_sheet(out / "faults.csv", faults(results))
    over_time = error_over_time(results)
    write_sheet(out / "error.csv", over_time)
    write_picture(out / "error.png", draw_error(over_time))
    for name in SWEEPS:
        sheet = sweep(results, name)
        write_sheet(out / f"{name}.csv", sheet)
        write_picture(out / f"{name}.png", draw_sweep(sheet, name))


# --- tables -------------------------------------------------------------------------------------------------


def systems(results: Results) -> Sheet:
    """Every system at the defaults."""
    columns = ("system", "mean_m", "median_m", "rms_m", "reporting", "energy_mj")
    return Sheet(columns, [(name, *_summary(results, Setting(name))) for name in SYSTEMS])


def readings(study: Study) -> Sheet:
    """The readings tried: RMS and bias along the track of fixes with the true velocity."""
    rows = [
        *((name, study.rms_m(name)[0], study.bias_m(name)[0]) for name in study.offsets),
        ("eqs. 12-13 as printed", study.printed_rms_m(), None),
    ]
    return Sheet(("reading", "rms_m", "bias_m"), rows)


def faults(results: Results) -> Sheet:
    """Misread states with and without a gate, lost reports with and without a refresh."""
    columns = ("system", "flip", "gate_m", "packet_success", "refresh")
    rows = [(s.system, s.flip, s.gate_m, s.success, s.refresh, *_summary(results, s)) for s in FAULTS]
    return Sheet((*columns, "mean_m", "median_m", "rms_m", "reporting", "energy_mj"), rows)


def error_over_time(results: Results) -> Sheet:
    """Mean error over the runs at each second; no entry before a system starts."""
    columns = []
    for name in LOOKS:
        setting = Setting(name)
        error = np.sqrt(results.records[setting].square_error()).mean(axis=0)
        columns.append(np.concatenate([np.full(round(setting.begin_s), np.nan), error]))
    return by_period([f"{name}_m" for name in LOOKS], columns, "time_s")


def sweep(results: Results, name: str) -> Sheet:
    """Mean and RMS error of the systems and how many nodes report, measured and in closed form, over a quantity."""
    field, values, _ = SWEEPS[name]
    rows = []
    for value in values:
        changes: dict[str, Any] = {field: value}
        settings = [Setting(system, **changes) for system in SWEPT]
        errors = [results.error_m(setting) for setting in settings]
        reporting = [results.reporting(Setting(system, **changes)).mean() for system in ("paper", "centroid")]
        law = boundary_nodes(**changes), detecting_nodes(**{k: v for k, v in changes.items() if k != "period_s"})
        means = [error.mean() for error in errors]
        rows.append((value, *means, *(np.sqrt((error**2).mean()) for error in errors), *reporting, *law))
    columns = [f"{system}_{what}_m" for what in ("mean", "rms") for system in SWEPT]
    counts = ("boundary_nodes", "detecting_nodes", "boundary_nodes_law", "detecting_nodes_law")
    return Sheet((field, *columns, *counts), rows)


def _summary(results: Results, setting: Setting) -> tuple[float, ...]:
    error = results.error_m(setting)
    reporting, energy = results.reporting(setting).mean(), results.energy_mj(setting).mean()
    return error.mean(), np.median(error), results.rms_m(setting), reporting, energy


# --- pictures -----------------------------------------------------------------------------------------------


def draw_error(sheet: Sheet) -> Figure:
    """Error over time."""
    figure, axes = new_axes("Error over time: N = 600, R = 60 m, T = 1 s", "time [s]", "mean error over the runs [m]")
    time, *columns = (np.array(column, dtype=float) for column in zip(*sheet.rows, strict=True))
    for values, (label, style) in zip(columns, LOOKS.values(), strict=True):
        axes.plot(time, values, label=label, linewidth=1.5, **style)
    axes.set(xlim=(0, time[-1]), ylim=(0, 20))
    axes.legend(frameon=False, ncols=3, loc="upper right")
    return figure


def draw_sweep(sheet: Sheet, name: str) -> Figure:
    """RMS (over periods) or mean error (over nodes and radii) of the systems; the paper's fixes are heavy-tailed."""
    what = "rms" if name == "period" else "mean"
    _, values, label = SWEEPS[name]
    figure, axes = new_axes(f"{what.upper() if what == 'rms' else 'Mean'} error over the {label}", label, "error [m]")
    for system in SWEPT:
        column = sheet.columns.index(f"{system}_{what}_m")
        text, style = LOOKS[system]
        axes.plot(values, [row[column] for row in sheet.rows], label=text, marker="o", markersize=3.5, **style)
    axes.set_ylim(bottom=0)
    axes.legend(frameon=False, ncols=3, loc="upper center")
    low, high = axes.get_ylim()
    axes.set_ylim(low, 1.2 * high)
    return figure
