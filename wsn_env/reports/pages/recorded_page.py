"""The report page of a comparison on recorded tracks."""

from __future__ import annotations

import html
from collections.abc import Sequence
from pathlib import Path

from wsn_env.bluetooth.recorded_evaluation import RecordedEvaluation, insert_track_name
from wsn_env.evaluation.policies import named_policies
from wsn_env.evaluation.progress import Progress
from wsn_env.reports.pages.evaluation_page import save_report, settings_section
from wsn_env.reports.pages.page import collapsible, image, section, table
from wsn_env.reports.pages.samples import sample_sections
from wsn_env.reports.recorded_plots import draw_recorded
from wsn_env.reports.recorded_tables import compare_at_equal_energy, recorded_rows


def write_recorded_report(
    folder: str | Path, evaluation: RecordedEvaluation, policies: Sequence[str], progress: Progress | None = None
) -> Path:
    """Write report.html into a folder.

    Args:
        folder: of the evaluation.
        evaluation: to report.
        policies: as given to `evaluate_recorded`.
        progress: called with (periods played, of, what).

    Returns: the file.
    """
    first = evaluation.first.policies[0]
    middle = evaluation.first.middle_lam
    rms_m = evaluation.values(first, middle, "rms_m").mean(axis=1)
    hardest = list(evaluation.by_track)[rms_m.argmax()]
    of_hardest = evaluation.by_track[hardest]
    about = (
        f"{evaluation.description}. Means over the tracks, with the sd over seeds of that mean; e²/trace: squared"
        " error over what the belief takes it to be. Each track's RMS stands under its name."
    )
    tables = [f"<p>{html.escape(note)}</p>" for note in evaluation.notes]
    for lam in evaluation.first.lams:
        header, rows = recorded_rows(evaluation, lam)
        notes = "".join(f"<p>{html.escape(line)}</p>" for line in compare_at_equal_energy(evaluation, lam))
        tables.append(
            collapsible(f"lam = {lam:g} m/mJ", table([header, *rows], strong=first), notes, open=lam == middle)
        )
    named = named_policies(insert_track_name(policies, hardest), of_hardest.scenario)
    sections = [
        section("Comparison", f"<p>{about}</p>", *tables),
        section("Error against energy", image(draw_recorded(evaluation), "RMS error against energy")),
        section(
            "The hardest track",
            f"<p>{html.escape(hardest)}, on which {html.escape(first)} errs most; what follows is of this track.</p>",
        ),
        *sample_sections(of_hardest, named, progress),
        settings_section(of_hardest),
    ]
    title = f"{evaluation.first.scenario.name}: {len(evaluation.by_track)} recorded tracks"
    return save_report(Path(folder), title, sections)
