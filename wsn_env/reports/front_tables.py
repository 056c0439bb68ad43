"""Tables of fronts and of their hypervolumes in the terminal, and their files."""

from __future__ import annotations

from math import floor, log10
from pathlib import Path

from wsn_env.evaluation.comparison import Evaluation
from wsn_env.evaluation.front import (
    Fronts,
    Volume,
    find_fronts,
    hypervolumes,
    reference_point,
    save_front,
)
from wsn_env.reports.front_plots import draw_fronts, front_title
from wsn_env.reports.pictures import write_picture
from wsn_env.reports.tables import format_interval, narrow_table, wide_console

FRONT_FILES = ("front.csv", "front.json", "front.png")


def save_and_print_fronts(evaluation: Evaluation, out: Path | None = None) -> None:
    """Write front.csv, front.json and front.png into a folder, if any; print the fronts and their hypervolumes."""
    found = find_fronts(evaluation)
    reference = reference_point(evaluation.scenario)
    volumes = hypervolumes(found, reference)
    if out is not None:
        save_front(evaluation, found, volumes, out)
        write_picture(out / "front.png", draw_fronts(evaluation, found))
    print_front(evaluation, found)
    print_hypervolumes(volumes, reference)


def print_front(evaluation: Evaluation, found: Fronts) -> None:
    """A row for every point."""
    table = narrow_table(front_title(evaluation), ["policy", "lam m/mJ", "mean error m", "energy mJ/step"])
    fine, small = map(_digits, reference_point(evaluation.scenario))
    for points in found.values():
        for point in points:
            lam = "any" if point.lam is None else f"{point.lam:g}"
            figures = format_interval(point.error, fine), format_interval(point.energy, small)
            table.add_row(point.policy, lam, *figures)
        table.add_section()
    console = wide_console()
    console.print(table)
    console.print("means with 95 % bootstrap intervals", style="dim")


def print_hypervolumes(volumes: list[Volume], reference: tuple[float, float]) -> None:
    """A row for every front: its hypervolume, its part of the reference point's box, the paired difference."""
    error, energy = reference
    title = f"Hypervolume up to {error:g} m and {energy:g} mJ"
    table = narrow_table(title, ["front", "m mJ", "of all", f"difference to {volumes[0].front}"])
    digits = _digits(error * energy)
    for volume in volumes:
        difference = "" if volume.difference is None else format_interval(volume.difference, digits, "+")
        share = f"{100 * volume.hypervolume.mean / (error * energy):.1f} %"
        table.add_row(volume.front, format_interval(volume.hypervolume, digits), share, difference)
    wide_console().print(table)


def _digits(scale: float) -> int:
    """Decimals that show a ten-thousandth of what is as large as `scale`, or whole numbers."""
    return max(0, 3 - floor(log10(scale)))
