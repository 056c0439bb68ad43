"""The report page: what was asked for and what came out of an evaluation, or of a training and its comparison."""

from __future__ import annotations

import html
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from wsn_env.evaluation.comparison import Evaluation
from wsn_env.evaluation.files import replacing
from wsn_env.evaluation.front import Fronts, find_fronts
from wsn_env.evaluation.policies import Policy, named_policies
from wsn_env.evaluation.progress import Progress
from wsn_env.evaluation.rollout import evaluation_seeds
from wsn_env.evaluation.versions import versions
from wsn_env.reports.front_plots import draw_fronts
from wsn_env.reports.pages.learning_curves import learning_sections
from wsn_env.reports.pages.page import build_page, collapsible, image, section, table, values_table
from wsn_env.reports.pages.samples import sample_sections
from wsn_env.reports.plots import draw_comparison
from wsn_env.reports.tables import describe_best_in_hindsight, describe_reference, table_header, table_rows

REPORT_FILE = "report.html"
NEAR = 6  # policies in the picture of every lam, besides the first


def write_report(
    folder: str | Path,
    evaluation: Evaluation | None = None,
    policies: dict[str, Policy] | None = None,
    training: dict[str, Any] | None = None,
    progress: Progress | None = None,
) -> Path:
    """Write report.html into a folder.

    Args:
        folder: of the run or the evaluation; a training's learning curve is read from its progress-*/progress.csv.
        evaluation: left out: the page has no comparison.
        policies: those of the evaluation by name, for histograms and the worst episode; left out: neither. The first is
            what the others are compared with.
        training: settings of the training.
        progress: called with (episodes' periods played, of, what).

    Returns: the file.
    """
    folder = Path(folder)
    sections = [*learning_sections(folder)]
    title = f"Training {folder.name}"
    if evaluation is not None:
        names = ", ".join(evaluation.policies[:3]) + (", ..." if len(evaluation.policies) > 3 else "")
        title = f"{evaluation.scenario.title}: {names}"
        made = named_policies(policies, evaluation.scenario) if policies else {}
        samples = sample_sections(evaluation, made, progress) if made else []
        sections = [*_comparison_sections(evaluation), *sections, *samples]
    return save_report(folder, title, [*sections, settings_section(evaluation, training)])


def save_report(folder: Path, title: str, sections: Sequence[str]) -> Path:
    """Write report.html, whole or not at all; returns the file."""
    with replacing(folder / REPORT_FILE) as path:
        path.write_text(build_page("report", title, "\n".join(sections)), encoding="utf-8")
    return folder / REPORT_FILE


# --- the comparison ---


def _comparison_sections(evaluation: Evaluation) -> list[str]:
    reference = evaluation.policies[0]
    parts = [
        f"<p>{evaluation.episodes:,} paired episodes of each policy and lam: all meet the same fields, tracks,"
        f" detections and noises. Means with 95 % bootstrap intervals; <i>difference to {html.escape(reference)}</i>"
        " is the paired difference of returns, positive is better. About the reference:"
        f" {html.escape(describe_reference(evaluation))}.</p>"
    ]
    for lam in evaluation.lams:
        rows = [table_header(evaluation, reference), *table_rows(evaluation, lam, reference)]
        notes = "".join(f"<p>{html.escape(line)}</p>" for line in describe_best_in_hindsight(evaluation, lam))
        parts.append(
            collapsible(f"lam = {lam:g} m/mJ", table(rows, reference), notes, open=lam == evaluation.middle_lam)
        )
    figure = draw_comparison(evaluation, evaluation.middle_lam, emphasis=reference)
    pictures = [image(figure, "mean error against energy")]
    if len(evaluation.lams) > 1:
        if len(evaluation.policies) > NEAR + 1:
            at = f"{evaluation.middle_lam:g} m/mJ"
            pictures.append(f"<p>{html.escape(reference)} and the {NEAR} best at lam = {at}, at every lam:</p>")
        figure = draw_fronts(evaluation, _best_fronts(evaluation))
        pictures.append(image(figure, "error against energy at every lam"))
    return [section("Comparison", *parts), section("Error against energy", *pictures)]


def _best_fronts(evaluation: Evaluation) -> Fronts:
    """Those of the first policy and of the best."""
    kept = {evaluation.policies[0], *evaluation.ranked(evaluation.middle_lam)[:NEAR]}
    found = find_fronts(evaluation)
    return {name: points for name, points in found.items() if kept & {point.policy for point in points}}


# --- settings ---


def settings_section(evaluation: Evaluation | None, training: dict[str, Any] | None = None) -> str:
    """What was asked for, and the versions."""
    parts = []
    if evaluation is not None:
        seeds = evaluation_seeds(evaluation.seed, evaluation.episodes)
        facts = {
            "scenario": evaluation.scenario.title,
            "lam [m/mJ]": ", ".join(f"{lam:g}" for lam in evaluation.lams),
            "policies": ", ".join(evaluation.policies),
            "episodes": f"{evaluation.episodes:,}",
            "seeds": f"{seeds[0]} to {seeds[-1]}",
        }
        scenario = evaluation.scenario.as_dict()
        parts_of = {name: values for name, values in scenario.items() if isinstance(values, dict)}
        whole = {name: value for name, value in scenario.items() if name not in (*parts_of, "lam")}
        parts = [values_table(facts)]
        parts += [collapsible(name, values_table(values)) for name, values in ({"scenario": whole} | parts_of).items()]
    if training:
        parts.append(collapsible("training", values_table(training)))
    return section("Settings", *parts, collapsible("versions", values_table(versions())))
