"""At most 35 % of the wall time of `train.py` passes in the environment, with its default settings but fewer steps.

    python -m benchmarks.training [--rounds N] [--short] [--json FILE]

Every round is a training in a process of its own, on all cores, whose pieces are timed from outside. Here the whole is
`PPO.learn`; the share that train.py itself prints is a little smaller, since its whole has start and checkpoint too.
"""

import json
import re
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from rich.console import Console

from benchmarks.race import Claim, Options, Result, Table, figure, main
from wsn_env.envs.vector_env import ClusterVectorEnv

AT_MOST = 35.0  # %
RUNS = 5  # at most
ROLLOUTS = 8
SHORT = ["--rows", "32", "--rollout", "16", "--batch", "256", "--steps", str(3 * 32 * 16)]
HERE = Path(__file__).resolve().parents[1]
PARTS = {  # of the wall time, by what is timed
    "environment": "environment, episodes' ends included",
    "reset": "its first reset",
    "policy": "policy in rollouts",
    "update": "PPO's updates",
    "rest": "the rest: rollout buffer, monitor, callbacks, checkpoint",
}


def measure(options: Options, console: Console) -> Result:
    """Train a few times."""
    runs = []
    for _ in range(1 if options.short else min(options.rounds, RUNS)):
        runs.append(shares(run_training(SHORT if options.short else [])))
        console.print(f"training: {runs[-1]['environment']:.1f} % in the environment", style="dim")
    environment = statistics.median(one["environment"] for one in runs)
    lines = []
    for part, label in PARTS.items():
        values = sorted(one[part] for one in runs)
        lines.append([label, f"{statistics.median(values):.1f}", f"{values[0]:.1f}-{values[-1]:.1f}"])
    speed = statistics.median(one["steps"] / one["seconds"] for one in runs)
    return Result(
        name="training",
        title="Training",
        text=f"train.py, {'a small form of it' if options.short else f'default settings, {ROLLOUTS} rollouts'}:"
        f" {figure(speed)} periods/s. Wall clock.",
        claims=[Claim("train.py: share of its wall time in the environment", AT_MOST, environment, "%", at_most=True)],
        tables=[Table("Where a training spends its time", ["part", "% of wall time", "range over runs"], lines)],
        figures={"runs": runs},
        packages=["torch", "stable-baselines3"],
    )


def shares(seconds: dict) -> dict:
    """% of the wall time by part, beside what was measured."""
    parts = {name: 100 * seconds[name] / seconds["seconds"] for name in PARTS if name != "rest"}
    return seconds | parts | {"rest": 100 - sum(parts.values())}


def run_training(arguments: list[str]) -> dict:
    """Seconds of a training by part, from a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        program = "import sys; from benchmarks.training import time_training; time_training(sys.argv[1:])"
        command = [sys.executable, "-c", program, "--runs", folder, "--episodes", "0", *arguments]
        done = subprocess.run(command, cwd=HERE, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"train.py failed:\n{done.stdout}{done.stderr}")
    found = json.loads(done.stdout.splitlines()[-1])
    printed = re.search(r"(\d+) % of it in the environment", done.stdout)
    found["printed"] = float(printed[1])
    if found["printed"] > 100 * (found["environment"] + found["reset"]) / found["seconds"] + 1:
        raise SystemExit(f"train.py says {found['printed']} %, timed from outside: {found}")
    return found


def time_training(arguments: list[str]) -> None:
    """In the child: time the pieces, train, print their seconds."""
    import tyro
    from stable_baselines3 import PPO
    from stable_baselines3.common.policies import ActorCriticPolicy

    from wsn_env.learning.sb3 import SB3VecEnv
    from wsn_env.training import trainer as train

    settings = tyro.cli(train.Training, args=arguments)
    if settings.steps == train.Training.steps:
        settings.steps = ROLLOUTS * settings.rows * settings.rollout
    load_kernels(settings.rows)  # a second of every process, however long it trains
    seconds = {
        "environment": count_seconds(SB3VecEnv, "step_wait"),
        "reset": count_seconds(SB3VecEnv, "reset"),
        "policy": count_seconds(ActorCriticPolicy, "forward", "predict_values"),
        "update": count_seconds(PPO, "train"),
        "seconds": count_seconds(PPO, "learn"),
    }
    train.train(settings)
    print(json.dumps({name: sum(found) for name, found in seconds.items()} | {"steps": settings.steps}))


def load_kernels(rows: int) -> None:
    """Run every kernel once."""
    settings = dict(reward="belief", observation="menu", autoreset_mode="Disabled")
    envs = ClusterVectorEnv(rows, "PreDC-v0", particles=2, periods=1, **settings)
    envs.reset(seed=0)
    envs.step(np.zeros(rows, np.int64))


def count_seconds(kind: type, *names: str) -> list[float]:
    """Wall seconds of every call of these methods from now on."""
    found: list[float] = []

    def wrap(method):
        def call(*arguments, **keywords):
            started = time.perf_counter()
            try:
                return method(*arguments, **keywords)
            finally:
                found.append(time.perf_counter() - started)

        return call

    for name in names:
        setattr(kind, name, wrap(getattr(kind, name)))
    return found


if __name__ == "__main__":
    main(measure, __doc__, one_thread=False)
