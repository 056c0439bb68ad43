"""Other algorithms on the same environment, with the same budget of periods: a row each.

    python -m studies.algorithms --scenario Rssi-v0 --out out/algorithms

MaskablePPO and RecurrentPPO (sb3-contrib) choose from the menu, SAC (stable-baselines3) sets the cluster's radius. All
see the menu's observation flat. Needs the extra `study`.
"""

from __future__ import annotations

import json
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import torch
import tyro

from studies.report import save_table
from wsn_env.envs.vector_env import ClusterVectorEnv
from wsn_env.evaluation.scoring import score
from wsn_env.learning.sb3 import SB3VecEnv
from wsn_env.learning.training_reward import TrainingReward
from wsn_env.scenario import Scenario
from wsn_env.scenario.options import make_scenario

ROWS = 256


@dataclass
class Study:
    """Train other algorithms and compare them."""

    scenario: str = "PreDC-v0"
    """Scenario id."""
    out: Path = Path("out/algorithms")
    """Folder for the models and the table; a second call continues."""
    steps: int = 1_000_000
    """Periods of every training."""
    seeds: int = 3
    """Trainings of each algorithm."""
    episodes: int = 500
    """Held-out episodes at each lam."""
    algorithms: list[str] = field(default_factory=lambda: list(ALGORITHMS))
    """Which of them."""


def make_maskable_ppo(envs, **more):
    """PPO that never takes an entry that stands for another."""
    from sb3_contrib import MaskablePPO

    shape = {"net_arch": [64, 64]}
    return MaskablePPO(
        "MlpPolicy",
        envs,
        n_steps=64,
        batch_size=4096,
        n_epochs=8,
        policy_kwargs=shape,
        **shared_ppo_arguments(),
        **more,
    )


def make_recurrent_ppo(envs, **more):
    """PPO with an LSTM before actor and critic."""
    from sb3_contrib import RecurrentPPO

    shape = {"net_arch": [64], "lstm_hidden_size": 64, "enable_critic_lstm": False, "shared_lstm": True}
    return RecurrentPPO(
        "MlpLstmPolicy",
        envs,
        n_steps=64,
        batch_size=4096,
        n_epochs=4,
        policy_kwargs=shape,
        **shared_ppo_arguments(),
        **more,
    )


def shared_ppo_arguments() -> dict:
    """What the PPO kinds share with train.py."""
    from stable_baselines3.common.utils import LinearSchedule

    return dict(learning_rate=LinearSchedule(2e-3, 0.0, 1.0), gamma=0.95, gae_lambda=0.9, ent_coef=5e-4)


def make_sac(envs, **more):
    """Soft actor-critic: one update of 256 transitions for every 16 periods."""
    from stable_baselines3 import SAC

    return SAC(
        "MlpPolicy",
        envs,
        gamma=0.95,
        batch_size=256,
        train_freq=1,
        gradient_steps=ROWS // 16,
        learning_starts=50 * ROWS,
        policy_kwargs={"net_arch": [64, 64]},
        **more,
    )


ALGORITHMS = {  # name: (maker, action)
    "MaskablePPO, menu": (make_maskable_ppo, "menu"),
    "RecurrentPPO, menu": (make_recurrent_ppo, "menu"),
    "SAC, radius": (make_sac, "radius"),
}


def main() -> int:
    """Run."""
    study = tyro.cli(Study, description=__doc__)
    torch.set_num_threads(1)
    scenario = make_scenario(study.scenario, [], [])
    unknown = [name for name in study.algorithms if name not in ALGORITHMS]
    if unknown:
        print(f"studies: algorithms {unknown} are unknown: {', '.join(ALGORITHMS)}", file=sys.stderr)
        return 2
    results: dict[str, list[dict]] = {}
    for seed in range(study.seeds):
        for name in study.algorithms:
            results.setdefault(name, []).append(train_and_play(study, scenario, name, seed))
    save_table(study.out, scenario, scenario.lam_octaves, results, "")
    return 0


def train_and_play(study: Study, scenario: Scenario, name: str, seed: int) -> dict[float, np.ndarray]:
    """Returns by lam of one training, unless it is done and kept."""
    word = "".join(letter if letter.isalnum() else "-" for letter in name)
    path = study.out / f"{study.scenario}-{word}-{seed}-{study.episodes}.json"
    if not path.exists():
        maker, action = ALGORITHMS[name]
        span = scenario.override(lam=scenario.lam_span)
        interface = dict(action=action, observation="menu", order=scenario.measurement.order)
        envs = ClusterVectorEnv(ROWS, span, reward="belief", autoreset_mode="Disabled", **interface)
        model = maker(SB3VecEnv(TrainingReward(envs, calibrated=True), stagger=True), seed=10**6 * seed, device="cpu")
        started = time.perf_counter()
        model.learn(study.steps)
        seconds = time.perf_counter() - started
        returns = {
            lam: play_held_out(model, scenario.override(lam=lam), interface, study.episodes)
            for lam in scenario.lam_octaves
        }
        print(
            f"{name}, seed {seed}: {seconds:.0f} s",
            {lam: round(float(values.mean()), 1) for lam, values in returns.items()},
        )
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(
            json.dumps({lam: values.tolist() for lam, values in returns.items()} | {"seconds": seconds}),
            encoding="utf-8",
        )
    kept = json.loads(path.read_text(encoding="utf-8"))
    return {float(lam): np.array(values) for lam, values in kept.items() if lam != "seconds"}


def play_held_out(model, scenario: Scenario, interface: dict, episodes: int) -> np.ndarray:
    """Returns (episodes,) of the model's likeliest actions on the held-out episodes, by the true error."""
    envs = ClusterVectorEnv(episodes, scenario, autoreset_mode="Disabled", **interface)
    masked = type(model).__name__ == "MaskablePPO"
    memory, first = None, np.ones(episodes, bool)

    def act(observations):
        nonlocal memory
        masks = {"action_masks": envs.action_masks()} if masked else {}
        actions, memory = model.predict(observations, memory, first, deterministic=True, **masks)
        first[:] = False
        return actions

    return score(act, envs, seed=1)


if __name__ == "__main__":
    sys.exit(main())
