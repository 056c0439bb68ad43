"""Several targets in one field: policies that act a target at a time, and what sharing nodes and batteries costs.

    python -m studies.targets --out out/targets

The pretrained policy, which has been trained with one target, beside baselines, for one to five targets: `return.md`.
With batteries that run empty, the same for 2, 3 and 5: `lifetime.md`. Where being awake costs energy, so that targets
that meet can share it: `sharing.md`.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tyro

from studies.seeds import format_advantage
from studies.tables import Measured
from wsn_env import Scenario, evaluate, make_policy
from wsn_env.evaluation.comparison import Evaluation
from wsn_env.evaluation.files import replacing
from wsn_env.evaluation.progress import progress_bar
from wsn_env.reports.markdown import markdown_table

LAMS = (1.0, 4.0, 16.0)
TARGETS = (1, 2, 3, 5)
BASELINES = ("greedy", "adaptive", "pre_dc")
SIZES = range(7)
JOINTLY, ALONE, SENSING_NJ = "greedy", "greedy:jointly=false", 100_000.0  # nJ of being awake: as a report of 512 bits
LASTING = ("greedy", "nearest1", "pre_dc")  # in the second table, beside ppo and a budget for greedy


@dataclass
class Targets:
    """How many episodes."""

    episodes: int = 300
    """Of each cell."""
    particles: int = 1000
    """Of each target."""
    out: Path = Path("out/targets")
    """Folder."""


def main(arguments: list[str] | None = None) -> int:
    """Play, print and write the tables."""
    asked = tyro.cli(Targets, args=arguments, description=__doc__)
    asked.out.mkdir(parents=True, exist_ok=True)
    for name, make in (("return", returns), ("lifetime", lifetimes), ("sharing", sharing)):
        table = make(asked)
        with replacing(asked.out / f"{name}.md") as path:
            path.write_text(table, encoding="utf-8")
        print(table)
    return 0


def returns(asked: Targets) -> str:
    """Mean return of the joint episode, and by how many percent PPO is better."""
    rows = []
    names = ["ppo", *BASELINES, *(f"nearest{size}" for size in SIZES)]
    for targets in TARGETS:
        scenario = Scenario.named("PreDC-v0", targets=targets, particles=asked.particles)
        with progress_bar() as report:
            found = evaluate(names, scenario, LAMS, asked.episodes, progress=report)
        own = [own_return(found, "ppo", lam) for lam in LAMS]
        rows.append([f"{targets}: **`ppo`**", *own])
        for name in BASELINES:
            rows.append([f"{targets}: `{name}`", *(cell(found, name, lam) for lam in LAMS)])
        best = [found.best_of("nearest", lam) for lam in LAMS]
        rows.append(
            [
                f"{targets}: `nearest0..6`, the best at each lam",
                *(cell(found, one, lam) for one, lam in zip(best, LAMS)),
            ]
        )
    return markdown_table(["targets: policy", *(f"lam = {lam:g}" for lam in LAMS)], rows)


def cell(found: Evaluation, name: str, lam: float) -> str:
    """A baseline's return, and what PPO is better by."""
    return f"{own_return(found, name, lam)}: {format_advantage(found, ['ppo'], name, lam)}"


def lifetimes(asked: Targets) -> str:
    """Mean error where batteries run empty: a target more is a load more."""
    rows = []
    for targets in TARGETS[1:]:
        scenario = Scenario.named("Lifetime-v0", targets=targets, particles=min(asked.particles, 500))
        policies = {name: make_policy(name, scenario) for name in ("ppo", *LASTING)}
        policies["budget"] = make_policy("budget", scenario)
        with progress_bar() as report:
            found = evaluate(policies, scenario, 0.0, max(asked.episodes // 6, 2), progress=report)
        for name in policies:
            columns = ("error_m", "first_death", "half_dead", "functional", "tracked")
            cells = [str(Measured.mean(found.values(name, 0.0, column))) for column in columns]
            rows.append([f"{targets}: `{name}`", *cells])
    names = ("capped error m", "first death", "half dead", "functional", "tracked")
    return markdown_table(["targets: policy", *names], rows)


def sharing(asked: Targets) -> str:
    """Greedy choices of all targets together and each alone, and PPO: returns, and by how many percent together is
    better."""
    rows = []
    for targets, motion in ((3, "meeting"), (5, "meeting"), (5, "crossing")):
        more: dict[str, Any] = dict(targets=targets, motion=motion, sensing_nj=SENSING_NJ, particles=asked.particles)
        scenario = Scenario.named("PreDC-v0", **more)
        with progress_bar() as report:
            found = evaluate([JOINTLY, ALONE, "ppo"], scenario, LAMS, asked.episodes, seed=1, progress=report)
        rows.append([f"{targets}, {motion}: **`{JOINTLY}`**", *(own_return(found, JOINTLY, lam) for lam in LAMS)])
        for name in (ALONE, "ppo"):
            cells = (f"{own_return(found, name, lam)}: {format_advantage(found, [JOINTLY], name, lam)}" for lam in LAMS)
            rows.append([f"{targets}, {motion}: `{name}`", *cells])
    return markdown_table(["targets, motion: policy", *(f"lam = {lam:g}" for lam in LAMS)], rows)


def own_return(found: Evaluation, name: str, lam: float) -> str:
    """A policy's mean, with its standard error."""
    return str(Measured.mean(found.values(name, lam, "return")))


if __name__ == "__main__":
    sys.exit(main())
