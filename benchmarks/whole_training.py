"""A whole training with what a user would pick instead: stable-baselines3's PPO with the same settings in wsn_env's
native batch, in a JAX environment mapped over its rows, in a textbook's Gymnasium environment, and in the same with
Stone Soup's filter; the last two in a process a core.

    python -m benchmarks.whole_training [--rounds N] [--short] [--json FILE]

First the episodes of all have to agree, within standard errors. Then each has turns of a rollout and its update, on
the wall clock with all cores.
"""

import importlib.util
import time
from collections.abc import Callable
from functools import partial

import numpy as np
from rich.console import Console
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import SubprocVecEnv, VecEnv

from benchmarks.environment import FURTHER, Episodes, check_episodes, naive_episodes
from benchmarks.environments.sb3 import JaxVecEnv, TextbookEnv
from benchmarks.filters.textbook import ParticleFilter
from benchmarks.race import Options, Result, Table, Times, figure, interleave, main
from benchmarks.vector import FIXED, ID
from wsn_env.compiled.kernels import available_threads
from wsn_env.envs.vector_env import ClusterVectorEnv
from wsn_env.learning.sb3 import SB3VecEnv
from wsn_env.scenario import Scenario

PARTICLES = (500, 5000)
ROWS = 64  # of a batch
ROLLOUT, SHORT_ROLLOUT = 4096, 256  # periods over all rows
PASSES, MINIBATCH = 4, 1024
PERIODS = 1_500_000  # of the training whose time is told
ROUNDS = 3  # at most
COMPARED = {"episodes": 24, "particles": 1000}
NATIVE, JAX, TEXTBOOK, STONE_SOUP = "wsn_env, native batch", "JAX, vmap", "textbook, NumPy", "textbook, Stone Soup"
PACKAGES = {JAX: "jax", STONE_SOUP: "stonesoup"}


def measure(options: Options, console: Console) -> Result:
    """Check, then race for both numbers of particles."""
    missing = [name for name, package in PACKAGES.items() if importlib.util.find_spec(package) is None]
    racing = [name for name in (NATIVE, JAX, TEXTBOOK, STONE_SOUP) if name not in missing]
    for name in racing:
        if name != NATIVE:
            check_episodes(name, episodes_of(name, **COMPARED), console)
    result = Result(
        name="whole_training",
        title="A whole training",
        text=f"stable-baselines3's PPO with its own network, rollouts of {ROLLOUT:,} periods and {PASSES} passes in"
        f" minibatches of {MINIBATCH:,}, in environments as users would write them. Batches have {ROWS} rows; of the"
        " textbook's environment there is one in a process a core. A period of a row with all that belongs to it, on"
        f" the wall clock and all cores; and the minutes that {PERIODS / 1e6} million periods take at that rate.",
        skipped={name: f"needs {PACKAGES[name]}" for name in missing},
        packages=["stable-baselines3", "torch", *PACKAGES.values()],
    )
    rollout = SHORT_ROLLOUT if options.short else ROLLOUT
    for particles in PARTICLES[: 1 if options.short else None]:
        console.print(f"trainings, P = {particles}", style="dim")
        models = {name: model_of(name, scenario_of(particles), rollout) for name in racing}
        calls = {name: partial(model.learn, rollout, reset_num_timesteps=False) for name, model in models.items()}
        for call in calls.values():
            call()  # compiles
        few = Options(min(options.rounds, ROUNDS), options.short)
        times = interleave(calls, few, dict.fromkeys(calls, rollout), time.perf_counter, warm=False)
        result.tables.append(table(particles, times))
        result.figures[str(particles)] = times.seconds
        for model in models.values():
            model.env.close()
    return result


def table(particles: int, times: Times) -> Table:
    """A line an implementation."""
    lines = []
    for name in times.seconds:
        low, high = times.spread(name, NATIVE)
        seconds = times.median(name)
        ratio = f"{figure(times.ratio(name, NATIVE))} ({figure(low)}-{figure(high)})"
        lines.append([name, f"{1e6 * seconds:.0f}", figure(PERIODS * seconds / 60), ratio])
    columns = ["environment", "us a period", "minutes", f"time over {NATIVE}'s"]
    return Table(f"PPO, P = {particles:,}", columns, lines)


def scenario_of(particles: int) -> Scenario:
    """As all can play it."""
    return Scenario.named(ID, particles=particles, search=False, **FIXED)


def model_of(name: str, scenario: Scenario, rollout: int) -> PPO:
    """PPO in its environment."""
    envs = ENVIRONMENTS[name](scenario)
    sizes = dict(n_steps=rollout // envs.num_envs, batch_size=min(MINIBATCH, rollout))
    return PPO("MlpPolicy", envs, n_epochs=PASSES, device="cpu", seed=0, **sizes)


def _native(scenario: Scenario) -> VecEnv:
    return SB3VecEnv(ClusterVectorEnv(ROWS, scenario, autoreset_mode="SameStep"))


def _jax(scenario: Scenario) -> VecEnv:
    return JaxVecEnv(scenario, ROWS)


def _textbook(scenario: Scenario, kind: type) -> VecEnv:
    return SubprocVecEnv([partial(TextbookEnv, scenario, kind)] * available_threads())


def _stone_soup(scenario: Scenario) -> VecEnv:
    return _textbook(scenario, _stone_soup_filter())


def _stone_soup_filter() -> type:
    from benchmarks.environments.stone_soup import StoneSoupFilter

    return StoneSoupFilter


ENVIRONMENTS: dict[str, Callable[[Scenario], VecEnv]] = {
    NATIVE: _native,
    JAX: _jax,
    TEXTBOOK: partial(_textbook, kind=ParticleFilter),
    STONE_SOUP: _stone_soup,
}


def episodes_of(name: str, episodes: int, particles: int) -> Episodes:
    """With a head and three further members."""
    if name != JAX:
        return naive_episodes(episodes, particles, ParticleFilter if name == TEXTBOOK else _stone_soup_filter())
    envs = JaxVecEnv(scenario_of(particles), episodes)
    fields, squares, energy, periods, ends = envs.fields, 0.0, 0.0, 0, False
    fields.reset(0)
    while not ends:
        period = fields.step(np.full(episodes, FURTHER))
        squares, energy = squares + period.error_m**2, energy + period.energy_mj
        periods, ends = periods + 1, period.ends
    return Episodes(np.sqrt(squares / periods), energy / periods, particles)


if __name__ == "__main__":
    main(measure, __doc__, one_thread=False)
