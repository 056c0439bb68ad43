# /// script
# dependencies = ["wsn_env[train,ray]", "ray==2.60.0"]
# ///
"""Ray Tune looks for PPO's settings; the best are trained again and scored on episodes that the search has not seen.

python examples/ray_tune_ppo.py --steps 20000 --trials 6

Trials run in processes of Ray's, one at a time here; the best is trained again with the same seed.
"""

from tempfile import TemporaryDirectory

import gymnasium as gym
import ray
import torch
import tyro
from closing import ENV, FIELD, Example
from ray import tune
from stable_baselines3 import PPO

from wsn_env import score
from wsn_env.learning.sb3 import SB3VecEnv
from wsn_env.learning.training_reward import TrainingReward

SEARCH_SEED = 1  # its held-out episodes are others than those of the closing line
SEARCH_EPISODES = 200


def make(rows: int) -> gym.vector.VectorEnv:
    """The native batch."""
    return gym.make_vec(ENV, rows, vectorization_mode="vector_entry_point", autoreset_mode="Disabled", **FIELD)


def train(steps: int, rows: int, seed: int, settings: dict) -> PPO:
    """One training."""
    batch = SB3VecEnv(TrainingReward(make(rows)))
    return PPO("MlpPolicy", batch, batch_size=256, seed=seed, **settings).learn(steps)


def main(steps: int = 20_000, rows: int = 64, trials: int = 6, seed: int = 0) -> None:
    """Search, train the best again, then play."""
    example = Example("Ray Tune, PPO")

    def trial(settings: dict) -> None:
        torch.set_num_threads(1)  # in a process of Ray's own
        model = train(steps, rows, seed, settings)
        played = score(lambda seen: model.predict(seen, deterministic=True)[0], make(SEARCH_EPISODES), SEARCH_SEED)
        tune.report({"return": played.mean()})

    ray.init(num_cpus=1, include_dashboard=False, log_to_driver=False)
    space = dict(
        learning_rate=tune.loguniform(3e-4, 3e-3), n_steps=tune.choice([8, 16, 32]), gamma=tune.uniform(0.8, 0.99)
    )
    search = tune.search.BasicVariantGenerator(random_state=seed)
    config = tune.TuneConfig(metric="return", mode="max", num_samples=trials, search_alg=search)
    with TemporaryDirectory() as folder:
        run = tune.RunConfig(storage_path=folder, verbose=0)
        best = tune.Tuner(trial, param_space=space, tune_config=config, run_config=run).fit().get_best_result()
    ray.shutdown()
    print(f"best of {trials} trials: {best.config}")
    model = train(steps, rows, seed, best.config)
    example.close(lambda seen: model.predict(seen, deterministic=True)[0], (1 + trials) * model.num_timesteps)


if __name__ == "__main__":
    tyro.cli(main)
