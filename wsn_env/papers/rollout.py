"""A trial: a policy plays fixed seeds in a scenario, and every period is kept.

Run i has the key of seed FIRST_SEED + i in every trial, whatever the system: systems meet common random numbers, so
that their differences are paired. The seeds are those of an evaluation with seed 0; training never uses them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import pairwise
from math import ceil

import numpy as np

from wsn_env.evaluation.intervals import Measured, standard_error
from wsn_env.evaluation.policies import Policy, make_policy
from wsn_env.evaluation.progress import Progress
from wsn_env.evaluation.rollout import BLOCK, FIRST_SEED, episodes
from wsn_env.models.state import PURPOSES
from wsn_env.scenario import Scenario
from wsn_env.simulation.world import World

REPORT = PURPOSES.index("report")
SIGNIFICANT = 2.0  # standard errors


@dataclass(frozen=True)
class Trial:
    """What to play: a policy by name with its parameters, in a scenario."""

    policy: str
    scenario: Scenario
    runs: int
    parameters: tuple[tuple[str, float], ...] = ()

    @property
    def steps(self) -> int:
        """Simulated periods of blocks, the unit of progress."""
        return ceil(self.runs / BLOCK) * self.scenario.periods


@dataclass(frozen=True, eq=False)
class Record:
    """What happened; R runs, K periods."""

    target_m: np.ndarray  # (R, K, 2)
    estimate_m: np.ndarray  # (R, K, 2) after the period's correction
    energy_mj: np.ndarray  # (R, K)
    purposes_mj: np.ndarray  # (R, K, 6) the same by PURPOSES
    detections: np.ndarray  # (R, K) nodes that had something to report
    delivered: np.ndarray  # (R, K) reports that the head had
    handover: np.ndarray  # (R, K) bool
    alive: np.ndarray  # (R, K) living nodes after the period

    @property
    def report_mj(self) -> np.ndarray:
        """(R, K) the part of the energy that reports took."""
        return self.purposes_mj[:, :, REPORT]

    @property
    def heard(self) -> np.ndarray:
        """(R, K) bool: the head had a report."""
        return self.delivered > 0

    @property
    def offset_m(self) -> np.ndarray:
        """(R, K, 2) estimate minus target."""
        return self.estimate_m - self.target_m

    def square_error(self, heard_only: bool = False) -> np.ndarray:
        """(R, K) m^2; NaN in periods without a report where these are left out."""
        square = (self.offset_m**2).sum(axis=2)
        return np.where(self.heard, square, np.nan) if heard_only else square

    def rms_m(self, heard_only: bool = False) -> np.ndarray:
        """(R,) root of the mean square error of each run (eq. 17 of Xiang & Guo, 2013)."""
        return np.sqrt(np.nanmean(self.square_error(heard_only), axis=1))

    def axis_rms_m(self, axis: int) -> np.ndarray:
        """(R,) the same along x (0) or y (1) alone."""
        return np.sqrt((self.offset_m[:, :, axis] ** 2).mean(axis=1))

    def pooled_rms_m(self, axis: int | None = None) -> Measured:
        """Root of the mean square error over all runs and periods, along an axis or both, and its standard error."""
        return pooled_rms(self.square_error() if axis is None else self.offset_m[:, :, axis] ** 2)

    def rms_per_period_m(self, heard_only: bool = False) -> np.ndarray:
        """(K,) root of the mean square error over the runs; NaN where no run counts."""
        square = self.square_error(heard_only)
        counted = np.isfinite(square)
        mean = np.where(counted, square, 0.0).sum(axis=0) / np.maximum(counted.sum(axis=0), 1)
        return np.where(counted.any(axis=0), np.sqrt(mean), np.nan)


def play(trial: Trial, tick: Callable[[], None] = lambda: None) -> Record:
    """Play a trial's runs, in blocks; `tick` is called after every period of a block."""
    world = World(trial.scenario)
    policy = make_policy(trial.policy, trial.scenario, **dict(trial.parameters))
    blocks = [range(start, min(start + BLOCK, trial.runs)) for start in range(0, trial.runs, BLOCK)]
    parts = [_play_block(world, policy, block, tick) for block in blocks]
    return Record(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))


def play_all(trials: Iterable[Trial], progress: Progress) -> dict[Trial, Record]:
    """Play each different trial once; `progress(done, total, what)` is called after every period."""
    trials = list(dict.fromkeys(trials))
    total = sum(trial.steps for trial in trials)
    done = 0
    records = {}
    for trial in trials:
        what = f"{trial.policy}, {trial.scenario.tracking.tracker}, {trial.scenario.field.nodes} nodes"

        def tick(what: str = what) -> None:
            nonlocal done
            done += 1
            progress(done, total, what)

        records[trial] = play(trial, tick)
    return records


def _play_block(world: World, policy: Policy, runs: range, tick: Callable[[], None]) -> tuple[np.ndarray, ...]:
    periods = []
    for _, outcome in episodes(policy, world, [FIRST_SEED + run for run in runs]):
        energy, reports = (outcome.energy_mj, 1e3 * outcome.energy_j), (outcome.detections, outcome.delivered)
        periods.append((outcome.target_m, outcome.estimate_m, *energy, *reports, outcome.handover, outcome.alive))
        tick()
    return tuple(np.stack(arrays, axis=1) for arrays in zip(*periods, strict=True))


def pooled_rms(square: np.ndarray) -> Measured:
    """Root of the mean of squares (R, K), with its standard error over the runs."""
    return Measured.root_mean(square.mean(axis=1))


def exceeds(larger: np.ndarray, smaller: np.ndarray) -> bool:
    """Whether one system's error is larger than another's beyond doubt: paired where the runs are the same."""
    if len(larger) == len(smaller):
        return bool((larger - smaller).mean() > SIGNIFICANT * standard_error(larger - smaller))
    doubt = np.hypot(standard_error(larger), standard_error(smaller))
    return bool(larger.mean() - smaller.mean() > SIGNIFICANT * doubt)


def keeps_falling(errors: list[np.ndarray]) -> bool:
    """Lower at the end than at the start, and on the way never higher than before, beyond doubt."""
    rises = any(exceeds(after, before) for before, after in pairwise(errors))
    return exceeds(errors[0], errors[-1]) and not rises
