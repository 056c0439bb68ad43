"""Tables of studies: returns by lam, means over trainings, and what sets a variant apart from the usual one."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from scipy import stats

from wsn_env.files import replacing

Returns = dict[float, np.ndarray]  # lam: (episodes,)


def over_seeds(values) -> tuple[float, float]:
    """Mean and half of the 95 % interval (Student) over trainings; NaN for a single one."""
    values = np.asarray(values, float)
    half = stats.t.ppf(0.975, len(values) - 1) * values.std(ddof=1) / len(values) ** 0.5 if len(values) > 1 else np.nan
    return float(values.mean()), float(half)


def table(lams, results: dict[str, list[Returns]], usual: str) -> str:
    """Markdown: mean return at each lam, with the difference from the usual variant in percent, over trainings."""
    lines = ["| variant | " + " | ".join(f"lam = {lam:g}" for lam in lams) + " |", "|---" + "|--:" * len(lams) + "|"]
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
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


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
            path.write_text(content)
