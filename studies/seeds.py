"""Several trainings of one scheduler against every rule, at every trade-off: the tables of docs/learning.md.

    python -m studies.seeds --scenario Rssi-v0 --policies runs/a runs/b runs/c --out out/seeds

PPO's return is the mean over the trainings, episode by episode; intervals are bootstraps over the episodes that all
share. The best of a numbered family is chosen in hindsight, at each lam by the very episodes it is compared on.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import tyro

from wsn_env.agents.ppo import PPOPolicy
from wsn_env.evaluation.comparison import Evaluation, evaluate
from wsn_env.evaluation.files import replacing
from wsn_env.evaluation.front import hypervolumes, join_points, policy_points, reference_point, split_number
from wsn_env.evaluation.intervals import Summary
from wsn_env.evaluation.kept_blocks import remove_kept_blocks
from wsn_env.evaluation.policies import make_policy, policy_names
from wsn_env.evaluation.progress import progress_bar
from wsn_env.reports.markdown import markdown_table
from wsn_env.scenario import Scenario
from wsn_env.scenario.options import make_scenario

SLOW = ("ppo", "planner", "mcts", "all")


@dataclass
class Comparison:
    """Compare trainings with rules."""

    policies: list[Path]
    """Folders of trained policies, or their policy.json."""
    scenario: str = "PreDC-v0"
    """Scenario id."""
    set: list[str] = field(default_factory=list)
    """Scenario quantities, as name=value."""
    tracks: list[Path] = field(default_factory=list)
    """CSV files of recorded motion (columns t, x, y in s and m) instead of the scenario's."""
    lam: list[float] = field(default_factory=list)
    """Trade-offs [m/mJ]; left out: the scenario's octaves."""
    rules: list[str] = field(default_factory=list)
    """Hand-written policies; left out: all but slow ones."""
    episodes: int = 1000
    """Held-out episodes."""
    seed: int = 0
    """Which."""
    out: Path = Path("out/seeds")
    """Folder for evaluation.csv, table.md and hypervolume.md; a second call continues."""


def main() -> int:
    """Run."""
    asked = tyro.cli(Comparison, description=__doc__)
    scenario = make_scenario(asked.scenario, asked.set, asked.tracks)
    trained = load_trained(asked.policies, scenario)
    rules = asked.rules or [name for name in policy_names() if name not in SLOW]
    policies = trained | {name: make_policy(name, scenario) for name in rules}
    lams = asked.lam or scenario.lam_octaves
    with progress_bar() as report:
        evaluation = evaluate(policies, scenario, lams, asked.episodes, asked.seed, keep=asked.out, progress=report)
    evaluation.save(asked.out)
    parts = {"table": table(evaluation, list(trained)), "hypervolume": table_of_volumes(evaluation, trained)}
    for name, text in parts.items():
        with replacing(asked.out / f"{name}.md") as path:
            path.write_text(text, encoding="utf-8")
        print(text)
    remove_kept_blocks(asked.out)
    return 0


def load_trained(paths: list[Path], scenario: Scenario) -> dict[str, PPOPolicy]:
    """ppo0, ppo1, ... from folders of runs, or from their policy.json."""
    files = [path / "policy.json" if path.is_dir() else path for path in paths]
    return {f"ppo{i}": PPOPolicy(scenario, path=str(file)) for i, file in enumerate(files)}


def returns(evaluation: Evaluation, trained: list[str], lam: float) -> np.ndarray:
    """(trainings, episodes)."""
    return np.array([evaluation.values(name, lam, "return") for name in trained])


def families(evaluation: Evaluation, trained: list[str]) -> dict[str, list[str]]:
    """Rules by their stems: nearest0..8 is one family, pre_dc another."""
    found: dict[str, list[str]] = {}
    for name in evaluation.policies:
        if name not in trained:
            found.setdefault(split_number(name)[0], []).append(name)
    return found


def best_of(evaluation: Evaluation, names: list[str], lam: float) -> str:
    """The one with the highest mean return, in hindsight."""
    return max(names, key=lambda name: evaluation.values(name, lam, "return").mean())


def format_advantage(evaluation: Evaluation, trained: list[str], rule: str, lam: float) -> str:
    """What the trainings' mean has over a rule, in percent of the rule's return."""
    theirs = evaluation.values(rule, lam, "return")
    ahead = Summary.of(returns(evaluation, trained, lam).mean(axis=0) - theirs)
    mean, low, high = (100 * value / abs(theirs.mean()) for value in (ahead.mean, ahead.low, ahead.high))
    return f"{mean:+.1f} [{low:+.1f}, {high:+.1f}] %"


def table(evaluation: Evaluation, trained: list[str]) -> str:
    """Returns at each lam; for each rule, or the best of its family, what PPO has over it, in percent of it."""
    lams = evaluation.lams
    cells = []
    for lam in lams:
        own = returns(evaluation, trained, lam)
        over_seeds = own.mean(axis=1)
        cells.append(f"**{own.mean():.1f}** ({over_seeds.min():.1f} to {over_seeds.max():.1f})")
    rows = [["**PPO**, one policy", *cells]]
    for stem, names in families(evaluation, trained).items():
        cells = []
        for lam in lams:
            best = best_of(evaluation, names, lam)
            theirs = evaluation.values(best, lam, "return").mean()
            which = f"{split_number(best)[1]}: " if len(names) > 1 else ""
            cells.append(f"{which}{theirs:.1f} ({format_advantage(evaluation, trained, best, lam)})")
        label = f"best of {stem}0..{split_number(names[-1])[1]}" if len(names) > 1 else stem
        rows.append([label, *cells])
    return markdown_table(["policy", *(f"{lam:g}" for lam in lams)], rows)


def table_of_volumes(evaluation: Evaluation, trained) -> str:
    """Hypervolume of the union of all rules, and of each training's front with the paired difference to it."""
    reference = reference_point(evaluation.scenario)
    by_policy = {name: policy_points(evaluation, name) for name in evaluation.policies}
    rules = join_points(points for name, points in by_policy.items() if name not in trained)
    rows = []
    for name in trained:
        theirs, own = hypervolumes({"rules": rules, name: by_policy[name]}, reference)
        ahead = own.difference
        difference = f"{ahead.mean:+.4f} [{ahead.low:+.4f}, {ahead.high:+.4f}]"
        rows.append([name, f"{own.hypervolume.mean:.4f}", difference])
    rows.append(["all rules together", f"{theirs.hypervolume.mean:.4f}", ""])
    columns = (f"hypervolume up to {reference[0]:g} m, {reference[1]:g} mJ", "m mJ", "ahead of all rules together")
    return markdown_table(columns, rows)


if __name__ == "__main__":
    sys.exit(main())
