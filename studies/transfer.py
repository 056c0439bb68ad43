"""Trained policies in worlds that they were not trained in, beside the best cluster size there.

    python -m studies.transfer --scenario Rssi-v0 --policies runs/a runs/b runs/c --out out/transfer

Other fields, motion, noise, loss and numbers of particles: tables of docs/learning.md. In each, the best of nearest0 ..
nearest8 is chosen in hindsight.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from pathlib import Path

import tyro

from studies.seeds import best_of, format_advantage, load_trained, returns
from wsn_env.cli import make_scenario
from wsn_env.evaluation.comparison import Evaluation, evaluate
from wsn_env.evaluation.files import replacing
from wsn_env.evaluation.kept_blocks import remove_kept_blocks
from wsn_env.evaluation.policies import make_policy
from wsn_env.evaluation.progress import progress_bar
from wsn_env.reports.markdown import markdown_table
from wsn_env.scenario import Scenario

SIZES = [f"nearest{size}" for size in range(9)]


@dataclass
class Transfer:
    """Compare trainings with the best size in other worlds."""

    policies: list[Path]
    """Folders of trained policies, or their policy.json."""
    scenario: str = "PreDC-v0"
    """Scenario id."""
    worlds: list[str] = field(default_factory=list)
    """Each some quantities, as "name=value name=value"; left out: the study's own."""
    lam: list[float] = field(default_factory=list)
    """Trade-offs [m/mJ]; left out: the scenario's octaves."""
    episodes: int = 300
    """Held-out episodes."""
    seed: int = 0
    """Which."""
    out: Path = Path("out/transfer")
    """Folder; a second call continues."""


def main() -> int:
    """Run."""
    asked = tyro.cli(Transfer, description=__doc__)
    usual = make_scenario(asked.scenario, [], [])
    worlds = {text: text for text in asked.worlds} or worlds_of(usual)
    scenarios = {what: make_scenario(asked.scenario, text.split(), []) for what, text in worlds.items()}
    lams = asked.lam or usual.lam_octaves
    rows = []
    for i, (what, scenario) in enumerate(scenarios.items(), 1):
        trained = load_trained(asked.policies, scenario)
        policies = trained | {name: make_policy(name, scenario) for name in SIZES}
        keep = world_folder(asked, worlds[what])
        print(f"{i} of {len(scenarios)}: {what}", file=sys.stderr)
        with progress_bar() as report:
            evaluation = evaluate(policies, scenario, lams, asked.episodes, asked.seed, keep=keep, progress=report)
        evaluation.save(keep)
        rows.append([what, *format_cells(evaluation, list(trained))])
    text = markdown_table(["world", *(f"{lam:g}" for lam in lams)], rows)
    with replacing(asked.out / f"{usual.name}.md") as path:
        path.write_text(text, encoding="utf-8")
    for settings in worlds.values():
        remove_kept_blocks(world_folder(asked, settings))
    print(text)
    return 0


def world_folder(asked: Transfer, settings: str) -> Path:
    """Of one world's rows."""
    return asked.out / f"{asked.scenario}-{settings.replace(' ', '-')}"


def worlds_of(scenario: Scenario) -> dict[str, str]:
    """{what it is: quantities} that suit a scenario of 225 random nodes on 100 m."""
    name, sd, unit = ("noise_m", 2.0, "m") if scenario.measurement.values == 2 else ("noise_db", 3.0, "dB")
    return {
        "81 nodes on 60 m: the same density": "nodes=81 side_m=60",
        "1,000 on 211 m: the same density": "nodes=1000 side_m=210.8",
        "1,000 on 100 m: dense": "nodes=1000",
        "81 on 100 m: sparse": "nodes=81",
        "turns of up to 90° at 1 m/s": "motion=turns",
        "a circle at 1.9 m/s": "motion=circle",
        "random waypoints at 1 m/s": "motion=waypoint",
        f"half the noise, {sd / 2:g} {unit}": f"{name}={sd / 2:g}",
        f"twice the noise, {2 * sd:g} {unit}": f"{name}={2 * sd:g}",
        "three packets in ten are lost, 3 retries": "packet_success=0.7",
        "three packets in ten are lost, no retry": "packet_success=0.7 retries=0",
        "500 particles": "particles=500",
    }


def format_cells(evaluation: Evaluation, trained: list[str]) -> list[str]:
    """At each lam the trainings' mean return, and what it has over the best size."""
    found = []
    for lam in evaluation.lams:
        best = best_of(evaluation, SIZES, lam)
        found.append(
            f"{returns(evaluation, trained, lam).mean():.1f} ({format_advantage(evaluation, trained, best, lam)})"
        )
    return found


if __name__ == "__main__":
    sys.exit(main())
