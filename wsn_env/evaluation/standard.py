"""The standard benchmark: every scenario at its trade-offs, on 1,000 fixed episodes each, and a score a scenario.

A score is 0 for random choices and 1 for the best policy that was known when the benchmark was made, at each trade-off
of a scenario; it may exceed 1:

    score = mean over lams of (R - R_random) / (R_best - R_random)        R: mean return

`standard.json` holds those returns, by blocks of 50 episodes, so that a policy's are compared with the best's pair by
pair. The aggregate is the interquartile mean over the blocks of all scenarios (Agarwal et al., 2021), its interval a
bootstrap of blocks within each scenario.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import trim_mean

from wsn_env.envs.registration import IDS, STANDARD
from wsn_env.evaluation.comparison import Evaluation, evaluate
from wsn_env.evaluation.intervals import RESAMPLES, Summary
from wsn_env.evaluation.policies import Policy
from wsn_env.evaluation.progress import Progress
from wsn_env.evaluation.rollout import BLOCK, Engine
from wsn_env.models.quantity import suggest
from wsn_env.scenario import Scenario

SEED, EPISODES = 9000, 1000
RANDOM = "random"
SEVERAL: dict[str, Any] = dict(targets=3, association="unknown", clutter=0.1, error_cap_m=10.0)  # of Multi-v0
REFERENCES = Path(__file__).with_name("standard.json")


@dataclass(frozen=True)
class Reference:
    """What scores are measured by, at one trade-off of a scenario."""

    best: str  # the policy
    best_returns: np.ndarray  # (blocks,) means
    random_return: float  # mean

    @property
    def span(self) -> float:
        """From random's mean return to the best's."""
        return float(self.best_returns.mean()) - self.random_return


@dataclass(frozen=True)
class Scores:
    """A policy's, by scenario; of one in which it cannot act there are none."""

    policy: str
    blocks: dict[str, np.ndarray]  # (blocks,) of each scenario, means over the trade-offs

    def of(self, scenario: str) -> Summary:
        """Mean score in a scenario, with a 95 % interval."""
        return Summary.of(self.blocks[scenario])

    def aggregate(self) -> Summary:
        """Interquartile mean over the blocks of all scenarios, with a 95 % interval."""
        table = list(self.blocks.values())
        rng = np.random.default_rng(0)
        found = [
            trim_mean(np.concatenate([row[rng.integers(len(row), size=len(row))] for row in table]), 0.25)
            for _ in range(RESAMPLES)
        ]
        return Summary.around(trim_mean(np.concatenate(table), 0.25), np.array(found))


def standard_scenario(name: str) -> Scenario:
    """A preset as the benchmark plays it. Multi-v0 has three targets in the field of PreDC-v0, whose reports do not say
    of which they are; an error counts as a sensing radius at most.

    Raises:
        ValueError: for an unknown one.
    """
    if name not in STANDARD:
        raise ValueError(f"scenario {name!r} is unknown: {suggest(name, STANDARD)}")
    return Scenario.named(name) if name in IDS else Scenario.named("PreDC-v0", **SEVERAL)


def standard_name(scenario: Scenario) -> str:
    """What the benchmark calls it."""
    return scenario.name if scenario.targets == 1 else STANDARD[-1]


def standard_lams(scenario: Scenario) -> tuple[float, ...]:
    """The trade-offs it is played at [m/mJ]; where energy is scarce it has no price."""
    return (0.0,) if scenario.scarce_energy else scenario.lam_octaves


def play_standard(
    policies: str | Sequence[str] | dict[str, Policy],
    scenario: str,
    episodes: int = EPISODES,
    keep: Path | None = None,
    progress: Progress | None = None,
    engine: Engine | None = None,
) -> Evaluation:
    """Play the benchmark's episodes in one scenario.

    Args:
        policies, keep, progress, engine: as `evaluate`'s.
        scenario: an id.
        episodes: how many of the 1,000: whole blocks of 50.

    Raises:
        ValueError: a policy cannot act there.
    """
    if episodes % BLOCK or not 0 < episodes <= EPISODES:
        raise ValueError(f"episodes = {episodes}: must be a multiple of {BLOCK}, at most {EPISODES}")
    preset = standard_scenario(scenario)
    return evaluate(
        policies, preset, standard_lams(preset), episodes, SEED, keep=keep, progress=progress, engine=engine
    )


def block_returns(evaluation: Evaluation, policy: str, lam: float) -> np.ndarray:
    """(blocks,) mean returns."""
    return evaluation.values(policy, lam, "return").reshape(-1, BLOCK).mean(axis=1)


@cache
def references() -> dict[str, dict[float, Reference]]:
    """What scores are measured by, by scenario and lam."""
    told = json.loads(REFERENCES.read_text(encoding="utf-8"))
    return {
        name: {
            float(lam): Reference(one["best"], np.array(one["best_returns"]), one["random_return"])
            for lam, one in lams.items()
        }
        for name, lams in told.items()
    }


def references_of(evaluation: Evaluation) -> dict[str, Any]:
    """What standard.json says of a scenario, from an evaluation of every policy that is known, random among them."""
    found = {}
    for lam in evaluation.lams:
        best = evaluation.ranked(lam)[0]
        found[f"{lam:g}"] = {
            "best": best,
            "best_returns": [round(float(value), 4) for value in block_returns(evaluation, best, lam)],
            "random_return": round(float(evaluation.values(RANDOM, lam, "return").mean()), 4),
        }
    return found


def block_scores(evaluation: Evaluation, policy: str, known: Mapping[float, Reference] | None = None) -> np.ndarray:
    """(blocks,) a policy's scores in the scenario of an evaluation, means over its trade-offs.

    Args:
        known: what they are measured by; None: what the package has.
    """
    known = references()[standard_name(evaluation.scenario)] if known is None else known
    found = []
    for lam in evaluation.lams:
        own, reference = block_returns(evaluation, policy, lam), known[lam]
        found.append(1.0 + (own - reference.best_returns[: len(own)]) / reference.span)
    return np.mean(found, axis=0)


def scores(evaluations: Sequence[Evaluation]) -> list[Scores]:
    """Of every policy in evaluations of several scenarios."""
    blocks: dict[str, dict[str, np.ndarray]] = {}
    for evaluation in evaluations:
        for policy in evaluation.policies:
            blocks.setdefault(policy, {})[standard_name(evaluation.scenario)] = block_scores(evaluation, policy)
    return [Scores(policy, found) for policy, found in blocks.items()]
