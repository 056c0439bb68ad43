"""Tables of a comparison on recorded tracks: in the terminal, in Markdown, and its files."""

from __future__ import annotations

from pathlib import Path

from wsn_env.bluetooth.recorded_evaluation import RecordedEvaluation
from wsn_env.evaluation.comparison import stem_of
from wsn_env.evaluation.files import replacing
from wsn_env.reports.markdown import escape_markdown, markdown_table
from wsn_env.reports.pictures import can_draw, write_picture
from wsn_env.reports.recorded_plots import draw_recorded
from wsn_env.reports.tables import narrow_table, wide_console

REFERENCE = "all"


def recorded_rows(evaluation: RecordedEvaluation, lam: float) -> tuple[list[str], list[list[str]]]:
    """Header and rows: the mean RMS over the tracks, its ratio to that of all receivers, consistency, energy, and each
    track's RMS."""
    first = evaluation.first
    reference = evaluation.mean(REFERENCE, lam, "rms_m") if REFERENCE in first.policies else None
    header = ["policy", "RMS m", "sd over seeds", "/ all", "e²/trace", "energy mJ/step", "listening"]
    rows = []
    for policy in first.policies:
        rms = evaluation.mean(policy, lam, "rms_m")
        rows.append(
            [
                policy,
                f"{rms:.2f}",
                f"{evaluation.spread(policy, lam, 'rms_m'):.2f}",
                "" if reference is None else f"{rms / reference:.2f}",
                f"{evaluation.mean(policy, lam, 'variance_ratio'):.2f}",
                f"{evaluation.mean(policy, lam, 'energy_mj'):.1f}",
                f"{evaluation.mean(policy, lam, 'members'):.1f}",
                *(f"{value:.2f}" for value in evaluation.values(policy, lam, "rms_m").mean(axis=1)),
            ]
        )
    return header + list(evaluation.by_track), rows


def compare_at_equal_energy(evaluation: RecordedEvaluation, lam: float) -> list[str]:
    """How each single policy stands to each family at its energy."""
    lines, policies = [], evaluation.first.policies
    stems = evaluation.first.families()
    for policy in policies:
        if stem_of(policy) in stems:
            continue
        energy, rms = evaluation.mean(policy, lam, "energy_mj"), evaluation.mean(policy, lam, "rms_m")
        for stem in stems:
            there = evaluation.rms_at_energy_m(stem, lam, energy)
            if there is not None:
                lines.append(
                    f"{policy}: {rms:.2f} m at {energy:.1f} mJ; {stem} at that energy, interpolated: {there:.2f} m"
                )
    return lines


def print_recorded_tables(evaluation: RecordedEvaluation) -> None:
    """A table for each lam that fits 80 columns; tracks.md has each track's error, too."""
    console = wide_console()
    for lam in evaluation.first.lams:
        header, rows = recorded_rows(evaluation, lam)
        title = f"{evaluation.first.scenario.name}, {evaluation.description}, lam = {lam:g} m/mJ"
        shown = len(header) - len(evaluation.by_track)
        drawn = narrow_table(title, header[:shown])
        for row in rows:
            drawn.add_row(*row[:shown])
        console.print(drawn)
        console.print("\n".join(compare_at_equal_energy(evaluation, lam)), style="dim")


def recorded_markdown(evaluation: RecordedEvaluation) -> str:
    """The same as Markdown, below what must be said of the files."""
    parts = list(evaluation.notes)
    for lam in evaluation.first.lams:
        header, rows = recorded_rows(evaluation, lam)
        header[-len(evaluation.by_track) :] = map(escape_markdown, evaluation.by_track)
        rows = [[escape_markdown(name), *figures] for name, *figures in rows]
        title = f"## {evaluation.description}, lam = {lam:g} m/mJ\n"
        comparisons = (f"- {escape_markdown(line)}" for line in compare_at_equal_energy(evaluation, lam))
        parts.append("\n".join([title, markdown_table(header, rows), *comparisons]))
    return "\n\n".join(parts) + "\n"


def save_recorded(evaluation: RecordedEvaluation, out: str | Path) -> list[str]:
    """Write tracks.csv, .json, .md and, with matplotlib, .png into a folder, each whole or not at all; returns their
    names."""
    out = Path(out)
    evaluation.save(out)
    with replacing(out / "tracks.md") as path:
        path.write_text(recorded_markdown(evaluation), encoding="utf-8")
    names = ["tracks.csv", "tracks.json", "tracks.md"]
    if can_draw():
        names.append("tracks.png")
        write_picture(out / "tracks.png", draw_recorded(evaluation))
    return names
