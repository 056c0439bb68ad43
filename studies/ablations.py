"""What makes a scheduler learn: trainings that differ from the usual one in one thing, over several seeds.

    python -m studies.ablations --scenario Rssi-v0 --out out/ablations

Every training has a process of its own (train.py) and the same budget; a study that was stopped goes on with those that
are missing. The policies are then compared on common held-out episodes.
"""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import tyro

from agents.ppo import PPOPolicy
from studies.report import save_table
from wsn_env.cli import make_scenario
from wsn_env.evaluation import evaluate
from wsn_env.progress import progress_bar

USUAL = "usual"
DIFFERENT = {  # name: options of train.py
    USUAL: [],
    "reward: true error": ["--reward", "error"],
    "order: nearest": ["--order", "nearest"],
    "order: information": ["--order", "information"],
    "order: value": ["--order", "value"],
    "action: subset": ["--action", "subset"],
    "network: flat": ["--network", "flat", "--units", "64", "64"],
    "network: entries of 64 x 64": ["--units", "64", "64"],
    "discount: .8": ["--gamma", "0.8"],
    "discount: .95": ["--gamma", "0.95"],
}
ONE_LAM = "lam: one policy for each"


@dataclass
class Study:
    """Train variants of a scheduler and compare them."""

    scenario: str = "PreDC-v0"
    """Scenario id."""
    out: Path = Path("out/ablations")
    """Folder for the runs and the table; a second call continues."""
    steps: int = 1_000_000
    """Periods of every training."""
    seeds: int = 3
    """Trainings of each variant."""
    episodes: int = 500
    """Held-out episodes at each lam."""
    variants: list[str] = field(default_factory=lambda: [*DIFFERENT, ONE_LAM])
    """Which of them."""


def main() -> int:
    """Run."""
    study = tyro.cli(Study, description=__doc__)
    scenario = make_scenario(study.scenario, [], [])
    unknown = [name for name in study.variants if name not in (*DIFFERENT, ONE_LAM)]
    if unknown:
        print(f"studies: variants {unknown} are unknown: {', '.join([*DIFFERENT, ONE_LAM])}", file=sys.stderr)
        return 2
    lams = scenario.lam_octaves
    jobs = []
    for seed in range(study.seeds):
        for name in study.variants:
            options = DIFFERENT.get(name, [])
            if name == ONE_LAM:
                jobs += [(name, seed, ["--lam", f"{lam:g}"], lam) for lam in (lams[1], lams[3], lams[5])]
            else:
                jobs.append((name, seed, options, None))
    results: dict[str, list[dict]] = {}
    with progress_bar() as report:
        for i, (name, seed, options, lam) in enumerate(jobs):
            report(i, len(jobs), f"{name}, seed {seed}")
            folder = run(study, name, seed, options, lam)
            results.setdefault(name, []).append(measured(study, scenario, folder, lams if lam is None else (lam,)))
    save_table(study.out, scenario, lams, results, USUAL)
    return 0


def run(study: Study, name: str, seed: int, options: list[str], lam: float | None) -> Path:
    """One training, unless it is done."""
    word = "".join(letter if letter.isalnum() else "-" for letter in name) + (f"-{lam:g}" if lam else "")
    folder = study.out / f"{study.scenario}-{word}-{seed}"
    if not (folder / "policy.json").exists():
        settings = ["--scenario", study.scenario, "--runs", str(study.out), "--name", folder.name, "--resume"]
        settings += ["--steps", str(study.steps), "--seed", str(10**6 * seed), "--episodes", "0"]
        train = Path(__file__).resolve().parents[1] / "train.py"
        done = subprocess.run([sys.executable, str(train), *settings, *options], capture_output=True, text=True)
        if done.returncode:
            raise SystemExit(f"{name}: train.py failed:\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
        (folder / "said.txt").write_text(done.stdout)
    return folder


def measured(study: Study, scenario, folder: Path, lams) -> dict[float, np.ndarray]:
    """{lam: returns (episodes,)} of a trained policy on the common held-out episodes, kept beside it."""
    path = folder / f"returns-{study.episodes}.json"
    if not path.exists():
        policy = PPOPolicy(scenario, path=str(folder / "policy.json"))
        evaluation = evaluate({"ppo": policy}, scenario, lams, study.episodes, seed=1)
        path.write_text(json.dumps({lam: evaluation.values("ppo", lam, "return").tolist() for lam in lams}))
    return {float(lam): np.array(values) for lam, values in json.loads(path.read_text()).items()}


if __name__ == "__main__":
    sys.exit(main())
