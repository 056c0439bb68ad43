"""`gym.make("wsn_env/PreDC-v0")` makes at least 100 times the steps/s of a naive environment (Python loops over
members) whose particle filter is built as filterpy's book does.

    python -m benchmarks.environment [--rounds N] [--short] [--json FILE]

Raced without a claim: the vector environment, the bare filter kernel (which weighs 4 reports and resamples in every
period, where the environment weighs what it hears and resamples when it has to), and a naive environment with a filter
of plain NumPy expressions, the best that one would write by hand. First the naive environment has to have the same
episodes as wsn_env's, and its filters the same posterior.
"""

from collections.abc import Callable
from dataclasses import dataclass

import gymnasium as gym
import numpy as np
from rich.console import Console

from benchmarks.environments.naive import NaiveEnv
from benchmarks.filters import Problem, enter
from benchmarks.filters.agreement import STRICT, check_agreement
from benchmarks.filters.book import BookFilter
from benchmarks.filters.textbook import ParticleFilter
from benchmarks.race import Claim, Options, Result, Table, Times, figure, interleave, main
from benchmarks.vector import FIXED, ID
from wsn_env.models.quantity import ScenarioError
from wsn_env.scenario import Scenario

ROWS = 64
FURTHER = 3  # members beside the head
MENU_ENTRY = 10 + FURTHER  # move the head to the nearest node
AT_LEAST = {"single": 100.0, "fast": 100.0}  # steps/s of gym.make's environment over the book's naive one
STANDARD_ERRORS = 3.0  # within which episodes must agree
LABELS = {
    "single": "gym.make",
    "fast": "gym.make with fast=True",
    "vector": f"vector environment, {ROWS} fields",
    "kernel": f"bare filter kernel, {ROWS} rows",
    "naive": "naive environment, NumPy filter",
    "book": "naive environment, book's filter",
}


def measure(options: Options, console: Console) -> Result:
    """Check, then race."""
    agreement, _ = check_agreement(["NumPy f64, textbook", "filterpy's book"], "position", options.short)
    theirs = naive_episodes(*((8, 500) if options.short else (24, 1000)))
    differences = check_episodes("the naive environment", theirs, console)
    field, skipped = implementations()
    times = interleave(
        {name: call for name, (call, _) in field.items()}, options, {name: steps for name, (_, steps) in field.items()}
    )
    return Result(
        name="environment",
        title="The whole environment",
        text=f"{ID.removeprefix('wsn_env/')}, P = 5000, one thread, search for lost targets included in wsn_env's. Both"
        " naive environments loop over members in Python; one filters with plain NumPy expressions, the other with"
        " SciPy's densities, NumPy's covariance and filterpy's resampling. The bare kernel is the filter alone, with 4"
        " reports and resampling in every period.",
        claims=[
            Claim(
                f"{LABELS[name]}: speed over a naive environment with the book's filter",
                target,
                times.ratio("book", name) if name in field else None,
                why=skipped.get(LABELS[name], ""),
            )
            for name, target in AT_LEAST.items()
        ],
        tables=[table(times)],
        skipped=skipped,
        figures={"seconds": times.seconds, "agreement": agreement, "standard_errors": differences},
        packages=["gymnasium", "scipy", "filterpy"],
    )


def table(times: Times) -> Table:
    """A line an implementation."""
    lines = []
    for name in times.seconds:
        low, high = times.spread(name, "single")
        seconds = times.median(name)
        ratio = f"{figure(times.ratio(name, 'single'))} ({figure(low)}-{figure(high)})"
        lines.append([LABELS[name], f"{1e6 * seconds:.1f}", f"{1 / seconds:,.0f}", ratio])
    return Table("Steps of one field", ["implementation", "us/step", "steps/s", "time over gym.make's"], lines)


def implementations() -> tuple[dict[str, tuple[Callable[[], object], int]], dict[str, str]]:
    """By name: a function, and how many steps of one field a call of it is. And by label: who cannot take part, why."""
    envs = gym.make_vec(ID, num_envs=ROWS, vectorization_mode="vector_entry_point", threads=1, **FIXED)
    naive, book = NaiveEnv(), NaiveEnv(kind=BookFilter)
    kernel = enter(STRICT, Problem.draw("position", rows=ROWS))
    actions = np.full(ROWS, MENU_ENTRY)
    envs.reset(seed=0)
    naive.reset(seed=0)
    book.reset(seed=0)
    field, skipped = {"single": (_stepper(gym.make(ID, **FIXED)), 1)}, {}
    try:
        field["fast"] = _stepper(gym.make(ID, fast=True, **FIXED)), 1
    except (TypeError, ScenarioError):
        skipped[LABELS["fast"]] = "the environment takes no keyword fast"
    field |= {
        "vector": (lambda: envs.step(actions), ROWS),
        "kernel": (kernel.step, ROWS),
        "naive": (lambda: _step_naive(naive), 1),
        "book": (lambda: _step_naive(book), 1),
    }
    return field, skipped


def _stepper(env: gym.Env) -> Callable[[], None]:
    env.reset(seed=0)

    def step():
        if env.step(MENU_ENTRY)[3]:
            env.reset()

    return step


def _step_naive(env: NaiveEnv) -> None:
    if env.step(FURTHER)[3]:
        env.reset(seed=int(env.rng.integers(2**31)))


# --- do both environments have the same episodes? -----------------------------------------------------------


@dataclass(frozen=True)
class Episodes:
    """What is compared of some, without search, which others do not know."""

    rms_m: np.ndarray  # (n,) RMS error
    energy_mj: np.ndarray  # (n,) energy a period
    particles: int


def check_episodes(whose: str, theirs: Episodes, console: Console) -> dict[str, float]:
    """Theirs minus wsn_env's, in standard errors: mean over episodes of the RMS error and of the energy a period.

    Raises:
        SystemExit: if they are too many.
    """
    ours = vector_episodes(4 * len(theirs.rms_m), theirs.particles)
    differences = {}
    for name in ("rms_m", "energy_mj"):
        a, b = getattr(ours, name), getattr(theirs, name)
        differences[name] = float((b.mean() - a.mean()) / (a.var(ddof=1) / len(a) + b.var(ddof=1) / len(b)) ** 0.5)
    if max(map(abs, differences.values())) > STANDARD_ERRORS:
        raise SystemExit(f"{whose} has other episodes: {differences} standard errors")
    console.print(
        f"Episodes of {whose}: RMS error differs by {differences['rms_m']:+.1f} standard errors,"
        f" energy by {differences['energy_mj']:+.1f}"
    )
    return differences


def vector_episodes(rows: int, particles: int) -> Episodes:
    """Of the native batch."""
    settings = FIXED | dict(particles=particles, search=False)
    envs = gym.make_vec(ID, num_envs=rows, vectorization_mode="vector_entry_point", threads=1, **settings)
    envs.reset(seed=0)
    energy = np.zeros(rows)
    truncated = np.zeros(rows, bool)
    periods = 0
    while not truncated.all():
        _, _, _, truncated, infos = envs.step(np.full(rows, MENU_ENTRY))
        energy += infos["energy_mj"]
        periods += 1
    return Episodes(infos["episode_rms_m"], energy / periods, particles)


def naive_episodes(episodes: int, particles: int, kind: type = ParticleFilter) -> Episodes:
    """Of the naive environment with this filter."""
    env = NaiveEnv(Scenario.named(ID, particles=particles), kind=kind)
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
    return Episodes(rms, energy, particles)


if __name__ == "__main__":
    main(measure, __doc__)
