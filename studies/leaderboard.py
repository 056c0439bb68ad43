"""The standard benchmark of every policy that comes with the package, and what its scores are measured by.

    python -m studies.leaderboard --out out/leaderboard

Writes leaderboard.md; with --references also the returns of the best and of random choices in these scenarios into the
package, anew: a new version of the benchmark. What was played is kept in the folder: a study that was stopped goes on.
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass, field
from pathlib import Path

import tyro

from wsn_env.envs.registration import STANDARD
from wsn_env.evaluation import standard
from wsn_env.evaluation.files import replacing
from wsn_env.evaluation.policies import make_policy
from wsn_env.evaluation.progress import progress_bar
from wsn_env.reports.standard_tables import save_standard, standard_table
from wsn_env.scenario import Scenario

POLICIES = (  # those that act in every scenario; the planner would take days
    *("random", "static_cluster", "centroid", "pre_dc", "strongest", "strongest_signal", "quadrants", "every"),
    *("nearest0", "nearest1", "nearest2", "nearest4", "informed1", "informed2", "informed4"),
    *("adaptive", "adaptive_informed", "greedy", "ppo"),
)


@dataclass
class Leaderboard:
    """How much is played."""

    scenarios: list[str] = field(default_factory=lambda: list(STANDARD))
    """Which."""
    episodes: int = standard.EPISODES
    """In each, at each trade-off."""
    references: bool = False
    """Write what scores are measured by into the package."""
    out: Path = Path("out/leaderboard")
    """Folder."""


def main(arguments: list[str] | None = None) -> int:
    """Play, print and write leaderboard.md."""
    asked = tyro.cli(Leaderboard, args=arguments, description=__doc__)
    asked.out.mkdir(parents=True, exist_ok=True)
    evaluations = []
    for name in asked.scenarios:
        preset = standard.standard_scenario(name)
        fitting = [label for label in POLICIES if fits(label, preset)]
        with progress_bar() as report:
            evaluations.append(
                standard.play_standard(fitting, name, asked.episodes, asked.out / name, report),
            )
    if asked.references:
        told = json.loads(standard.REFERENCES.read_text(encoding="utf-8"))
        told |= {standard.standard_name(each.scenario): standard.references_of(each) for each in evaluations}
        with replacing(standard.REFERENCES) as path:
            path.write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
        standard.references.cache_clear()
    found = standard.scores(evaluations)
    save_standard(found, asked.out)
    with replacing(asked.out / "leaderboard.md") as path:
        path.write_text(standard_table(found), encoding="utf-8")
    print(standard_table(found))
    return 0


def fits(label: str, scenario: Scenario) -> bool:
    """Whether a policy can act there."""
    try:
        make_policy(label, scenario)
    except ValueError:
        return False
    return True


if __name__ == "__main__":
    sys.exit(main())
