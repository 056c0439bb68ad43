"""python -m studies.tuning: find the hand-written rules' parameters anew, on episodes that no comparison uses.

Name the lams that suit a scenario: `--scenario Binary-v0 --lams 0.833 1.67 3.33 6.67 13.3 26.7`. Distances are tried
as shares of the sensing radius. What is best for each lam goes to agents/tuned.json. Every policy that is tried plays
once for all lams. Some minutes for each scenario.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import tyro

from wsn_env.agents.adaptive import RULES, Adaptive, Switch
from wsn_env.agents.greedy import Greedy, Terms
from wsn_env.agents.nearest import ORDERS, Nearest
from wsn_env.agents.tuned import TABLE
from wsn_env.evaluation.files import check_replaceable, replacing
from wsn_env.evaluation.policies import Policy
from wsn_env.evaluation.progress import Progress, progress_bar
from wsn_env.evaluation.rollout import BLOCK, evaluation_seeds, rollout
from wsn_env.scenario import Scenario
from wsn_env.simulation.world import World

LAMS = [0.3, 0.5, 1.0, 2.0, 4.0, 8.0, 10.0, 16.0, 30.0]
MEMBERS = range(9)
HYSTERESES = (0.0, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95)  # sensing radii
SIZES = ((0, 1), (0, 2), (0, 4), (1, 3), (1, 5), (2, 4), (2, 6), (3, 5), (4, 6))  # few, many
SPREADS = (0.08, 0.1, 0.13, 0.17, 0.22, 0.28, 0.36)  # sensing radii
PRICE_STEP = 0.75  # octaves, from a quarter of the least lam to the largest
SERVICES = (1.5, 2.0, 3.0, 5.0, 8.0)


@dataclass
class Tuning:
    """Tune the hand-written rules; what is found replaces what the table says of the scenarios named."""

    scenario: list[str] = field(default_factory=lambda: ["PreDC-v0", "Rssi-v0"])
    """Scenario ids."""
    lams: list[float] = field(default_factory=lambda: LAMS)
    """Trade-offs between error and energy to tune for [m/mJ]."""
    episodes: int = 200
    """Episodes for every parameter that is tried."""
    seed: int = 9000
    """Which episodes, as of `wsn evaluate`; comparisons should use another."""
    out: Path = TABLE
    """The table."""


class Trials:
    """Mean costs of policies on the same episodes, each played once."""

    def __init__(self, scenario: Scenario, lams: Sequence[float], episodes: int, seed: int, progress: Progress):
        self.scenario, self.lams = scenario, np.array(lams)
        self._seeds = evaluation_seeds(seed, episodes)
        self._costs: dict[str, np.ndarray] = {}
        self._progress = progress

    def costs(self, what: str, policies: Sequence[Policy], played_at: Sequence[float] | None = None) -> np.ndarray:
        """(policies, lams) mean of error + lam * energy in a period [m].

        Args:
            what: for the progress bar.
            played_at: the lam that each policy sees, whatever it is compared at; None: the first.
        """
        played_lams = [self.lams[0]] * len(policies) if played_at is None else played_at
        rows = []
        for done, (policy, lam) in enumerate(zip(policies, played_lams, strict=True)):
            rows.append(self._play_once(policy, float(lam)))
            self._progress(done + 1, len(policies), f"{self.scenario.name}, {what}")
        return np.array(rows)

    def _play_once(self, policy: Policy, lam: float) -> np.ndarray:
        key = f"{policy!r} {lam}"
        if key not in self._costs:
            world = World(self.scenario.override(lam=lam), threads=1)
            blocks = [self._seeds[i : i + BLOCK] for i in range(0, len(self._seeds), BLOCK)]
            played = [episode for block in blocks for episode in rollout(policy, world, block)]
            error, energy = (np.mean([episode[name] for episode in played]) for name in ("error_m", "energy_mj"))
            self._costs[key] = error + self.lams * energy
        return self._costs[key]


def tune(trials: Trials) -> dict[str, Any]:
    """What the table says of a scenario."""
    found: dict[str, Any] = {}
    for order in ORDERS:
        found[order] = tune_fixed(trials, order)
        found[RULES[order]] = tune_adaptive(trials, order, found[order])
    return found | {"greedy": tune_greedy(trials)}


def tune_fixed(trials: Trials, order: str) -> dict[str, float]:
    """The hysteresis [m] of each size: the best on average over the lams that the size is best for in hindsight, or at
    the lam where it comes closest to that."""
    hystereses_m = [round(share * trials.scenario.radius_m, 3) for share in HYSTERESES]
    policies = [Nearest(trials.scenario, n, h, order) for n in MEMBERS for h in hystereses_m]
    costs = trials.costs(f"order {order}", policies).reshape(len(MEMBERS), len(hystereses_m), -1)
    relative = costs / costs.min(axis=(0, 1))
    found = {}
    for n, own in zip(MEMBERS, relative):
        least = own.min(axis=0)
        serves = least <= max(1.0, least.min())
        found[str(n)] = hystereses_m[own[:, serves].mean(axis=1).argmin()]
    return found


def tune_adaptive(trials: Trials, order: str, hysteresis_m: dict[str, float]) -> list[Switch]:
    """A switch for each lam: sizes and spread with the hysteresis of the small size, then the hysteresis. A size that
    never changes is tried, too."""
    radius_m = trials.scenario.radius_m
    pairs = [(few, many, round(share * radius_m, 3)) for few, many in SIZES for share in SPREADS]
    pairs += [(n, n, radius_m) for n in MEMBERS]
    switches = [Switch(0.0, *pair, hysteresis_m[str(pair[0])]) for pair in pairs]

    def best(switches: list[Switch]) -> list[Switch]:
        policies = [Adaptive(trials.scenario, order, (switch,)) for switch in switches]
        return [switches[i] for i in trials.costs(RULES[order], policies).argmin(axis=0)]

    others = [round(share * radius_m, 3) for share in HYSTERESES]
    finer = [switch._replace(hysteresis_m=h) for switch in dict.fromkeys(best(switches)) for h in others]
    return [switch._replace(lam=lam) for switch, lam in zip(best(finer), trials.lams.tolist())]


def tune_greedy(trials: Trials) -> list[Terms]:
    """Terms for each lam. Choices depend on lam / worth [m/mJ] alone, so one play at that price serves all lams."""
    least, most = trials.lams[[0, -1]]
    prices = 0.25 * least * 2.0 ** np.arange(0.0, np.log2(4.0 * most / least) + 1e-9, PRICE_STEP)
    tried = [(price, service) for price in prices.tolist() for service in SERVICES]
    policies = [Greedy(trials.scenario, (Terms(1.0, 1.0, service),)) for _, service in tried]
    best = trials.costs("greedy", policies, [price for price, _ in tried]).argmin(axis=0)
    lams = trials.lams.tolist()
    return [Terms(lam, round(lam / tried[i][0], 4), tried[i][1]) for lam, i in zip(lams, best)]


def main(arguments: list[str] | None = None) -> None:
    """Tune and write the table."""
    settings = tyro.cli(Tuning, description=__doc__, args=arguments)
    settings.out.parent.mkdir(parents=True, exist_ok=True)
    check_replaceable(settings.out)
    table = json.loads(settings.out.read_text(encoding="utf-8")) if settings.out.exists() else {"scenarios": {}}
    for name in settings.scenario:
        scenario = Scenario.named(name)
        with progress_bar() as report:
            found = tune(Trials(scenario, sorted(settings.lams), settings.episodes, settings.seed, report))
        how = {"lams": sorted(settings.lams), "episodes": settings.episodes, "seed": settings.seed}
        table["scenarios"][scenario.name] = {"tuned_on": how} | found
        with replacing(settings.out) as path:
            path.write_text(json.dumps(table, indent=1) + "\n", encoding="utf-8")
        print(f"{scenario.name}: written to {settings.out}")


if __name__ == "__main__":
    main()
