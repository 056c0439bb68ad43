"""The settings of a training: the options of `wsn train`, each with its meaning and what is allowed."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Literal, get_args, get_origin, get_type_hints

from wsn_env.evaluation.rollout import FIRST_SEED, evaluation_seeds
from wsn_env.learning.worlds import default_worlds, world_of
from wsn_env.models.measurement.base import Order
from wsn_env.models.quantity import check_quantity
from wsn_env.scenario import Scenario
from wsn_env.scenario.options import make_scenario

PERIODS = 500_000  # of the comparison, unless another number of episodes is asked for


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


def check_settings(settings: Training, scenario: Scenario) -> None:
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
    if settings.engine == "ray":
        scenario.check_one_target("a training with --engine ray")
    shares = 1 if settings.engine == "local" else max(1, settings.runners)
    worlds = [scenario, *(scenario.override(**world_of(text)) for text in settings.vary or ())]
    targets = max(world.targets for world in worlds)
    least = shares * len(worlds) * targets
    if settings.rows < least:
        raise ValueError(
            f"Training.rows = {settings.rows}: must be at least {least}, one a scenario, target and runner"
        )
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


def trade_offs(settings: Training, scenario: Scenario) -> list[float]:
    """Where it is compared with others."""
    return settings.lam if len(settings.lam) == 1 else list(scenario.lam_octaves)
