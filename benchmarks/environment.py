"""A vector environment of 64 rows at P = 5000 reaches at least 0.4 times the steps/s of its bare filter kernel (20,000
where that makes 50,000), and at least 60 times those of a naive environment (Python loops over members) whose particle
filter is built as filterpy's book does. With a filter of plain NumPy expressions, the best that one would write by
hand, the naive environment is raced too, without a claim.

    python -m benchmarks.environment [--json FILE]

First it checks that the contestants compute the same, then it times them in turns, in one process and on one thread.
The bare kernel weighs 3 or 4 reports and resamples in every period; the environments resample when they have to.
"""

import argparse
import json
import platform
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path

import gymnasium as gym
import numpy as np
from rich.console import Console
from rich.table import Table

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # for `python benchmarks/environment.py`

from benchmarks.filters.book import BookFilter
from benchmarks.filters.textbook import ParticleFilter
from benchmarks.naive import NaiveEnv
from wsn_env.files import replacing
from wsn_env.scenario import Scenario
from wsn_env.trackers.kernels import filter_rows
from wsn_env.types import State
from wsn_env.world import World

ID = "wsn_env/PreDC-v0"
ROWS = 64
FURTHER = 3  # members beside the head
MENU_ENTRY = 10 + FURTHER  # move the head to the nearest node
AT_LEAST = {"kernel": 0.4, "book": 60.0}  # steps/s of the vector environment over a contestant's
ROUND_S = 0.15  # what a contestant gets in a round


class BareFilter:
    """The rows of a world of which nothing runs but the filter kernel."""

    def __init__(self, scenario: Scenario, rows: int, seed: int = 0):
        self.world = World(scenario, threads=1)
        self.constants = self.world.tracker._constants
        self.keys = np.random.default_rng(seed).integers(2**63, size=rows, dtype=np.uint64)
        self.resampled = np.zeros(rows, bool)
        self.restart()

    def restart(self) -> None:
        """Back to period 0, with the reports of every period to come: 3 of them in even rows, 4 in odd ones."""
        self.state: State = self.world.reset(self.keys)
        self.state.reports.count[:] = 3 + np.arange(self.state.rows) % 2
        truth = self.state.track[:, 1:, None, ::2]
        rows, periods, _, _ = truth.shape
        noise_m = self.world.scenario.measurement.noise_m
        self.values = truth + np.random.default_rng(1).normal(0.0, noise_m, (rows, periods, 4, 2))

    def step(self) -> None:
        """One period of every row."""
        state, belief = self.state, self.state.belief
        state.reports.value[:, :4] = self.values[:, state.period[0]]
        state.period[:] += 1
        told = (belief, state.network, state.reports)
        filter_rows(0, state.rows, self.constants, state.key, state.period.copy(), *told, self.resampled)
        belief.predicted_mean[:] = belief.mean  # about which the next period's sums run


# --- do they compute the same? ------------------------------------------------------------------------------


def filter_difference(kind: type = ParticleFilter, periods: int = 10, rows: int = 4) -> float:
    """Largest difference between the kernel's and a naive filter's mean and covariance [m, m/s and squares].

    Both get the same particles and reports, no process noise and no resampling, so that nothing is random.
    """
    bare = BareFilter(Scenario.named("PreDC-v0", filter_q=0.0, resample_below=0.0), rows)
    naive = _naive_filters(bare, q=0.0, kind=kind)
    largest = 0.0
    for _ in range(periods):
        bare.step()
        for row, (mean, cov) in enumerate(_naive_step(bare, naive)):
            largest = max(largest, np.abs(mean - bare.state.belief.mean[row]).max())
            largest = max(largest, np.abs(cov - bare.state.belief.cov[row]).max())
    return largest


def filter_deviation(periods: int = 20, rows: int = 16) -> float:
    """Root mean square difference of their position estimates, in posterior standard deviations.

    Now with process noise and resampling, which each draws for itself: Monte Carlo errors of order P**-0.5 stay.
    """
    scenario = Scenario.named("PreDC-v0", resample_below=1.0)
    bare = BareFilter(scenario, rows)
    naive = _naive_filters(bare, q=scenario.filter_q)
    squares = []
    for _ in range(periods):
        bare.step()
        for row, (mean, cov) in enumerate(_naive_step(bare, naive)):
            naive[row].resample()
            squares += [(mean[axis] - bare.state.belief.mean[row, axis]) ** 2 / cov[axis, axis] for axis in (0, 2)]
    return float(np.mean(squares)) ** 0.5


def _naive_filters(bare: BareFilter, q: float, kind: type = ParticleFilter) -> list[ParticleFilter]:
    s = bare.world.scenario
    return [
        kind(cloud.T.astype(float), s.period_s, q, s.measurement.noise_m, np.random.default_rng(row))
        for row, cloud in enumerate(bare.state.belief.particles)
    ]


def _naive_step(bare: BareFilter, filters: list[ParticleFilter]):
    """(mean, cov) of each naive filter after the reports that the bare one had last."""
    for row, naive in enumerate(filters):
        naive.predict()
        naive.weigh(bare.state.reports.value[row, : bare.state.reports.count[row]])
        yield naive.estimate()


def episode_differences(naive_episodes: int = 24, rows: int = 96, particles: int = 1000) -> dict[str, float]:
    """Naive minus wsn_env, in standard errors: mean over episodes of the RMS error and of the energy a period.

    Without search, which the naive environment does not know.
    """
    overrides = dict(particles=particles, search=False)
    ours = _vector_episodes(rows, overrides)
    theirs = _naive_episodes(naive_episodes, overrides)
    differences = {}
    for name in ours:
        error = (ours[name].var(ddof=1) / rows + theirs[name].var(ddof=1) / naive_episodes) ** 0.5
        differences[name] = float((theirs[name].mean() - ours[name].mean()) / error)
    return differences


def _vector_episodes(rows: int, overrides: dict) -> dict[str, np.ndarray]:
    envs = gym.make_vec(ID, num_envs=rows, vectorization_mode="vector_entry_point", threads=1, **overrides)
    envs.reset(seed=0)
    energy = np.zeros(rows)
    truncated = np.zeros(rows, bool)
    periods = 0
    while not truncated.all():
        _, _, _, truncated, infos = envs.step(np.full(rows, MENU_ENTRY))
        energy += infos["energy_mj"]
        periods += 1
    return {"rms_m": infos["episode_rms_m"], "energy_mj": energy / periods}


def _naive_episodes(episodes: int, overrides: dict) -> dict[str, np.ndarray]:
    env = NaiveEnv(Scenario.named("PreDC-v0", **overrides))
    rms, energy = np.zeros(episodes), np.zeros(episodes)
    for episode in range(episodes):
        env.reset(seed=episode)
        infos = []
        truncated = False
        while not truncated:
            _, _, _, truncated, info = env.step(FURTHER)
            infos.append(info)
        rms[episode] = np.mean([info["error_m"] ** 2 for info in infos]) ** 0.5
        energy[episode] = np.mean([info["energy_mj"] for info in infos])
    return {"rms_m": rms, "energy_mj": energy}


def agreement(console: Console) -> dict[str, float]:
    """Run the checks and print them; raises if the contestants do not compute the same."""
    found = {
        "filter_difference": max(map(filter_difference, (ParticleFilter, BookFilter))),
        "filter_deviation": filter_deviation(),
    }
    differences = episode_differences()
    found |= {f"{name}_standard_errors": value for name, value in differences.items()}
    console.print(
        f"Same particles, no noise: estimates differ by at most {found['filter_difference']:.1e};"
        f" own noise: by {found['filter_deviation']:.3f} posterior sd.\n"
        f"Episodes: RMS differs by {differences['rms_m']:+.1f} standard errors,"
        f" energy by {differences['energy_mj']:+.1f}."
    )
    within = found["filter_difference"] < 1e-3 and found["filter_deviation"] < 0.1
    if not within or max(map(abs, differences.values())) > 3.0:
        raise SystemExit(f"the contestants do not compute the same: {found}")
    return found


# --- the race -----------------------------------------------------------------------------------------------


def contestants() -> dict[str, tuple[Callable[[], None], int]]:
    """By name: a function, and how many steps of one field a call of it is."""
    envs = gym.make_vec(ID, num_envs=ROWS, vectorization_mode="vector_entry_point", threads=1)
    env, naive, book = gym.make(ID), NaiveEnv(), NaiveEnv(kind=BookFilter)
    bare = BareFilter(Scenario.named("PreDC-v0", resample_below=1.0), ROWS)
    actions = np.full(ROWS, MENU_ENTRY)
    envs.reset(seed=0)
    env.reset(seed=0)
    naive.reset(seed=0)
    book.reset(seed=0)

    def step_single():
        if env.step(MENU_ENTRY)[3]:
            env.reset()

    def step_bare():
        if bare.state.period[0] == bare.world.scenario.periods:
            bare.restart()
        bare.step()

    def step_naive(env):
        if env.step(FURTHER)[3]:
            env.reset(seed=int(env.rng.integers(2**31)))

    return {
        "vector": (lambda: envs.step(actions), ROWS),
        "single": (step_single, 1),
        "kernel": (step_bare, ROWS),
        "naive": (lambda: step_naive(naive), 1),
        "book": (lambda: step_naive(book), 1),
    }


def race(rounds: int) -> dict[str, float]:
    """Median over rounds of the CPU seconds a step, by contestant; every contestant has a turn in every round."""
    field = contestants()
    calls = {name: max(1, round(ROUND_S / _seconds(call, 10))) for name, (call, _) in field.items()}
    times: dict[str, list[float]] = {name: [] for name in field}
    for _ in range(rounds):
        for name, (call, steps) in field.items():
            times[name].append(_seconds(call, calls[name]) / steps)
    return {name: statistics.median(values) for name, values in times.items()}


def _seconds(call: Callable[[], None], times: int) -> float:
    """CPU seconds of a call, on average."""
    start = time.process_time()
    for _ in range(times):
        call()
    return (time.process_time() - start) / times


LABELS = {
    "vector": f"vector environment, {ROWS} rows",
    "single": "single environment (gym.make)",
    "kernel": f"bare filter kernel, {ROWS} rows",
    "naive": "naive environment, NumPy filter",
    "book": "naive environment, book's filter",
}


def show(seconds: dict[str, float], console: Console) -> dict[str, float]:
    """Print the table and the claim. Returns the ratios, the vector environment's steps/s over each contestant's."""
    ratios = {name: seconds[name] / seconds["vector"] for name in seconds}
    table = Table(title=f"{ID}, P = {Scenario.named(ID).tracking.particles}, one thread")
    for heading in ("contestant", "us/step", "steps/s", "vector / it", "claimed"):
        table.add_column(heading, justify="left" if heading == "contestant" else "right")
    for name, value in seconds.items():
        claimed = f">= {AT_LEAST[name]:g}" if name in AT_LEAST else ""
        table.add_row(LABELS[name], f"{1e6 * value:.1f}", f"{1 / value:,.0f}", f"{ratios[name]:.2f}", claimed)
    console.print(table)
    for name, least in AT_LEAST.items():
        verdict = "holds" if ratios[name] >= least else "FAILS"
        console.print(f"vector / {name} = {ratios[name]:.2f}, claimed at least {least:g}: {verdict}")
    return ratios


def main() -> None:
    """Check, race, show, save."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=25, help="turns of each contestant")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    arguments = parser.parse_args()
    console = Console()
    checks = agreement(console)
    seconds = race(arguments.rounds)
    ratios = show(seconds, console)
    if arguments.json:
        machine = {"python": platform.python_version(), "numpy": np.__version__, "processor": platform.machine()}
        figures = {"seconds_per_step": seconds, "vector_over": ratios, "claimed": AT_LEAST, "agreement": checks}
        with replacing(arguments.json) as path:
            path.write_text(json.dumps(figures | {"machine": machine}, indent=2))


if __name__ == "__main__":
    main()
