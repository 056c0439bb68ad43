"""What makes a scheduler learn: trainings that differ from the usual one in one thing, over several seeds.

    python -m studies.ablations --scenario Rssi-v0 --out out/ablations

Every training has a process of its own (train.py) and the same budget; a study that was stopped goes on with those that
are missing. The policies are then compared on common held-out episodes, and the learning curves drawn.
"""

from __future__ import annotations

import json
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import tyro

from studies.report import draw_curves, save_table
from wsn_env.agents.ppo import PPOPolicy
from wsn_env.envs.merit import ORDERS
from wsn_env.evaluation.comparison import evaluate
from wsn_env.evaluation.progress import progress_bar
from wsn_env.scenario import Scenario
from wsn_env.scenario.options import make_scenario

USUAL = "usual"
DIFFERENT = {  # name: options of train.py
    USUAL: [],
    "reward: true error": ["--reward", "error"],
    "action: subset": ["--action", "subset"],
    "network: flat, 64 x 64": ["--network", "flat", "--units", "64", "64"],
    "network: entries, 32 x 32": ["--units", "32", "32"],
    "critic: sees what the actor sees": ["--privileged", "False"],
    "GAE lambda: 0.7": ["--gae-lambda", "0.7"],
    "learning rate: 0.002": ["--learning-rate", "0.002"],
    "discount: 0.9": ["--gamma", "0.9"],
    "worlds: its own alone": ["--vary"],
    **{f"order: {order}": ["--order", order] for order in ORDERS},
}
ONE_LAM = "lam: a policy for each"


@dataclass
class Study:
    """Train variants of a scheduler and compare them."""

    scenario: str = "PreDC-v0"
    """Scenario id."""
    out: Path = Path("out/ablations")
    """Folder for the runs, the table and the picture; a second call continues."""
    steps: int = 1_000_000
    """Periods of every training."""
    seeds: int = 5
    """Trainings of each variant."""
    episodes: int = 500
    """Held-out episodes at each lam."""
    variants: list[str] = field(default_factory=list)
    """Which of them; left out: all."""
    workers: int = 2
    """Trainings at a time, a core each."""


@dataclass(frozen=True)
class Job:
    """One training."""

    variant: str
    seed: int
    lam: float | None = None
    """Its only one, or None: the whole span."""


def main() -> int:
    """Run."""
    study = tyro.cli(Study, description=__doc__)
    scenario = make_scenario(study.scenario, [], [])
    allowed = variants(scenario)
    unknown = [name for name in study.variants if name not in allowed]
    if unknown:
        print(f"studies: variants {unknown} are unknown: {', '.join(allowed)}", file=sys.stderr)
        return 2
    lams = scenario.lam_octaves
    jobs = []
    for seed in range(study.seeds):
        for name in study.variants or allowed:
            alone = lams[1::2] if name == ONE_LAM else [None]
            jobs += [Job(name, seed, lam) for lam in alone]
    results: dict[str, list[dict]] = {}
    folders: dict[str, list[Path]] = {}
    with (
        progress_bar() as report,
        ThreadPoolExecutor(study.workers) as workers,
        closing(workers.map(lambda job: train_variant(study, job), jobs)) as trained,  # what has not begun never will
    ):
        for i, job in enumerate(jobs):
            report(i, len(jobs), f"{job.variant}, seed {job.seed}")
            folder = next(trained)
            asked = lams if job.lam is None else (job.lam,)
            results.setdefault(job.variant, []).append(evaluate_returns(study, scenario, folder, asked))
            if job.lam is None:
                folders.setdefault(job.variant, []).append(folder)
    save_table(study.out, scenario, lams, results, USUAL)
    draw_curves(folders, f"{scenario.name}: {study.seeds} trainings each", study.out / f"{scenario.name}.png")
    return 0


def variants(scenario: Scenario) -> list[str]:
    """What there is to try: all but what is usual under a name of its own."""
    return [name for name in (*DIFFERENT, ONE_LAM) if name != f"order: {scenario.measurement.order}"]


def train_variant(study: Study, job: Job) -> Path:
    """Train, unless that is done."""
    word = "".join(letter if letter.isalnum() else "-" for letter in job.variant) + (f"-{job.lam:g}" if job.lam else "")
    folder = study.out / f"{study.scenario}-{word}-{job.seed}"
    if not (folder / "policy.json").exists():
        settings = ["--scenario", study.scenario, "--runs", str(study.out), "--name", folder.name, "--resume"]
        settings += ["--steps", str(study.steps), "--seed", str(10**6 * job.seed), "--episodes", "0"]
        settings += DIFFERENT.get(job.variant, ["--lam", f"{job.lam}"])
        train = Path(__file__).resolve().parents[1] / "train.py"
        done = subprocess.run([sys.executable, str(train), *settings], capture_output=True, text=True)
        if done.returncode:
            raise SystemExit(f"{job.variant}: train.py failed:\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
        (folder / "said.txt").write_text(done.stdout, encoding="utf-8")
    return folder


def evaluate_returns(study: Study, scenario: Scenario, folder: Path, lams) -> dict[float, np.ndarray]:
    """{lam: returns (episodes,)} of a trained policy on the common held-out episodes, kept beside it."""
    path = folder / f"returns-{study.episodes}.json"
    if not path.exists():
        policy = PPOPolicy(scenario, path=str(folder / "policy.json"))
        evaluation = evaluate({"ppo": policy}, scenario, lams, study.episodes, seed=1, progress=None)
        path.write_text(
            json.dumps({lam: evaluation.values("ppo", lam, "return").tolist() for lam in lams}), encoding="utf-8"
        )
    return {float(lam): np.array(values) for lam, values in json.loads(path.read_text(encoding="utf-8")).items()}


if __name__ == "__main__":
    sys.exit(main())
