"""Several targets: 64 fields with 3 targets each make at least 85 % of the target steps a second of 64 fields with one.

    python -m benchmarks.several_targets [--rounds N] [--short] [--json FILE]

A batch of 192 single-target fields is timed beside them: what more rows cost by themselves, since fewer of them stay in
the cache.
"""

import gymnasium as gym
import numpy as np
from rich.console import Console

from benchmarks.race import Claim, Options, Result, Table, figure, interleave, main
from benchmarks.vector import ID, MENU_ENTRY, episode, one_core
from wsn_env.scenario import Scenario

FIELDS, TARGETS, PARTICLES = 64, 3, 1000
AT_LEAST = 85.0  # %
ONE, SEVERAL = f"{FIELDS} fields, 1 target", f"{FIELDS} fields, {TARGETS} targets"
MORE = f"{FIELDS * TARGETS} fields, 1 target"


def measure(options: Options, console: Console) -> Result:
    """Check, race."""
    with one_core():
        batches = {ONE: make(FIELDS), SEVERAL: make(FIELDS, TARGETS), MORE: make(FIELDS * TARGETS)}
        same = equal_steps(make(FIELDS), make(FIELDS, TARGETS))
        console.print(f"the first targets are the single ones to the bit in {same} steps")
        periods = Scenario.named(ID).periods
        units = {ONE: FIELDS * periods, SEVERAL: FIELDS * TARGETS * periods, MORE: FIELDS * TARGETS * periods}
        times = interleave({name: episode(envs) for name, envs in batches.items()}, options, units)
    lines = []
    for name in batches:
        low, high = (100 * each for each in times.spread(ONE, name))
        share = f"{100 * times.ratio(ONE, name):.1f} % ({low:.1f}-{high:.1f})"
        lines.append([name, figure(1e6 * times.median(name)), share])
    what = f"several targets: speed of a target's step, {SEVERAL}, over {ONE}"
    return Result(
        name="several_targets",
        title="Several targets",
        text=f"{ID} with {PARTICLES} particles a target, moving the head to the nearest node with 3 further members,"
        " one thread. The time of a target's step, resets included, and the speed over that with one (quartiles).",
        claims=[Claim(what, AT_LEAST, 100 * times.ratio(ONE, SEVERAL), "%")],
        tables=[Table("A target's step", ["batch", "us", f"speed over {ONE}"], lines)],
        figures={"seconds": times.seconds},
        packages=["gymnasium"],
    )


def make(fields: int, targets: int = 1) -> gym.vector.VectorEnv:
    """A native batch."""
    more = dict(num_envs=fields, vectorization_mode="vector_entry_point", threads=1, particles=PARTICLES)
    if targets == 1:
        return gym.make_vec(ID, **more)
    return gym.make_vec("wsn_env/Multi-v0", **more, targets=targets)


def equal_steps(one: gym.vector.VectorEnv, several: gym.vector.VectorEnv, steps: int = 20) -> int:
    """How many steps were compared.

    Raises:
        SystemExit: if the errors differ.
    """
    for envs in (one, several):
        envs.reset(seed=3)
    for step in range(steps):
        alone, joint = (
            envs.step(np.full(envs.action_space.shape, MENU_ENTRY))[4]["error_m"] for envs in (one, several)
        )
        if not np.array_equal(alone, joint[:, 0]):
            raise SystemExit(f"the first of several targets differs from a single one in step {step}: no race")
    return steps


if __name__ == "__main__":
    main(measure, __doc__)
