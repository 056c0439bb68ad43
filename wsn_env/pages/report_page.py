"""The report page: what was asked for and what came out of an evaluation, or of a training and its comparison."""

from __future__ import annotations

import csv
import html
import json
from collections.abc import Sequence
from itertools import chain
from pathlib import Path

import numpy as np

from wsn_env.evaluation import Evaluation, episodes, evaluation_seeds, versions
from wsn_env.files import replacing
from wsn_env.front import Fronts, fronts
from wsn_env.front_report import draw_fronts
from wsn_env.pages.page import whole_page
from wsn_env.pages.recording import common, record
from wsn_env.pages.replay_page import player
from wsn_env.pictures import picture_address
from wsn_env.policies import Policy
from wsn_env.reports import about_the_bound, best_in_hindsight, draw_front, table_header, table_rows
from wsn_env.scenario import Scenario
from wsn_env.world import World

REPORT_FILE = "report.html"
SHOWN = 4  # policies in the histograms
NEAR = 6  # policies in the picture of every lam, besides the first
LOOKED_AT = 50  # episodes of the histograms
COLOURS = ("#D55E00", "#0072B2", "#009E73", "#CC79A7")  # Okabe and Ito's
CURVES = {  # of a training's progress.csv: the mean, its standard error, what it is
    "rollout/episode_rms_m": ("rollout/episode_rms_se_m", "RMS error of an episode [m]"),
    "rollout/ep_rew_mean": ("rollout/ep_rew_se", "training return, scaled"),
}
NORMAL_95 = 1.96


def write_report(
    folder: str | Path,
    evaluation: Evaluation | None = None,
    policies: dict[str, Policy] | None = None,
    training: dict | None = None,
) -> Path:
    """Write report.html into a folder.

    Args:
        folder: of the run or the evaluation; a training's learning curve is read from its progress-*/progress.csv.
        evaluation: left out: the page has no comparison.
        policies: with an evaluation its policies by name, for histograms and the worst episode. The first is what the
            others are compared with.
        training: settings of the training.

    Returns: the file.
    """
    folder = Path(folder)
    sections = [*_curve_section(folder)]
    title = f"Training {folder.name}"
    if evaluation is not None:
        names = ", ".join(evaluation.policies[:3]) + (", ..." if len(evaluation.policies) > 3 else "")
        title = f"{evaluation.scenario.name}: {names}"
        sections = [*_comparison_sections(evaluation), *sections, *_episode_sections(evaluation, policies)]
    sections += _settings_sections(evaluation, training)
    with replacing(folder / REPORT_FILE) as path:
        path.write_text(whole_page("report", title, "\n".join(sections)), encoding="utf-8")
    return folder / REPORT_FILE


def middle(lams: Sequence[float]) -> float:
    """The trade-off that pictures are drawn at."""
    return lams[len(lams) // 2]


# --- the comparison ---


def _comparison_sections(evaluation: Evaluation) -> list[str]:
    reference = evaluation.policies[0]
    parts = [
        f"<p>{evaluation.episodes:,} paired episodes of each policy and lam: all meet the same fields, tracks,"
        f" detections and noises. Means with 95 % bootstrap intervals; <i>{html.escape(reference)} minus it</i> is the"
        f" paired difference of returns. The column of the bound: {html.escape(about_the_bound(evaluation))}.</p>"
    ]
    for lam in evaluation.lams:
        rows = [table_header(evaluation, reference), *table_rows(evaluation, lam, reference)]
        opened = " open" if lam == middle(evaluation.lams) else ""
        notes = "".join(f"<p>{html.escape(line)}</p>" for line in best_in_hindsight(evaluation, lam))
        parts.append(
            f"<details{opened}><summary>lam = {lam:g} m/mJ</summary>{_table(rows, reference)}{notes}</details>"
        )
    figure = draw_front(evaluation, middle(evaluation.lams), emphasis=reference)
    pictures = [_picture(figure, "mean error against energy")]
    if len(evaluation.lams) > 1:
        if len(evaluation.policies) > NEAR + 1:
            at = f"{middle(evaluation.lams):g} m/mJ"
            pictures.append(f"<p>{html.escape(reference)} and the {NEAR} best at lam = {at}, at every lam:</p>")
        figure = draw_fronts(evaluation, _best_fronts(evaluation))
        pictures.append(_picture(figure, "error against energy at every lam"))
    return [_section("Comparison", *parts), _section("Error against energy", *pictures)]


def _ranked(evaluation: Evaluation, lam: float) -> list[str]:
    """Policies, the best mean return first."""
    return sorted(evaluation.policies, key=lambda policy: -evaluation.values(policy, lam, "return").mean())


def _best_fronts(evaluation: Evaluation) -> Fronts:
    """Those of the first policy and of the best."""
    kept = {evaluation.policies[0], *_ranked(evaluation, middle(evaluation.lams))[:NEAR]}
    found = fronts(evaluation)
    return {name: points for name, points in found.items() if kept & {point.policy for point in points}}


def _episode_sections(evaluation: Evaluation, policies: dict[str, Policy]) -> list[str]:
    """What single episodes tell: histograms, and the first policy's worst one beside the best of the others."""
    lam = middle(evaluation.lams)
    scenario = evaluation.scenario.override(lam=lam)
    first = evaluation.policies[0]
    others = [policy for policy in _ranked(evaluation, lam) if policy != first]
    seeds = evaluation_seeds(evaluation.seed, evaluation.episodes)
    returns = evaluation.values(first, lam, "return")
    worst = int(returns.argmin())
    beside = [first, *others[:1]]
    recorded = [record(policy, policies[policy], scenario, seeds[worst]) for policy in beside]
    shown = {policy: policies[policy] for policy in [first, *others][:SHOWN]}
    looked_at = seeds[:LOOKED_AT]
    return [
        _section(
            "Errors and cluster sizes",
            f"<p>Every period of the first {len(looked_at)} episodes, lam = {lam:g} m/mJ.</p>",
            _picture(_draw_histograms(shown, scenario, looked_at), "histograms of errors and of cluster sizes"),
        ),
        _section(
            f"The worst episode of {first}",
            f"<p>Seed {seeds[worst]}, lam = {lam:g} m/mJ, return {returns[worst]:.1f} (mean {returns.mean():.1f})."
            " Click it, then space plays and arrows step.</p>",
            player(common(scenario, seeds[worst]), recorded),
        ),
    ]


def _draw_histograms(policies: dict[str, Policy], scenario: Scenario, seeds: Sequence[int]):
    """Shares of periods, by error and by how many nodes were awake."""
    from matplotlib.figure import Figure

    world = World(scenario)
    played = {}
    for name, policy in policies.items():
        periods = [(outcome.error_m.copy(), outcome.members.copy()) for _, outcome in episodes(policy, world, seeds)]
        played[name] = [np.concatenate(values) for values in zip(*periods)]
    figure = Figure(figsize=(9, 3.4), layout="constrained")
    left, right = figure.subplots(1, 2)
    most, largest = (np.quantile(np.concatenate(values), 0.99) for values in zip(*played.values()))
    edges, sizes = np.linspace(0.0, most, 41), np.arange(int(largest) + 3) - 0.5
    for (name, (errors, awake)), colour in zip(played.items(), COLOURS):
        share = np.histogram(np.minimum(errors, most), edges)[0] / len(errors)
        left.stairs(100 * share, edges, color=colour, label=name, linewidth=1.5)
        share = np.histogram(np.minimum(awake, sizes[-2] + 0.5), sizes)[0] / len(awake)
        right.stairs(100 * share, sizes, color=colour, label=name, linewidth=1.5)
    left.set(xlabel="error [m]; last: and more", ylabel="periods [%]")
    right.set(xlabel="nodes awake; last: and more", ylabel="periods [%]")
    right.xaxis.get_major_locator().set_params(integer=True)
    left.legend(frameon=False)
    return figure


# --- the training ---


def _curve_section(folder: Path) -> list[str]:
    progress = read_progress(folder)
    steps = progress.get("time/total_timesteps")
    drawn = [name for name in CURVES if name in progress and np.isfinite(progress[name]).any()]
    if steps is None or not drawn:
        return []
    picture = _picture(_draw_curves(steps, progress, drawn), "learning curves")
    return [_section("Learning", "<p>Means over the last episodes, with 95 % intervals.</p>", picture)]


def read_progress(folder: str | Path) -> dict[str, np.ndarray]:
    """Columns of all progress-*/progress.csv of a run, in the order of the steps; what is missing is NaN.

    A line that was cut short when the run was killed is left out.
    """
    rows = []
    for path in Path(folder).glob("progress-*/progress.csv"):
        whole, _, _cut_short = path.read_text().rpartition("\n")
        rows += [
            {name: float(value or "nan") for name, value in row.items()} for row in csv.DictReader(whole.splitlines())
        ]
    rows.sort(key=lambda row: row.get("time/total_timesteps", np.nan))
    names = dict.fromkeys(chain.from_iterable(rows))
    return {name: np.array([row.get(name, np.nan) for row in rows]) for name in names}


def _draw_curves(steps, progress: dict[str, np.ndarray], names: Sequence[str]):
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.5 * len(names), 3.4), layout="constrained")
    for axes, name in zip(np.atleast_1d(figure.subplots(1, len(names))), names):
        error, what = CURVES[name]
        known = np.isfinite(progress[name])
        axes.plot(steps[known], progress[name][known], color=COLOURS[1], linewidth=1.5)
        if error in progress:
            half = NORMAL_95 * progress[error][known]
            ends = progress[name][known] - half, progress[name][known] + half
            axes.fill_between(steps[known], *ends, color=COLOURS[1], alpha=0.25, linewidth=0)
        axes.set(xlabel="periods of training", ylabel=what)
        axes.xaxis.set_major_formatter(lambda value, _: f"{value / 1e6:g} M" if value >= 1e5 else f"{value:,.0f}")
        axes.grid(alpha=0.3)
    return figure


# --- settings ---


def _settings_sections(evaluation: Evaluation | None, training: dict | None) -> list[str]:
    parts = []
    if evaluation is not None:
        seeds = evaluation_seeds(evaluation.seed, evaluation.episodes)
        facts = [
            ("scenario", evaluation.scenario.name),
            ("lam [m/mJ]", ", ".join(f"{lam:g}" for lam in evaluation.lams)),
            ("policies", ", ".join(evaluation.policies)),
            ("episodes", f"{evaluation.episodes:,}"),
            ("seeds", f"{seeds[0]} to {seeds[-1]}"),
        ]
        parts.append(_table(facts))
        for section, values in evaluation.scenario.as_dict().items():
            if isinstance(values, dict):
                parts.append(_folded(section, values))
    if training:
        parts.append(_folded("training", training))
    parts.append(_folded("versions", versions()))
    return [_section("Settings", *parts)]


def _folded(title: str, values: dict) -> str:
    rows = [
        (name, value if isinstance(value, str) else json.dumps(value, default=str)) for name, value in values.items()
    ]
    return f"<details><summary>{html.escape(title)}</summary>{_table(rows)}</details>"


# --- HTML ---


def _section(title: str, *parts: str) -> str:
    return f"<section><h2>{html.escape(title)}</h2>\n" + "\n".join(parts) + "</section>"


def _table(rows: Sequence[Sequence[str]], strong: str | None = None) -> str:
    """Rows of text; with `strong` the first is the header, and the row of that name stands out."""
    lines = []
    for k, row in enumerate(rows):
        cell = "th" if strong is not None and k == 0 else "td"
        mark = ' class="strong"' if strong is not None and row[0] == strong else ""
        lines.append(f"<tr{mark}>" + "".join(f"<{cell}>{html.escape(str(text))}</{cell}>" for text in row) + "</tr>")
    kind = "" if strong is None else ' class="figures"'
    return f'<div class="wide"><table{kind}>{"".join(lines)}</table></div>'


def _picture(figure, words: str) -> str:
    return f'<img alt="{html.escape(words)}" src="{picture_address(figure)}">'
