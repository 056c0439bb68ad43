"""What looking ahead is worth: the planner and tree search beside the fixed clusters, and what a decision costs.

python -m studies.planning --scenario Rssi-v0 --episodes 200
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path

import tyro

from wsn_env.agents.mcts import Mcts
from wsn_env.agents.planner import Planner
from wsn_env.agents.ppo import PRETRAINED
from wsn_env.evaluation.comparison import Evaluation, evaluate
from wsn_env.evaluation.files import replacing
from wsn_env.evaluation.intervals import Measured
from wsn_env.evaluation.policies import Policy, make_policy
from wsn_env.evaluation.progress import progress_bar
from wsn_env.models.state import Cluster
from wsn_env.reports.markdown import markdown_table
from wsn_env.reports.tables import print_tables
from wsn_env.scenario import Scenario
from wsn_env.simulation.view import View
from wsn_env.simulation.world import World


class Timed:
    """A policy with a stopwatch."""

    def __init__(self, policy: Policy):
        self.policy = policy
        self.sees_lam = getattr(policy, "sees_lam", True)
        self.seconds, self.decisions = 0.0, 0

    def act(self, view: View) -> Cluster:
        """What the policy chooses; its processor time counts, other programs' does not."""
        started = time.process_time()
        cluster = self.policy.act(view)
        self.seconds += time.process_time() - started
        self.decisions += len(view.row)
        return cluster


@dataclass
class Comparison:
    """The planner against fixed clusters on common random episodes, and what a decision costs."""

    scenario: str = "PreDC-v0"
    """Scenario id."""
    lam: float | None = None
    """Trade-off between error and energy [m/mJ]; left out: the scenario's."""
    episodes: int = 200
    """Episodes for each policy."""
    seed: int = 0
    """Which episodes, as of `wsn evaluate`."""
    against: list[str] = field(
        default_factory=lambda: [f"{stem}{n}" for stem in ("nearest", "informed") for n in range(9)]
    )
    """Policies by name."""
    horizon: int = Planner.horizon
    """Periods that the planner looks ahead."""
    worlds: int = Planner.worlds
    """Worlds that it imagines for each choice."""
    out: Path = Path("out/planning")
    """Folder for planning.md."""


def main(arguments: list[str] | None = None) -> None:
    """Compare and print."""
    settings = tyro.cli(Comparison, args=arguments)
    scenario = Scenario.named(settings.scenario, **({} if settings.lam is None else {"lam": settings.lam}))
    ahead: dict[str, Policy] = {
        "planner": Planner(scenario, settings.horizon, settings.worlds),
        "mcts": Mcts(scenario, settings.horizon, min(settings.worlds, Mcts.worlds)),
    }
    for policy in ahead.values():
        policy.act(View.of(World(scenario).reset([0])))  # compiles and rehearses
    shipped = ["ppo"] * (PRETRAINED / scenario.name).is_dir()
    names = list(dict.fromkeys([*shipped, *settings.against]))
    policies = ahead | {name: make_policy(name, scenario) for name in names}
    timed = {name: Timed(policy) for name, policy in policies.items()}
    with progress_bar() as report:
        found = evaluate(timed, scenario, None, settings.episodes, settings.seed, progress=report, threads=1)
    print_tables(found)
    (lam,) = found.lams
    rival = max(settings.against, key=lambda name: found.values(name, lam, "return").mean())
    text = table(found, lam, [*ahead, *shipped, rival], timed)
    print(text)
    settings.out.mkdir(parents=True, exist_ok=True)
    with replacing(settings.out / "planning.md") as path:
        path.write_text(text, encoding="utf-8")


def table(found: Evaluation, lam: float, names: list[str], timed: dict[str, Timed]) -> str:
    """Return of each, what the planner is ahead of it in percent, and what a decision costs."""
    rows = []
    for name in names:
        own = found.values(name, lam, "return")
        gain, share = found.difference("planner", name, lam), -100 / own.mean()
        ahead = f"{share * gain.mean:+.1f} [{share * gain.low:+.1f}, {share * gain.high:+.1f}] %"
        cost = f"{1e3 * timed[name].seconds / timed[name].decisions:.2g} ms"
        rows.append([name, str(Measured.mean(own)), "" if name == "planner" else ahead, cost])
    columns = (f"{found.scenario.name}, lam = {lam:g}", "return", "planner ahead of it", "a decision, one core")
    return markdown_table(columns, rows)


if __name__ == "__main__":
    main()
