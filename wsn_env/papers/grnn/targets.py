"""Many targets at once (in the place of Fig. 10): 500 to 5,000, each an environment of a batch of its own.

Every target starts about the field's middle and moves by the law that the filters suppose, so that no two of them go
the same way. The time is the processor's for the whole world on one thread, the anchors' hearing included.
"""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np

from wsn_env.evaluation.intervals import standard_error
from wsn_env.evaluation.policies import make_policy
from wsn_env.evaluation.rollout import FIRST_SEED, episodes
from wsn_env.models.motion.free import Free
from wsn_env.papers.grnn.systems import DENSITY, METHODS, scenario_as_read
from wsn_env.papers.sheet import Sheet
from wsn_env.simulation.world import World

TARGETS = (500, 1000, 2000, 5000)
PERIOD_S, PERIODS = 0.5, 5
CROWD_METHODS = ("grnn_kf", "ickf")


def many_targets(counts: Sequence[int] = TARGETS) -> Sheet:
    """Mean error over the periods, and the time that a target takes, as a share of that among the fewest."""
    columns: list[str] = ["targets"]
    cells: list[list[float]] = []
    for method in CROWD_METHODS:
        name = METHODS[method]
        columns += [f"{name}: mean error m", "stderr_m", f"{name}: time a target"]
        errors, seconds = zip(*(follow(method, count) for count in counts), strict=True)
        shares = [s / n / (seconds[0] / counts[0]) for s, n in zip(seconds, counts, strict=True)]
        cells += [[float(e.mean()) for e in errors], [standard_error(e) for e in errors], shares]
    return Sheet(tuple(columns), [(count, *row) for count, row in zip(counts, zip(*cells, strict=True), strict=True)])


def follow(method: str, targets: int) -> tuple[np.ndarray, float]:
    """Mean error of each target (targets,) [m], and the seconds of a processor that all of them took."""
    motion = Free(spread_m=30.0, speed_ms=7.0, acceleration_ms2=(DENSITY / PERIOD_S) ** 0.5)
    scenario = scenario_as_read(method, PERIOD_S, motion=motion, periods=PERIODS)
    world, policy = World(scenario, threads=1), make_policy("all", scenario)
    for _ in episodes(policy, world, [FIRST_SEED]):  # whatever is compiled or trained at first is not counted
        pass
    total, begun = np.zeros(targets), time.thread_time()
    for _, outcome in episodes(policy, world, [FIRST_SEED + i for i in range(targets)]):
        total += outcome.error_m
    return total / PERIODS, time.thread_time() - begun
