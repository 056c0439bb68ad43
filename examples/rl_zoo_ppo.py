# /// script
# dependencies = ["wsn_env[train]", "rl_zoo3==2.9.2"]
# ///
"""RL Zoo's trainer with the hyper-parameters of rl_zoo_ppo.yml.

python examples/rl_zoo_ppo.py --steps 20000
"""

import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import tyro
from closing import ENV, FIELD, Example
from stable_baselines3 import PPO


def main(steps: int = 20_000, seed: int = 0) -> None:
    """Train, then play."""
    example = Example("RL Zoo, PPO")
    with TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "rl_zoo3.train", "--algo", "ppo", "--env", ENV, "--gym-packages", "wsn_env"]
        command += ["-conf", str(Path(__file__).with_suffix(".yml")), "-f", folder, "-n", str(steps)]
        command += ["--seed", str(seed), "--eval-freq", "-1", "--num-threads", "1"]
        command += ["--env-kwargs", *(f"{name}:{value!r}" for name, value in FIELD.items())]
        subprocess.run(command, check=True)
        model = PPO.load(next(Path(folder).rglob("*.zip")))
    example.close(lambda observations: model.predict(observations, deterministic=True)[0], model.num_timesteps)


if __name__ == "__main__":
    tyro.cli(main)
