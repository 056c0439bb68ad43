"""What a step of the vector environment (64 rows, P = 5000, one thread) costs beside the particle filter: at most 22 %,
with the observation "menu", which train.py uses.

    python -m benchmarks.overhead [--rounds N] [--short] [--json FILE]

An episode is recorded: what the tracker was given in every period. The filter's time is that of
`ParticleTracker.correct` on the same beliefs with the same reports; that they are the same shows in equal bits of the
belief and equal decisions to resample. The filter's time has a call from Python a period in it, some 4 of 1100 us.
"""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass, field

import gymnasium as gym
import numpy as np
from rich.console import Console

from benchmarks.race import Claim, Options, Result, Table, Times, figure, interleave, main
from benchmarks.stopwatch import Stopwatch
from benchmarks.vector import FIXED, ID, MENU_ENTRY, ROWS
from wsn_env.envs.vector_env import ClusterVectorEnv
from wsn_env.filters.particle import ParticleTracker
from wsn_env.models.state import Belief, Network, Reports

SEED = 0
SHORT = {"periods": 30}
OBSERVATION = "menu"
AT_MOST = 22.0  # % of a step
STEP, FILTER = "step", "filter"
PARTS = ("action", "world", "observation")  # of a step, each timed alone


def measure(options: Options, console: Console, **overrides) -> Result:
    """Record, check, race. The overrides are the scenario's."""
    episode = Episode(**(SHORT if options.short else {}) | overrides)
    console.print(f"replayed filter: same beliefs and decisions in {len(episode.record.corrections)} periods")
    names = (STEP, FILTER, *PARTS)
    calls = {name: (lambda name=name: episode.play(name)) for name in names}
    rows, periods = episode.envs.num_envs, len(episode.record.corrections)
    times = interleave(calls, options, dict.fromkeys(names, rows * periods), clock=episode.watch, turn_s=0.0)
    share = 100 * (1 - times.ratio(FILTER, STEP))
    scenario = episode.envs.scenario
    return Result(
        name="overhead",
        title="What surrounds the filter",
        text=f"{rows} rows, P = {scenario.tracking.particles}, observation {OBSERVATION!r}, one thread: the time of a"
        f" row's step over an episode, without resets, of which {100 * episode.record.searches / rows / periods:.1f} %"
        " of the steps search. The period beside the filter is World.advance less the filter: the target, sensing,"
        " radio, batteries, searches. The rest is checks, reward, info and the loop.",
        claims=[Claim("vector environment: share of a step beside the filter", AT_MOST, share, "%", at_most=True)],
        tables=[table(times)],
        figures={"seconds": times.seconds},
        packages=["gymnasium"],
    )


def table(times: Times) -> Table:
    """Parts of a step, in its order; the remainders by difference within a round."""
    seconds = {name: np.array(values) for name, values in times.seconds.items()}
    step = seconds[STEP]
    parts = {
        "action to cluster": seconds["action"],
        "the period beside the filter": seconds["world"] - seconds[FILTER],
        "the filter": seconds[FILTER],
        "observation": seconds["observation"],
        "the rest": step - sum(seconds[name] for name in PARTS),
        "whole step": step,
    }
    lines = []
    for name, values in parts.items():
        low, middle, high = np.percentile(100 * values / step, (25, 50, 75))
        share = f"{figure(middle)} ({figure(low)}-{figure(high)})"
        lines.append([name, f"{1e6 * float(np.median(values)):.2f}", share])
    return Table("A row's step", ["part", "us", "% of the step (quartiles)"], lines)


# --- the same work again ------------------------------------------------------------------------------------


@dataclass
class Correction:
    """What the tracker was given in a period, and what it decided."""

    periods: np.ndarray
    predicted_mean: np.ndarray
    reports: Reports
    resampled: np.ndarray
    relocated: np.ndarray | None = None  # (B,) rows that a search moved afterwards, and their belief by then
    moved: np.ndarray | None = None


@dataclass
class Record:
    """An episode as a tracker sees it."""

    keys: np.ndarray
    start: Belief
    corrections: list[Correction] = field(default_factory=list)
    network: Network | None = None
    end: Belief | None = None

    @property
    def searches(self) -> int:
        """In all rows."""
        return sum(one.relocated.sum() for one in self.corrections if one.relocated is not None)


class Recorder:
    """A tracker that passes everything on to another one, and writes it down.

    The world runs it in three steps, since it is not the compiled filter: the same bits by other kernels.
    """

    def __init__(self, tracker: ParticleTracker):
        self.tracker, self.particles = tracker, tracker.particles
        self.record: Record | None = None

    def start(self, keys, periods, rows, belief: Belief) -> None:
        """A new record."""
        self.tracker.start(keys, periods, rows, belief)
        self.record = Record(keys.copy(), belief.copy())

    def correct(self, keys, periods, belief: Belief, network: Network, reports: Reports, resampled) -> None:
        """A new period."""
        width = max(1, reports.count.max())
        received = Reports(
            reports.count.copy(),
            reports.node[:, :width].copy(),
            reports.value[:, :width].copy(),
            reports.share,
            reports.bitmap,
        )
        predicted = belief.predicted_mean.copy()
        self.tracker.correct(keys, periods, belief, network, reports, resampled)
        self.record.corrections.append(Correction(periods.copy(), predicted, received, resampled.copy()))
        self.record.network, self.record.end = network, belief

    def relocate(self, keys, periods, rows, belief: Belief) -> None:
        """Belongs to the period's correction."""
        self.record.corrections[-1].relocated = rows.copy()
        self.record.corrections[-1].moved = belief.row.copy()
        self.tracker.relocate(keys, periods, rows, belief)


class Episode:
    """The same episode by the environment, by its pieces, and by the filter alone; `watch` runs for what is asked."""

    def __init__(self, rows: int = ROWS, **overrides):
        self.watch = Stopwatch()
        self.actions = np.full(rows, MENU_ENTRY)
        self.envs = self._environment(rows, overrides)
        recorded = self._environment(rows, overrides)
        recorder = Recorder(recorded.world.tracker)
        recorded.world.tracker = recorder
        self._check_same_episode(recorded)
        self.record = recorder.record
        self.belief = self.record.start.copy()
        self.world = self.envs.world
        self.state = self.world.reset(self.record.keys)
        self._check_same_beliefs()

    def play(self, part: str) -> None:
        """The whole episode once; the watch runs for a part of it only."""
        if part == STEP:
            self._step()
        elif part == FILTER:
            self._filter()
        else:
            self._pieces(part)

    def _environment(self, rows: int, overrides: dict) -> ClusterVectorEnv:
        mode = dict(vectorization_mode="vector_entry_point", autoreset_mode="Disabled", threads=1)
        return gym.make_vec(ID, num_envs=rows, **mode, **(FIXED | overrides), observation=OBSERVATION).unwrapped

    def _step(self) -> None:
        self.envs.reset(seed=SEED)
        for _ in range(self.envs.scenario.periods):
            with self.watch:
                self.envs.step(self.actions)

    def _pieces(self, part: str) -> None:
        """The public pieces in the order of a step."""
        timed = {name: self.watch if name == part else nullcontext() for name in PARTS}
        action, observation = self.envs.interface.action, self.envs.interface.observation
        everywhere = np.ones(len(self.actions), bool)
        self.state, _ = self.world.restart(self.state, everywhere, self.record.keys, donate=True)
        follower = observation.follow(self.state.knowledge)
        view, _ = follower()
        for _ in range(self.envs.scenario.periods):
            with timed["action"]:
                cluster = action.cluster(self.actions, view)
            with timed["world"]:
                self.world.advance(self.state, *cluster)
            with timed["observation"]:
                view, _ = follower()

    def _filter(self) -> list[np.ndarray]:
        """The recorded corrections from the recorded start; returns where it resampled."""
        tracker, record, belief = self.world.tracker, self.record, self.belief
        _assign(belief, record.start)
        decided = []
        for one in record.corrections:
            resampled = np.zeros(len(record.keys), bool)
            belief.row["predicted_mean"] = one.predicted_mean
            with self.watch:
                tracker.correct(record.keys, one.periods, belief, record.network, one.reports, resampled)
            decided.append(resampled)
            if one.relocated is not None:
                for name in ("mean", "cov"):
                    belief.row[name][one.relocated] = one.moved[name][one.relocated]
                tracker.relocate(record.keys, one.periods, one.relocated, belief)
        return decided

    def _check_same_episode(self, recorded: ClusterVectorEnv) -> None:
        """The recorded environment is the one that is timed."""
        same = np.array_equal(self.envs.reset(seed=SEED)[0], recorded.reset(seed=SEED)[0])
        for _ in range(self.envs.scenario.periods):
            timed_step, recorded_step = self.envs.step(self.actions), recorded.step(self.actions)
            same &= all(np.array_equal(timed_step[i], recorded_step[i]) for i in (0, 1))
        if not same:
            raise SystemExit("the recorded episode is another one: nothing to time")

    def _check_same_beliefs(self) -> None:
        """By the world, by the recording, and by the filter alone."""
        self._pieces("nothing")
        decided = self._filter()
        same = all(np.array_equal(a, b.resampled) for a, b in zip(decided, self.record.corrections, strict=True))
        for other in (self.record.end, self.state.belief):
            same &= np.array_equal(self.belief.particles, other.particles)
            same &= np.array_equal(self.belief.log_weights, other.log_weights)
            same &= all(np.array_equal(getattr(self.belief, name), getattr(other, name)) for name in ("mean", "cov"))
        if not same:
            raise SystemExit("the replayed filter computes something else: nothing to compare")


def _assign(belief: Belief, other: Belief) -> None:
    for (_, to), (_, array) in zip(belief.leaves(), other.leaves()):
        to[:] = array


if __name__ == "__main__":
    main(measure, __doc__)
