# /// script
# dependencies = ["wsn_env[train]", "optuna==5.0.0"]
# ///
"""Optuna looks for PPO's settings; the best are trained anew and scored on episodes that the search has not seen.

python examples/optuna_ppo.py --steps 20000 --trials 6
"""

import gymnasium as gym
import optuna
import tyro
from closing import ENV, FIELD, Example
from stable_baselines3 import PPO

from wsn_env import score
from wsn_env.learning.sb3 import SB3VecEnv
from wsn_env.learning.training_reward import TrainingReward

SEARCH_SEED = 1  # its held-out episodes are others than those of the closing line


def train(steps: int, rows: int, seed: int, **settings) -> PPO:
    """One training."""
    envs = gym.make_vec(ENV, rows, vectorization_mode="vector_entry_point", autoreset_mode="Disabled", **FIELD)
    return PPO("MlpPolicy", SB3VecEnv(TrainingReward(envs)), batch_size=256, seed=seed, **settings).learn(steps)


def main(steps: int = 20_000, rows: int = 64, trials: int = 6, seed: int = 0) -> None:
    """Search with half of the periods a trial, train with all, then play."""
    example = Example("Optuna, PPO")

    def trial_score(trial: optuna.Trial) -> float:
        settings = dict(
            learning_rate=trial.suggest_float("learning_rate", 1e-4, 1e-2, log=True),
            n_steps=trial.suggest_categorical("n_steps", [8, 16, 32]),
            gamma=trial.suggest_float("gamma", 0.8, 0.99),
        )
        model = train(steps // 2, rows, seed, **settings)
        return score(lambda seen: model.predict(seen, deterministic=True)[0], example.held_out, SEARCH_SEED).mean()

    study = optuna.create_study(direction="maximize", sampler=optuna.samplers.TPESampler(seed=seed))
    study.optimize(trial_score, n_trials=trials)
    print(f"best of {trials} trials: {study.best_params}")
    model = train(steps, rows, seed, **study.best_params)
    example.close(lambda seen: model.predict(seen, deterministic=True)[0], model.num_timesteps + trials * (steps // 2))


if __name__ == "__main__":
    tyro.cli(main)
