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


def single() -> Callable[[], None]:
    """A step of a single environment, which is reset at its episodes' ends."""
    ClusterEnv(SMALL.override(start="search")).reset(seed=0)  # else its code would be loaded when first a track is lost
    env, rng = ClusterEnv(SMALL, action="menu", observation="menu"), np.random.default_rng(0)
    env.reset(seed=0)

    def step() -> None:
        if env.step(int(rng.integers(28)))[3]:
            env.reset()

    return step


def batch() -> Callable[[], None]:
    """A step of a batch of rows, whose episodes begin anew by themselves."""
    envs, rng = ClusterVectorEnv(ROWS, SMALL, action="menu", observation="menu"), np.random.default_rng(0)
    envs.reset(seed=0)

    def step() -> None:
        envs.step(rng.integers(28, size=ROWS))

    return step


RUNS: dict[str, tuple[Callable[[], Callable[[], None]], int]] = {  # what is stepped, and how often
    "steps of one environment": (single, 1_000_000),
    f"steps of a batch of {ROWS}": (batch, 100_000),
}


def growth(name: str, steps: int) -> tuple[float, float]:
    """MiB resident at most after a tenth of the steps and after all, in a process of its own."""
    command = [sys.executable, "-m", "studies.reliability.memory", name, str(steps)]
    told = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    return float(told[0]), float(told[1])


def peak_mib() -> float:
    """Of this process until now; Linux alone tells it without what the process was before."""
    (kib,) = re.findall(r"VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text(encoding="utf-8"))
    return int(kib) / 2**10


def main(name: str, steps: int) -> None:
    """Step, and print both."""
    step = RUNS[name][0]()
    for _ in range(steps // 10):
        step()
    print(peak_mib())
    for _ in range(steps - steps // 10):
        step()
    print(peak_mib())


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
