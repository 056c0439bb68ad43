"""Whether memory stays flat over long runs: the most that was resident after a tenth of a run, and after all of it."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

from wsn_env import ClusterEnv, ClusterVectorEnv, Scenario

SMALL = Scenario.named("PreDC-v0", particles=100)
ROWS = 64


def step_one(steps: int) -> None:
    """A single environment, reset at its episodes' ends."""
    env, rng = ClusterEnv(SMALL, action="menu", observation="menu"), np.random.default_rng(0)
    env.reset(seed=0)
    for action in rng.integers(28, size=steps):
        if env.step(int(action))[3]:
            env.reset()


def step_batch(steps: int) -> None:
    """A batch of rows, whose episodes begin anew by themselves."""
    envs, rng = ClusterVectorEnv(ROWS, SMALL, action="menu", observation="menu"), np.random.default_rng(0)
    envs.reset(seed=0)
    for _ in range(steps):
        envs.step(rng.integers(28, size=ROWS))


RUNS: dict[str, tuple[Callable[[int], None], int]] = {  # what is stepped, and how often
    "steps of one environment": (step_one, 1_000_000),
    f"steps of a batch of {ROWS}": (step_batch, 100_000),
}


def growth(name: str, steps: int) -> tuple[float, float]:
    """MiB resident at most after a tenth of the steps and after all, in a process of its own."""
    command = [sys.executable, "-m", "studies.reliability.memory", name, str(steps)]
    told = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    return float(told[0]), float(told[1])


def peak_mib() -> float:
    """Of this process until now; Linux alone tells it without what the process was before."""
    (kib,) = re.findall(r"VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text())
    return int(kib) / 2**10


def main(name: str, steps: int) -> None:
    """Step, and print both."""
    step, _ = RUNS[name]
    step(steps // 10)
    print(peak_mib())
    step(steps - steps // 10)
    print(peak_mib())


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
