"""Schedules and filters in a world that goes wrong: every fault at three strengths, PreDC-v0 at lam = 4.

    python -m studies.faults --trained runs/ppo_faults --out out/faults

The same 200 episodes in every world. `--trained` are policies that have met faults in their trainings (docs/faults.md
has the commands). Writes policies.md, measures.md, retrained.md, filters.md and costs.png.
"""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import tyro

from wsn_env.envs.rendering.colours import LINES
from wsn_env.evaluation.comparison import Evaluation, evaluate
from wsn_env.evaluation.files import replacing
from wsn_env.evaluation.intervals import Measured, Summary
from wsn_env.evaluation.kept_blocks import remove_kept_blocks
from wsn_env.evaluation.progress import progress_bar
from wsn_env.reports.markdown import markdown_table
from wsn_env.scenario import Scenario

LAM = 4.0
POLICIES = ("static_cluster", "pre_dc", "nearest0", "nearest2", "adaptive", "greedy", "ppo")
STRENGTHS: dict[str, tuple[str, ...]] = {  # of each fault, weak, middling and strong
    "failures": ("share=0.1", "share=0.3", "share=0.5"),
    "regional_failure": ("region_m=15", "region_m=25", "region_m=40"),
    "stuck": ("share=0.05", "share=0.1", "share=0.2"),
    "biased": ("bias_m=2.5", "bias_m=5", "bias_m=10"),
    "misplaced": ("position_sd_m=0.5", "position_sd_m=1", "position_sd_m=2"),
    "false_alarms": ("probability=0.02", "probability=0.05", "probability=0.1"),
    "missed": ("probability=0.1", "probability=0.2", "probability=0.4"),
    "bursts": ("to_bad=0.02", "to_bad=0.05", "to_bad=0.1"),
    "late": ("probability=0.1", "probability=0.2", "probability=0.4"),
    "stops": ("stop_s=10", "stop_s=20", "stop_s=40"),
    "excursion": ("outside_m=2", "outside_m=10", "outside_m=25"),
}
FILTERS = {  # settings by label
    "plain filter": {},
    "gate_sds=3": dict(gate_sds=3.0),
    "gate_sds=4": dict(gate_sds=4.0),
    "outlier_share=0.05": dict(outlier_share=0.05),
    "outlier_share=0.2": dict(outlier_share=0.2),
    "node_sd_m=1": dict(node_sd_m=1.0),
    "node_sd_m=2": dict(node_sd_m=2.0),
    "outlier_share=0.05, node_sd_m=1": dict(outlier_share=0.05, node_sd_m=1.0),
}
FILTERED = ("", "false_alarms,probability=0.05", "stuck,share=0.1", "biased,bias_m=5", "misplaced,position_sd_m=1")
FILTERED_POLICY = "nearest2"
SOUND = "no fault"


@dataclass
class Faults:
    """How many episodes, and which learned policy."""

    trained: list[Path] = field(default_factory=list)
    """Folders of policies trained with faults, whose names are theirs."""
    episodes: int = 200
    """In every world."""
    out: Path = Path("out/faults")
    """Folder; a second call continues."""


def worlds() -> dict[str, str]:
    """Faults by label."""
    return {SOUND: ""} | {
        f"{name}, {setting}": f"{name},{setting}" for name, settings in STRENGTHS.items() for setting in settings
    }


def main(arguments: list[str] | None = None) -> int:
    """Play, print and write."""
    asked = tyro.cli(Faults, args=arguments, description=__doc__)
    asked.out.mkdir(parents=True, exist_ok=True)
    names = [*POLICIES, *(f"{folder.name}={folder}" for folder in asked.trained)]
    played = {label: _play(asked, label, names, faults=text or None) for label, text in worlds().items()}
    filters = {
        (words, text): _play(asked, f"{words} {text}", [FILTERED_POLICY], faults=text or None, **settings)
        for words, settings in FILTERS.items()
        for text in FILTERED
    }
    tables = {"policies": cost_table(played), "measures": measures_table(played), "filters": filter_table(filters)}
    if asked.trained:
        tables["retrained"] = retrained_table(played, [folder.name for folder in asked.trained])
    for name, text in tables.items():
        with replacing(asked.out / f"{name}.md") as path:
            path.write_text(text, encoding="utf-8")
        print(text)
    draw_costs(played, asked.out / "costs.png")
    for label in [*played, *(f"{words} {text}" for words, text in filters)]:
        remove_kept_blocks(_folder(asked, label))
        _folder(asked, label).rmdir()
    return 0


def _play(asked: Faults, label: str, policies: list[str], **changes) -> Evaluation:
    """One world; what has been played is kept."""
    print(label, file=sys.stderr)
    scenario = Scenario.named("PreDC-v0", lam=LAM, **changes)
    with progress_bar() as report:
        return evaluate(policies, scenario, [LAM], asked.episodes, keep=_folder(asked, label), progress=report)


def _folder(asked: Faults, label: str) -> Path:
    """Of one world's rows."""
    return asked.out / re.sub(r"[^\w.=-]+", "_", label)


def costs(evaluation: Evaluation) -> dict[str, np.ndarray]:
    """(episodes,) error + lam energy of a mean time step [m], by policy."""
    periods = evaluation.scenario.periods
    return {name: -evaluation.values(name, LAM, "return") / periods for name in evaluation.policies}


def ranks(evaluation: Evaluation) -> dict[str, int]:
    """1 for the policy of the lowest cost, by policy."""
    order = sorted(means := {name: cost.mean() for name, cost in costs(evaluation).items()}, key=means.__getitem__)
    return {name: place for place, name in enumerate(order, 1)}


def cost_table(played: dict[str, Evaluation]) -> str:
    """Cost of every policy in every world, its standard error and its rank; and mean ranks over the faults."""
    rows, names = [], played[SOUND].policies
    for label, evaluation in played.items():
        found, place = costs(evaluation), ranks(evaluation)
        cells = [f"{Measured.mean(found[name])} · {place[name]}" for name in names]
        rows.append([label, *(f"**{cell}**" if cell.endswith("· 1") else cell for cell in cells)])
    places = np.array([[ranks(each)[name] for name in names] for label, each in played.items() if label != SOUND])
    rows.append(["mean rank over the faults", *(f"{mean:.1f}" for mean in places.mean(axis=0))])
    return markdown_table(["cost per time step, m (SE) · rank", *names], rows)


def measures_table(played: dict[str, Evaluation]) -> str:
    """RMS, energy and the share of time steps with an error above a sensing radius, of every policy in every world."""
    rows, names = [], played[SOUND].policies
    for label, evaluation in played.items():
        cells = []
        for name in names:
            values = [evaluation.values(name, LAM, column) for column in ("rms_m", "energy_mj", "tracked")]
            rms = np.sqrt((values[0] ** 2).mean())
            cells.append(f"{rms:.2f} / {1e3 * values[1].mean():.0f} / {100 * (1 - values[2].mean()):.1f}")
        rows.append([label, *cells])
    return markdown_table(["RMS m / energy µJ per time step / error > 10 m, % of time steps", *names], rows)


def retrained_table(played: dict[str, Evaluation], trained: list[str]) -> str:
    """How much less learned policies cost after a training with faults [%], with 95 % intervals of pairs."""

    def saved(name: str, label: str) -> str:
        cost = costs(played[label])
        found = Summary.of(100 * (cost["ppo"] - cost[name]) / cost["ppo"].mean())
        return f"{found.mean:+.1f} % ({found.low:+.1f} to {found.high:+.1f})"

    rows = []
    for name in trained:
        rows.append([f"{name}, {SOUND}", saved(name, SOUND), "", ""])
        for fault, settings in STRENGTHS.items():
            rows.append([f"{name}, {fault}", *(saved(name, f"{fault}, {setting}") for setting in settings)])
    return markdown_table(["cost reduction against ppo", "weak", "middling", "strong"], rows)


def filter_table(filters: dict[tuple[str, str], Evaluation]) -> str:
    """RMS of one policy with every filter, over episodes whose RMS counts as one sensing radius at most."""
    rows = []
    for words in FILTERS:
        cells = []
        for text in FILTERED:
            evaluation = filters[words, text]
            rms = np.minimum(evaluation.values(FILTERED_POLICY, LAM, "rms_m"), evaluation.scenario.radius_m)
            lost = 1 - evaluation.values(FILTERED_POLICY, LAM, "tracked").mean()
            cells.append(f"{Measured.mean(rms)} / {100 * lost:.1f}")
        rows.append([words, *cells])
    columns = [text.replace(",", ", ") or SOUND for text in FILTERED]
    return markdown_table(["RMS m / error > 10 m, % of time steps", *columns], rows)


def draw_costs(played: dict[str, Evaluation], path: Path) -> None:
    """Picture: what the policies cost by the strength of each fault, a panel a fault."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    names = [name for name in played[SOUND].policies if name != "nearest0"]
    figure, panels = plt.subplots(3, 4, figsize=(11, 7.5), sharey=True, layout="constrained")
    for panel, (fault, settings) in zip(panels.flat, STRENGTHS.items()):
        labels = [SOUND, *(f"{fault}, {setting}" for setting in settings)]
        for name, colour in zip(names, LINES):
            panel.plot([costs(played[label])[name].mean() for label in labels], "o-", color=colour, ms=3, lw=1.2)
        quantity = settings[0].partition("=")[0]
        panel.set(title=fault, xlabel=quantity, yscale="log")
        panel.set_xticks(range(4), ["none", *(setting.partition("=")[2] for setting in settings)])
        panel.grid(alpha=0.3, linewidth=0.5)
    panels[0, 0].set_yticks([1.5, 2, 3, 5], ["1.5", "2", "3", "5"])
    panels[0, 0].minorticks_off()
    for row in panels[:, 0]:
        row.set_ylabel("error + 4 m/mJ · energy [m]")
    last = panels.flat[len(STRENGTHS)]
    for name, colour in zip(names, LINES):
        last.plot([], [], "o-", color=colour, ms=3, lw=1.2, label=name)
    last.legend(frameon=False, loc="center")
    last.set_axis_off()
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=120, format="png")
    plt.close(figure)


if __name__ == "__main__":
    sys.exit(main())
