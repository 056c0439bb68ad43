"""Every kernel of the shipped scenarios and policies compiled beforehand, by playing a little of everything."""

from __future__ import annotations

import multiprocessing
import os
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import suppress
from typing import TYPE_CHECKING, Any, NamedTuple

from wsn_env.compiled import store
from wsn_env.evaluation.progress import Progress

if TYPE_CHECKING:
    from wsn_env.envs.observations import ObservationName
    from wsn_env.models.measurement.base import Order
    from wsn_env.scenario import Scenario


class Job(NamedTuple):
    """Kernels of one scenario; of two with the same kinds one will do."""

    scenario: str
    trackers: tuple[str, ...]  # beside the scenario's own
    fast: bool = False


SMALL: dict[str, Any] = {"particles": 20, "periods": 4}
JOBS = (  # the longest first
    Job("PreDC-v0", ("ekf", "ukf"), fast=True),
    Job("Rssi-v0", ("ekf", "ukf", "ickf", "nonlinear_ls")),
    Job("Underwater-v0", ("ekf", "ukf")),
    Job("Binary-v0", ("boundary",)),
    Job("Ble-v0", ()),
    Job("Anchors-v0", ()),
    Job("Lifetime-v0", ()),
)


def compile_everything(progress: Progress | None = None) -> int:
    """Compile and keep all kernels, in a process for each core.

    Args:
        progress: called as progress(done, total, what).

    Returns: how many were compiled; the others were there.
    """
    count = 0
    context = multiprocessing.get_context("spawn")
    workers = min(len(JOBS), len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1)
    with ProcessPoolExecutor(workers, mp_context=context) as pool:
        waiting = [pool.submit(compile_job, job) for job in JOBS]
        for done, each in enumerate(as_completed(waiting)):
            count += each.result()
            if progress is not None:
                progress(done + 1, len(JOBS), "compiling")
    return count


def compile_job(job: Job) -> int:
    """Play what a job names; returns how many kernels were compiled for it.

    All jobs but the first begin at the other end: what they share is there when they get to it.
    """
    before = len(store.compiled)
    parts = _step_environments, _roll_out, _act, _track
    for play in parts if job == JOBS[0] else reversed(parts):
        play(job)
    return len(store.compiled) - before


def _step_environments(job: Job) -> None:
    from wsn_env.envs.env import ClusterEnv

    interfaces: tuple[tuple[Order, ObservationName], ...] = (("nearest", "candidates"), ("information", "menu"))
    for order, observation in interfaces:
        for fast in (False, True) if job.fast else (False,):
            pictures: dict[str, Any] = {"render_mode": "rgb_array", "frame_px": 64}
            env = ClusterEnv(job.scenario, order=order, observation=observation, fast=fast, **pictures, **SMALL)
            env.reset(seed=0)
            env.step(10)
            env.render()


def _roll_out(job: Job) -> None:
    from wsn_env.evaluation.policies import make_policy
    from wsn_env.evaluation.rollout import episodes, rollout
    from wsn_env.simulation.view import View
    from wsn_env.simulation.world import World

    scenario = _scenario_of(job)
    searching = scenario if scenario.measurement.lasting_errors else scenario.override(start="search")
    for state, _ in episodes(make_policy("nearest2", searching), World(searching), [0]):
        View.from_arrays(View.of(state).as_arrays())
    rollout(make_policy("nearest2", scenario), World(scenario), [0])  # with its bound


def _act(job: Job) -> None:
    from wsn_env.evaluation.policies import make_policy, policy_names
    from wsn_env.simulation.view import View
    from wsn_env.simulation.world import World

    scenario = _scenario_of(job)
    for name in policy_names():
        with suppress(ValueError):  # no network for this scenario, or a planner that cannot plan in it
            make_policy(name, scenario).act(View.of(World(scenario).reset([0])))


def _track(job: Job) -> None:
    from wsn_env.evaluation.policies import make_policy
    from wsn_env.evaluation.rollout import episodes
    from wsn_env.simulation.world import World

    for tracker in job.trackers:
        kept: dict[str, Any] = {"silent_information": False, "resampling": "systematic"}
        scenario = _scenario_of(job).override(tracker=tracker, **kept)
        for _ in episodes(make_policy("nearest2", scenario), World(scenario), [0]):
            pass


def _scenario_of(job: Job) -> Scenario:
    from wsn_env.scenario import Scenario

    return Scenario.named(job.scenario, **SMALL)
