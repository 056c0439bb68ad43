"""Train one PPO scheduler for every trade-off, then compare it with every baseline on episodes that neither has seen.

Reads top to bottom: settings -> environments -> PPO -> saved policy -> paired comparison -> picture.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.logger import configure
from stable_baselines3.common.utils import LinearSchedule

from wsn_env.agents.budget import find_price
from wsn_env.agents.ppo import PRICE, PPOPolicy, save_policy
from wsn_env.envs.interface import Settings
from wsn_env.envs.multi_env import TargetRows
from wsn_env.envs.observations import ObservationName
from wsn_env.evaluation.policies import make_policy
from wsn_env.evaluation.progress import progress_bar
from wsn_env.evaluation.versions import versions
from wsn_env.learning.actor_critic import EntryPolicy, actor_network, entry_sizes
from wsn_env.learning.checkpoints import Watch, check_finite, load_checkpoint
from wsn_env.learning.concat_vector_env import ConcatVectorEnv
from wsn_env.learning.even_worlds import EvenWorldsBuffer
from wsn_env.learning.held_out import HeldOut
from wsn_env.learning.network import PolicyNetwork
from wsn_env.learning.priced_vector_env import PricedVectorEnv
from wsn_env.learning.privileged import PrivilegedVectorEnv
from wsn_env.learning.replayable import ReplayableRows
from wsn_env.learning.run_folder import facts_of, open_folder, open_progress
from wsn_env.learning.sb3 import SB3VecEnv
from wsn_env.learning.training_reward import TrainingReward
from wsn_env.learning.worlds import world_of
from wsn_env.models.arguments import check_parameters
from wsn_env.reports.pages.evaluation_page import write_report
from wsn_env.scenario import Scenario
from wsn_env.training.comparison import SIZES, compare, make_baselines
from wsn_env.training.settings import Training, check_settings, complete_settings, settings_as_json, trade_offs

RIVALS = ("greedy", "adaptive", *(f"nearest{size}" for size in SIZES))  # of the learning curve
PRICED = 32  # episodes in which the price of scarce energy is found


def train(settings: Training) -> None:
    """The whole story."""
    for name, value in check_parameters(Training, vars(settings), "Training.").items():
        setattr(settings, name, value)
    scenario = complete_settings(settings)
    check_settings(settings, scenario)
    rules = make_baselines(scenario) if settings.episodes else {}
    torch.set_num_threads(settings.torch_threads)
    observation: ObservationName = "menu" if settings.action == "menu" else "candidates"
    assert settings.order is not None  # complete_settings has filled it in
    interface = Settings(settings.action, observation, settings.reward, settings.order)
    folder, values = settings.folder, settings_as_json(settings)
    open_folder(folder, values, settings.resume)
    learn = learn_on_ray if settings.engine == "ray" else learn_locally
    network = learn(settings, scenario, interface, folder)

    made = {name: value for name, value in values.items() if name not in ("name", "runs")}
    facts: dict[str, Any] = {"training": made, "scenario": scenario.as_dict(), "versions": versions()}
    policy = save_policy(folder, network, interface, facts)
    if settings.steering:
        with progress_bar() as report:
            facts[PRICE] = find_price(str(policy), scenario, range(settings.seed, settings.seed + PRICED), report)
        policy = save_policy(folder, network, interface, facts)
    print(f"saved: {policy}")
    if settings.episodes:
        compare(settings, scenario, {"ppo": PPOPolicy(scenario, path=str(policy))} | rules, made)
    else:
        print(f"written: {write_report(folder, training=made)}")


def learn_locally(settings: Training, scenario: Scenario, interface: Settings, folder: Path) -> PolicyNetwork:
    """stable-baselines3's PPO."""
    envs = SB3VecEnv(make_envs(settings, scenario, interface, settings.rows), stagger=True)
    model = make_model(settings, ReplayableRows(envs))
    facts = facts_of(settings_as_json(settings), scenario)
    pending = load_checkpoint(model, folder, settings.steps, facts)
    left = settings.steps - model.num_timesteps
    if left > 0:
        started, busy = time.perf_counter(), time.process_time()
        model.set_logger(configure(str(open_progress(folder, model.num_timesteps)), ["tensorboard", "csv"]))
        for record in pending:
            model.logger.record(*record)
        with progress_bar() as report:
            held_out = make_held_out(settings, scenario, interface)
            watch = Watch(
                folder, settings.steps, settings.checkpoint_steps, facts, report, held_out, max(settings.points, 1)
            )
            try:
                model.learn(left, callback=watch, reset_num_timesteps=False)
            except (ValueError, RuntimeError):
                check_finite(model)  # torch's own words about NaN fill a screen
                raise
            finally:
                watch.save()
        seconds = time.perf_counter() - started
        print(
            f"trained {left:,} time steps in {seconds:.0f} s ({left / seconds:,.0f} a second), "
            f"{100 * envs.seconds / seconds:.0f} % of it in the environment, "
            f"{(time.process_time() - busy) / seconds:.1f} cores busy"
        )
    return actor_network(model)


def make_held_out(settings: Training, scenario: Scenario, interface: Settings) -> HeldOut | None:
    """What the learning curve is made of."""
    if settings.points == 0 or settings.steering:
        return None
    return HeldOut(
        scenario, interface, {name: make_policy(name, scenario) for name in RIVALS}, trade_offs(settings, scenario)
    )


def learn_on_ray(settings: Training, scenario: Scenario, interface: Settings, folder: Path) -> PolicyNetwork:
    """RLlib's PPO."""
    try:
        from wsn_env.learning.rllib import RayTraining
    except ImportError as problem:
        raise ValueError(f"engine 'ray': pip install 'wsn_env[ray]' ({problem})") from None

    whole = make_envs(settings, scenario, interface, len(settings.vary or ()) + 1)
    space: Any = whole.single_observation_space
    seen = space.shape[0]
    training = RayTraining(
        lambda rows: make_envs(settings, scenario, interface, rows),
        entry_sizes(settings.action, whole.interface.observation, seen, settings.units, settings.critic),
        folder,
        steps=settings.steps,
        facts=facts_of(settings_as_json(settings), scenario),
        rows=settings.rows,
        runners=settings.runners,
        rollout=settings.rollout,
        seed=settings.seed,
        address=settings.address,
        lr=[[0, settings.learning_rate], [settings.steps, 0.0]],
        gamma=settings.gamma,
        lambda_=settings.gae_lambda,
        entropy_coeff=settings.entropy,
        minibatch_size=settings.batch,
        num_epochs=settings.epochs,
    )
    with training, progress_bar() as report:
        started, before = time.perf_counter(), training.periods
        training.run(settings.checkpoint_steps, report)
        left, seconds = training.periods - before, time.perf_counter() - started
        print(f"trained {left:,} time steps in {seconds:.0f} s ({left / seconds:,.0f} a second)")
        return training.actor_network()


def make_envs(settings: Training, scenario: Scenario, interface: Settings, rows: int) -> ConcatVectorEnv:
    """The rows, divided among the scenarios; in whole fields, where these have several targets."""
    scenarios = [scenario, *(scenario.override(**world_of(text)) for text in settings.vary or ())]
    shares = np.diff(np.arange(len(scenarios) + 1) * rows // len(scenarios))
    parts = []
    for place, (one, share) in enumerate(zip(scenarios, shares)):
        rows_of: Callable[..., TargetRows] = TargetRows
        if settings.steering:
            rows_of = partial(PricedVectorEnv, steering=settings.steering)
        envs = rows_of(int(share // one.targets * one.targets), one, autoreset_mode="Disabled", **asdict(interface))
        told = PrivilegedVectorEnv(envs, place, len(scenarios)) if settings.privileged else envs
        parts.append(TrainingReward(told, calibrated=settings.reward == "belief"))
    return ConcatVectorEnv(parts)


def make_model(settings: Training, envs) -> PPO:
    """A new model."""
    kind, shape = architecture(settings, envs)
    buffer: dict[str, Any] = {}
    if settings.even_worlds:
        (worlds,) = envs.get_attr("parts", 0)
        rows = [world.num_envs for world in worlds]
        buffer = dict(rollout_buffer_class=EvenWorldsBuffer, rollout_buffer_kwargs={"rows": rows})
    return PPO(
        kind,
        envs,
        n_steps=settings.rollout,
        batch_size=settings.batch,
        n_epochs=settings.epochs,
        learning_rate=LinearSchedule(settings.learning_rate, 0.0, 1.0),
        gamma=settings.gamma,
        gae_lambda=settings.gae_lambda,
        ent_coef=settings.entropy,
        policy_kwargs=shape,
        stats_window_size=1000,  # episodes: each has a lam of its own, so that fewer would tell little
        seed=settings.seed,
        device="cpu",
        **buffer,
    )


def architecture(settings: Training, envs) -> tuple:
    """The kind of PPO's policy, and its arguments."""
    if settings.network == "flat":
        return "MlpPolicy", {"net_arch": {"pi": list(settings.units), "vf": list(settings.critic)}}
    (interface,) = envs.get_attr("interface", 0)
    seen = envs.observation_space.shape[0]
    entries = entry_sizes(settings.action, interface.observation, seen, settings.units, settings.critic)
    return EntryPolicy, {"entries": entries}
