"""Train one PPO scheduler for every trade-off, then compare it with every baseline on episodes that neither has seen.

    python train.py --scenario PreDC-v0

Reads top to bottom: settings -> environments -> PPO -> saved policy -> paired comparison -> picture.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Literal, get_args, get_origin, get_type_hints

import numpy as np
import torch
import tyro
from stable_baselines3 import PPO
from stable_baselines3.common.logger import configure
from stable_baselines3.common.utils import LinearSchedule

from wsn_env.agents.budget import find_price
from wsn_env.agents.ppo import PRICE, PPOPolicy, save_policy
from wsn_env.cli import make_scenario
from wsn_env.envs.interface import Settings
from wsn_env.envs.observations import ObservationName
from wsn_env.envs.vector_env import ClusterVectorEnv
from wsn_env.evaluation.comparison import evaluate
from wsn_env.evaluation.kept_blocks import remove_kept_blocks
from wsn_env.evaluation.policies import Policy, make_policy, policy_names
from wsn_env.evaluation.progress import progress_bar
from wsn_env.evaluation.rollout import FIRST_SEED, evaluation_seeds
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
from wsn_env.learning.worlds import default_worlds, world_of
from wsn_env.models.arguments import check_parameters
from wsn_env.models.measurement.base import Order
from wsn_env.models.own import own_error, own_place
from wsn_env.models.quantity import check_quantity
from wsn_env.reports.pages.evaluation_page import write_report
from wsn_env.reports.pictures import write_picture
from wsn_env.reports.plots import draw_comparison
from wsn_env.reports.tables import print_tables, save_markdown
from wsn_env.reports.terminal import NOBODY_READS, any_terminal
from wsn_env.scenario import Scenario

SIZED = ("nearest", "informed")  # compared with each of SIZES
SIZES = range(9)  # further members
RIVALS = ("greedy", "adaptive", *(f"nearest{size}" for size in SIZES))  # of the learning curve
PRICED = 32  # episodes in which the price of scarce energy is found
PERIODS = 500_000  # of the comparison, unless another number of episodes is asked for
SLOW = ("ppo", "planner")  # left out of the comparison: the one trained is in it, the other takes hours


@dataclass
class Training:
    """Train a PPO scheduler and compare it with every baseline."""

    # what is trained
    scenario: str = "PreDC-v0"
    """Scenario id."""
    lam: list[float] = field(default_factory=list)
    """Trade-off between error and energy [m/mJ]: one number, or two that it is drawn between, log-uniformly for each
    episode; left out: the scenario's whole span."""
    tracks: list[Path] = field(default_factory=list)
    """CSV files of recorded motion (columns t, x, y in s and m), to train and compare on instead of the scenario's."""
    set: list[str] = field(default_factory=list)
    """Scenario quantities, as name=value: nodes=400 particles=1000."""
    vary: list[str] | None = None
    """Further scenarios to train in, each this one with some quantities changed: nodes=81 motion=turns,particles=1000
    nodes=81,faults=stuck,share=0.1 (faults last).
    The rows are divided evenly among all. Left out: those in which the scenario's policy is to hold."""
    action: Literal["menu", "subset"] = "menu"
    """What it chooses from."""
    order: Order | None = None
    """The menu's order of merit; left out: by what the nodes measure."""
    steering: float | None = None
    """How the price of energy follows its scarcity: lam is multiplied by supply^-steering in every period. Left out:
    1 where energy is scarce, else 0."""
    reward: Literal["belief", "error"] = "belief"
    """Training reward: belief (what the filter expects, low variance) | error (the true error)."""

    # where it goes
    name: str = ""
    """Name of the run; left out: scenario and lam."""
    runs: Path = Path("runs")
    """Folder of all runs."""
    resume: bool = False
    """Continue the run of this name from its last checkpoint (or begin it). It ends with the same bits as a training
    that was never stopped; only with --engine ray are the episodes after the checkpoint others."""
    engine: Literal["local", "ray"] = "local"
    """What trains: stable-baselines3 in this process, or RLlib with a native batch in every runner of a Ray cluster.
    The network, the rewards and the fields are the same, PPO's details are each library's own."""
    runners: int = 2
    """Of the Ray cluster, a core each; the rows are divided among them."""
    address: str | None = None
    """Of a running Ray cluster; left out: one on this machine."""

    # PPO
    steps: int = 3_000_000
    """Periods of training, over all rows."""
    rows: int = 256
    """Parallel fields."""
    rollout: int = 64
    """Periods of each row between two updates."""
    batch: int = 2048
    """Transitions in a minibatch."""
    epochs: int = 4
    """Passes over a rollout."""
    learning_rate: float = 5e-3
    """At the start; falls linearly to 0."""
    gamma: float = 0.98
    """Discount per period."""
    gae_lambda: float = 0.9
    """Of the generalised advantage estimate."""
    even_worlds: bool | None = None
    """Bring the advantages in each scenario to one size, lest those decide in which costs vary most. Left out: with the
    engine local; ray cannot."""
    entropy: float = 5e-4
    """Weight of the entropy bonus."""
    network: Literal["entries", "flat"] = "entries"
    """entries: the same small network scores every entry of the choice, whatever their number; flat: one network of
    the whole observation."""
    units: tuple[int, int] = (64, 32)
    """Units of its two hidden layers."""
    critic: tuple[int, int] = (64, 64)
    """Units of the two hidden layers of the value's network."""
    privileged: bool | None = None
    """Let the critic, which only serves training, see where the target goes and which scenario it is. Left out: with
    the network "entries"; a flat one would show it to the actor, too."""
    seed: int = 0
    """Of training, below 2^31 - steps - rows; evaluation seeds lie above."""
    torch_threads: int = 1
    """Cores for PPO's updates. A second gains a tenth at best, and multiplies the time as soon as anything else
    runs; it also trains another policy, since sums are split otherwise."""
    checkpoint_steps: int = 500_000
    """Periods between checkpoints."""

    # comparison
    points: int = 12
    """Points of the learning curve, closer at first: its lead over the best rule on held-out episodes, at each of the
    scenario's trade-offs; 0: none. None either where energy is scarce: its price is found at the end."""
    episodes: int | None = None
    """Held-out episodes of the paired comparison; 0: none. Left out: 1000, and fewer where they are long."""
    evaluation_seed: int = 0
    """Which held-out episodes."""

    @property
    def folder(self) -> Path:
        """Where everything of this run goes."""
        single = f"-lam{self.lam[0]:g}" if len(self.lam) == 1 else ""
        return self.runs / (self.name or self.scenario + single)


def main(arguments: list[str] | None = None) -> int:
    """Run; bad input is one line and exit status 2, Ctrl-C leaves a checkpoint and is 130."""
    settings = Training()
    try:
        with any_terminal():
            settings = tyro.cli(Training, args=arguments, description=__doc__)
            train(settings)
    except BrokenPipeError:
        return NOBODY_READS
    except (ValueError, OSError, MemoryError) as problem:
        print(f"train.py: {own_place(problem)}{problem}", file=sys.stderr)
        return 2
    except Exception as problem:
        if not own_place(problem):
            raise
        print(f"train.py: {own_error(problem)}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"train.py: stopped; the same command with --resume continues {settings.folder}", file=sys.stderr)
        return 130
    return 0


def train(settings: Training) -> None:
    """The whole story."""
    for name, value in check_parameters(Training, vars(settings), "train.py: ").items():
        setattr(settings, name, value)
    scenario = complete_settings(settings)
    check_settings(settings)
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


def complete_settings(settings: Training) -> Scenario:
    """Fill in what was left out, by scenario, and return that."""
    if settings.tracks and Scenario.named(settings.scenario).measurement.lasting_errors:
        raise ValueError(f"Training.tracks: {settings.scenario} is trained in its simulated form; wsn evaluate replays")
    scenario = make_scenario(settings.scenario, settings.set, settings.tracks)
    settings.lam = settings.lam or list(scenario.lam_span)
    if len(settings.lam) > 2:
        raise ValueError(f"Training.lam = {settings.lam}: must be one number, or two that it is drawn between")
    if settings.order is None:
        settings.order = scenario.measurement.order
    if settings.privileged is None:
        settings.privileged = settings.network == "entries"
    if settings.even_worlds is None:
        settings.even_worlds = settings.engine == "local"
    if settings.steering is None:
        settings.steering = float(scenario.scarce_energy)
    if settings.episodes is None:
        settings.episodes = min(1000, PERIODS // scenario.periods)
    if settings.vary is None:
        settings.vary = default_worlds(scenario)
    low, high = settings.lam[0], settings.lam[-1]
    return scenario.override(lam=low if len(settings.lam) == 1 else (low, high))


def learn_locally(settings: Training, scenario: Scenario, interface: Settings, folder: Path) -> PolicyNetwork:
    """stable-baselines3's PPO."""
    envs = SB3VecEnv(make_envs(settings, scenario, interface, settings.rows), stagger=True)
    model = make_model(settings, ReplayableRows(envs))
    facts = facts_of(settings_as_json(settings), scenario, Path(__file__))
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
            f"trained {left:,} periods in {seconds:.0f} s ({left / seconds:,.0f} a second), "
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
        facts=facts_of(settings_as_json(settings), scenario, Path(__file__)),
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
        print(f"trained {left:,} periods in {seconds:.0f} s ({left / seconds:,.0f} a second)")
        return training.actor_network()


def make_envs(settings: Training, scenario: Scenario, interface: Settings, rows: int) -> ConcatVectorEnv:
    """The rows, divided among the scenarios."""
    scenarios = [scenario, *(scenario.override(**world_of(text)) for text in settings.vary or ())]
    shares = np.diff(np.arange(len(scenarios) + 1) * rows // len(scenarios))
    parts = []
    for place, (one, share) in enumerate(zip(scenarios, shares)):
        rows_of: Callable[..., ClusterVectorEnv] = ClusterVectorEnv
        if settings.steering:
            rows_of = partial(PricedVectorEnv, steering=settings.steering)
        envs = rows_of(int(share), one, autoreset_mode="Disabled", **asdict(interface))
        told = PrivilegedVectorEnv(envs, place, len(scenarios)) if settings.privileged else envs
        parts.append(TrainingReward(told, calibrated=settings.reward == "belief"))
    return ConcatVectorEnv(parts)


def check_settings(settings: Training) -> None:
    """Refuse now what would fail after the training."""
    for name in "steps rows rollout batch epochs torch_threads checkpoint_steps".split():
        check_quantity("Training", name, getattr(settings, name), at_least=1, whole=True)
    check_quantity("Training", "points", settings.points, at_least=0, at_most=10_000, whole=True)
    check_quantity("Training", "batch", settings.batch, at_least=2)  # advantages are normalised by its sd
    for name in ("gamma", "gae_lambda"):
        check_quantity("Training", name, getattr(settings, name), at_least=0, at_most=1)
    check_quantity("Training", "steering", settings.steering, at_least=0, at_most=100)
    check_quantity("Training", "learning_rate", settings.learning_rate, above=0, at_most=1)
    check_quantity("Training", "entropy", settings.entropy, at_least=0, at_most=100)
    for name in ("units", "critic"):
        for units in getattr(settings, name):
            check_quantity("Training", name, units, at_least=1, at_most=4096, whole=True)
    check_quantity("Training", "torch_threads", settings.torch_threads, at_least=1, at_most=1024)
    for name, hint in get_type_hints(Training).items():
        if get_origin(hint) is Literal and getattr(settings, name) not in get_args(hint):
            allowed = ", ".join(get_args(hint))
            raise ValueError(f"Training.{name} = {getattr(settings, name)!r}: must be one of {allowed}")
    if settings.privileged and settings.network != "entries":
        raise ValueError("Training.privileged = True: must be False with the network 'flat', whose actor would see it")
    check_quantity("Training", "runners", settings.runners, at_least=0, whole=True)
    if settings.engine == "ray" and settings.network != "entries":
        raise ValueError(f"Training.network = {settings.network!r}: the engine ray trains only 'entries'")
    if settings.engine == "ray" and settings.even_worlds:
        raise ValueError("Training.even_worlds = True: must be False with --engine ray")
    shares = 1 if settings.engine == "local" else max(1, settings.runners)
    others = len(settings.vary or ())
    if settings.rows // shares <= others:
        least = shares * (others + 1)
        raise ValueError(f"Training.rows = {settings.rows}: must be at least {least}, one a scenario and runner")
    if settings.address and settings.engine != "ray":
        raise ValueError(f"Training.address = {settings.address!r}: must be left out but with --engine ray")
    # Every seed that training may use lies below those of evaluations.
    most = FIRST_SEED - settings.steps - settings.rows
    check_quantity("Training", "seed", settings.seed, at_least=0, at_most=most, whole=True)
    if settings.episodes:
        check_quantity("Training", "evaluation_seed", settings.evaluation_seed, at_least=0, at_most=9999, whole=True)
        evaluation_seeds(settings.evaluation_seed, settings.episodes)


def settings_as_json(settings: Training) -> dict:
    """JSON values of the settings; a resumed run has those of one that was never stopped."""
    values = json.loads(json.dumps(asdict(settings), default=str))
    return {name: value for name, value in values.items() if name != "resume"}


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


def make_baselines(scenario: Scenario) -> dict[str, Policy]:
    """Every installed policy by name; one that cannot be made is left out, and said."""
    made = {}
    names = [name for name in policy_names() if name not in (*SLOW, *SIZED)]
    for name in sorted(names + [f"{name}{size}" for name in SIZED for size in SIZES]):
        try:
            made[name] = make_policy(name, scenario)
        except ValueError as problem:
            print(f"train.py: left out of the comparison: {problem}", file=sys.stderr)
    return made


def trade_offs(settings: Training, scenario: Scenario) -> list[float]:
    """Where it is compared with others."""
    return settings.lam if len(settings.lam) == 1 else list(scenario.lam_octaves)


def compare(settings: Training, scenario: Scenario, policies: dict[str, Policy], made: dict) -> None:
    """Paired comparison with every baseline: table, CSV, JSON, picture, report."""
    folder = settings.folder
    # Where it is steered, the price is the network's own affair.
    lams = [0.0] if settings.steering else trade_offs(settings, scenario)
    with progress_bar() as report:
        evaluation = evaluate(
            policies, scenario, lams, settings.episodes or 0, settings.evaluation_seed, keep=folder, progress=report
        )
    evaluation.save(folder)
    save_markdown(evaluation, folder)
    write_picture(folder / "comparison.png", draw_comparison(evaluation, evaluation.middle_lam, emphasis="ppo"))
    with progress_bar() as report:
        page = write_report(folder, evaluation, policies, made, report)
    remove_kept_blocks(folder)
    print_tables(evaluation, reference="ppo")
    print(f"written: {folder / 'evaluation.csv'}, {folder / 'comparison.png'}, {page}")


if __name__ == "__main__":
    sys.exit(main())
