"""One trained policy in many worlds, beside the rule that is best in each: tables of docs/learning.md.

    python -m studies.worlds --scenario Rssi-v0 --tracks tracks/*.csv --out out/worlds

Other fields, motions, noises and losses. In each world and at each lam an episode is compared with that of 21 rules
which is best there in the other nine tenths of the episodes: a rule chosen by the very episodes that it is judged by
would seem better than it is, the more so the more rules there are (cross-fitting).
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
import tyro

from wsn_env.evaluation.comparison import Evaluation, evaluate
from wsn_env.evaluation.files import replacing
from wsn_env.evaluation.intervals import Summary
from wsn_env.evaluation.kept_blocks import remove_kept_blocks
from wsn_env.evaluation.policies import make_policy
from wsn_env.evaluation.progress import progress_bar
from wsn_env.learning.worlds import nodes_of, noises
from wsn_env.models.quantity import check_quantity, parse_overrides
from wsn_env.reports.markdown import markdown_table
from wsn_env.scenario import Scenario
from wsn_env.scenario.options import make_scenario

SIZES = [f"{order}{size}" for order in ("nearest", "informed") for size in range(9)]
RULES = ["greedy", "adaptive", "adaptive_informed", *SIZES]
FOLDS = 10
NEAR = -1.0  # percent; a policy that is less than this behind is told as near


@dataclass
class Worlds:
    """Compare one policy with the best rule of each world."""

    scenario: str = "PreDC-v0"
    """Scenario id."""
    policy: str = "ppo"
    """A policy's name, or the path of a policy.json."""
    worlds: list[str] = field(default_factory=list)
    """Each some quantities, as "name=value name=value"; left out: the study's own."""
    tracks: list[Path] = field(default_factory=list)
    """CSV files of recorded motion, one world more (examples/ble_tracks.py makes such)."""
    lam: list[float] = field(default_factory=list)
    """Trade-offs [m/mJ]; left out: the scenario's octaves."""
    particles: int = 1000
    """In every world, or as many as the scenario has where that is fewer."""
    episodes: int = 300
    """Held-out episodes."""
    seed: int = 0
    """Which."""
    out: Path = Path("out/worlds")
    """Folder; a second call continues."""


class Cell(NamedTuple):
    """A policy's lead over the best rule, in percent of its return."""

    lead: Summary
    hindsight: Summary  # over the rule that is best in these very episodes
    rule: str  # that one

    def __str__(self) -> str:
        told = f"{self.lead.mean:+.1f} [{self.lead.low:+.1f}, {self.lead.high:+.1f}]"
        return f"{f'**{told}**' if self.lead.low > 0 else told} {self.rule}"


def main() -> int:
    """Run."""
    asked = tyro.cli(Worlds, description=__doc__)
    check_quantity("Worlds", "episodes", asked.episodes, at_least=2, whole=True)
    usual = make_scenario(asked.scenario, [], [])
    usual = usual.override(particles=min(asked.particles, usual.tracking.particles))
    worlds = {text: text for text in asked.worlds} or worlds_of(usual)
    scenarios = {what: usual.override(**parse_overrides(text.split())) for what, text in worlds.items()}
    if asked.tracks:
        scenarios["recorded motion"] = usual.override(motion="recorded", tracks=tuple(map(str, asked.tracks)))
    lams = asked.lam or usual.lam_octaves
    table: dict[str, list[Cell]] = {}
    folders = [asked.out / f"{asked.scenario}-{i}" for i in range(len(scenarios))]
    for folder, (what, scenario) in zip(folders, scenarios.items()):
        print(f"{len(table) + 1} of {len(scenarios)}: {what}", file=sys.stderr)
        policies = {asked.policy: make_policy(asked.policy, scenario)}
        policies |= {name: make_policy(name, scenario) for name in RULES if name != asked.policy}
        with progress_bar() as report:
            evaluation = evaluate(policies, scenario, lams, asked.episodes, asked.seed, keep=folder, progress=report)
        evaluation.save(folder)
        table[what] = [lead_of(asked.policy, evaluation, lam) for lam in lams]
    columns = "scenario variant", *(f"lam = {lam:g}" for lam in lams)
    text = markdown_table(columns, [[what, *map(str, row)] for what, row in table.items()])
    text += f"\n{count([cell for row in table.values() for cell in row])}\n"
    with replacing(asked.out / f"{usual.name}.md") as path:
        path.write_text(text, encoding="utf-8")
    for folder in folders:
        remove_kept_blocks(folder)
    print(text)
    return 0


def worlds_of(scenario: Scenario) -> dict[str, str]:
    """{what it is: quantities}."""
    worlds = {"unchanged": ""}
    if scenario.field.positions is None:
        for what, share in (("sparse", 0.36), ("dense", 40 / 9)):
            nodes = nodes_of(scenario, share)
            worlds[f"{what}: {nodes} nodes"] = f"nodes={nodes}"
    if scenario.tracking.switches:
        worlds |= {
            "turns of up to 90°": "motion=turns",
            "a circle": "motion=circle",
            "random waypoints": "motion=waypoint",
        }
    for what, factor in (("half", 0.5), ("twice", 2.0)):
        worlds |= {f"{what} the noise, {noise}": noise for noise in noises(scenario, factor)}
    return worlds | {"three packets in ten are lost": "packet_success=0.7"}


def lead_of(policy: str, evaluation: Evaluation, lam: float) -> Cell:
    """Over the rule with the highest mean return."""
    own, rules = evaluation.values(policy, lam, "return"), [name for name in evaluation.ranked(lam) if name != policy]
    returns, episode = np.stack([evaluation.values(rule, lam, "return") for rule in rules]), np.arange(len(own))
    fold = episode % FOLDS
    best = np.array([returns[:, fold != each].mean(axis=1).argmax() for each in range(FOLDS)])  # in the other folds
    leads = [Summary.of(100 * (own - each) / abs(each.mean())) for each in (returns[best[fold], episode], returns[0])]
    return Cell(*leads, rules[0])


def count(cells: list[Cell]) -> str:
    """What the table says, in a line."""
    told = []
    for leads in ([cell.lead for cell in cells], [cell.hindsight for cell in cells]):
        ahead, behind = sum(lead.low > 0 for lead in leads), sum(lead.high < 0 for lead in leads)
        near = sum(lead.mean > NEAR for lead in leads)
        told.append(f"better in {ahead}, worse in {behind}, better or less than {-NEAR:g} % worse in {near}")
    return (
        f"Of {len(cells)} cells: {told[0]} (better and worse: the interval is on one side of 0). Against the baseline"
        f" that is best in the test episodes themselves: {told[1]}."
    )


if __name__ == "__main__":
    sys.exit(main())
