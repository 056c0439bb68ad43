"""Studies for people: returns by lam over several trainings, what sets a variant apart, learning curves."""

from __future__ import annotations

import json
from collections.abc import Mapping
from itertools import cycle
from pathlib import Path

import numpy as np
from scipy import stats

from wsn_env.envs.rendering.colours import LINES
from wsn_env.evaluation.files import replacing
from wsn_env.learning.held_out import HELD_OUT
from wsn_env.reports.markdown import markdown_table
from wsn_env.reports.pages.learning_curves import STEPS, read_progress

LOWEST = -15.0  # percent; what is worse still is not drawn

Returns = dict[float, np.ndarray]  # lam: (episodes,)


def over_seeds(values) -> tuple[float, float]:
    """Mean and half of the 95 % interval (Student) over trainings; NaN for a single one."""
    values = np.asarray(values, float)
    half = stats.t.ppf(0.975, len(values) - 1) * values.std(ddof=1) / len(values) ** 0.5 if len(values) > 1 else np.nan
    return float(values.mean()), float(half)


def table(lams, results: dict[str, list[Returns]], usual: str) -> str:
    """Markdown: mean return at each lam, with the difference from the usual variant in percent, over trainings."""
    rows = []
    for name, runs in results.items():
        cells = []
        for lam in lams:
            means = [run[lam].mean() for run in runs if lam in run]
            if not means:
                cells.append("")
                continue
            mean, half = over_seeds(means)
            cell = f"{mean:.1f} ± {half:.1f}"
            reference = np.mean([run[lam].mean() for run in results.get(usual, []) if lam in run] or [np.nan])
            if name != usual and np.isfinite(reference):
                cell += f" ({100 * (mean - reference) / abs(reference):+.1f} %)"
            cells.append(cell)
        rows.append([name, *cells])
    return markdown_table(["variant", *(f"lam = {lam:g}" for lam in lams)], rows)


def save_table(out: Path, scenario, lams, results: dict[str, list[Returns]], usual: str) -> None:
    """Write NAME.md and NAME.json into a folder, and print the table."""
    text = table(lams, results, usual)
    print(text)
    means = {
        name: [{f"{lam:g}": float(values.mean()) for lam, values in run.items()} for run in runs]
        for name, runs in results.items()
    }
    for suffix, content in (("md", text), ("json", json.dumps(means, indent=1))):
        with replacing(out / f"{scenario.name}.{suffix}") as path:
            path.write_text(content, encoding="utf-8")


def learning_curve(folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Of a run of train.py: periods (N,), and its lead over the best rule on held-out episodes (N,), the mean over the
    trade-offs [%]."""
    progress = read_progress(folder)
    names = [name for name in progress if name.startswith(HELD_OUT) and not name.endswith("_se")]
    if not names:
        raise ValueError(f"{folder}: no progress-*/progress.csv with a lead on held-out episodes")
    lead = np.mean([progress[name] for name in names], axis=0)
    told = np.isfinite(lead)
    return progress[STEPS][told], lead[told]


def draw_curves(folders: Mapping[str, list[Path]], title: str, path: Path) -> None:
    """Picture of learning curves: the mean over each variant's trainings, and its 95 % interval (Student).

    Args:
        folders: {variant: runs of train.py with the same number of periods}.
        path: a PNG file.
    """
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(9, 5.5), layout="constrained")
    for (name, runs), colour, line in zip(folders.items(), cycle(LINES), cycle(["-"] * len(LINES) + ["--"] * 7)):
        curves = [learning_curve(folder) for folder in runs]
        periods = curves[0][0]
        leads = np.array([np.interp(periods, *curve) for curve in curves])
        mean, half = np.array([over_seeds(column) for column in leads.T]).T
        axes.plot(periods / 1e6, mean, line, color=colour, linewidth=1.3, label=name)
        axes.fill_between(periods / 1e6, mean - half, mean + half, color=colour, alpha=0.15, linewidth=0)
    axes.set(title=title, xlabel="periods [million]", ylabel="return over the best rule, mean over lam [%]")
    axes.set_ylim(bottom=max(axes.get_ylim()[0], LOWEST))
    axes.grid(alpha=0.3, linewidth=0.5)
    axes.legend(frameon=False, fontsize=9, loc="lower right")
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=140, format="png")
    plt.close(figure)
