"""Misuse: every argument of every public callable with values of every wrong kind works, or is refused in words.

The calls are derived from the signatures, so that a new argument, quantity or option is tried without being entered.
"""

import inspect
import re
from dataclasses import fields
from functools import partial
from importlib.metadata import entry_points
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

import wsn_env
from wsn_env import (
    Cluster,
    ClusterEnv,
    ClusterVectorEnv,
    MultiEnv,
    MultiVectorEnv,
    Scenario,
    View,
    World,
    cli,
    error_bound,
    evaluate,
    make_policy,
    score,
)
from wsn_env.agents.ppo import PRETRAINED, save_policy
from wsn_env.bluetooth.calibration import Calibration
from wsn_env.bluetooth.fitting import calibrate
from wsn_env.bluetooth.recorded_evaluation import evaluate_recorded, replay_scenario
from wsn_env.bluetooth.residual_map import residual_map, save_map
from wsn_env.bluetooth.synthetic import write_dataset
from wsn_env.envs.actions import ACTIONS
from wsn_env.envs.interface import Settings
from wsn_env.evaluation.front import lam_sweep
from wsn_env.evaluation.policies import GROUP, named_policies, policy_names
from wsn_env.learning.concat_vector_env import ConcatVectorEnv
from wsn_env.learning.network import PolicyNetwork
from wsn_env.learning.training_reward import TrainingReward
from wsn_env.models.library import FAULTS
from wsn_env.models.recordings.dataset import read_dataset, read_track
from wsn_env.papers import reproduce
from wsn_env.reports.pages.replay_page import replay
from wsn_env.scenario.quantities import Quantities
from wsn_env.scenario.scenario import BY_NAME, named_scenarios

TINY = Scenario.named("PreDC-v0", periods=2, particles=20, nodes=16, side_m=40.0, crossing_m=15.0)
BOUNDED = TINY.override(motion="free", search=False, start="known")
VALUES = {
    "None": lambda: None,
    "3": lambda: 3,
    "-1": lambda: -1,
    "1.5": lambda: 1.5,
    "nan": lambda: float("nan"),
    "text 3": lambda: "3",
    "True": lambda: True,
    "[]": lambda: [],
    "{}": lambda: {},
    "object()": object,
    "int64(3)": lambda: np.int64(3),
    "array(3)": lambda: np.array(3),
    "array([3])": lambda: np.array([3]),
    "class": lambda: int,
    "function": lambda: lambda *given: None,
    "bytes": lambda: b"3",
    "folder": lambda: str(Path.cwd()),
    "path": Path.cwd,
}
TOLD = re.compile(
    "must|allowed|known are|did you mean|is unknown|not in|there is no|does not exist|cannot be|holds no|compared were"
    "|at least|is a folder|is no|is missing|as the environment wants"
)
OTHER_WORDS = {  # under which a message may name an argument, or what it does not go with
    "actions": "action",
    "calibrated": "calibrate",
    "depth_m": "positions",
    "lams": "lam",
    "name": "policy|paper|scenario",
    "policies": "policy",
    "reference": "policy",
    "side_m": "positions",
    "sound_ms": "period_s",
    "source_db": "threshold_db",
    "stem": "family",
    "texts": "policies|policy",
}
CALLED = ("act", "engine", "progress")  # by the function: what another one does is its own affair


def complaint(call, argument, value):
    """What is wrong with how a call ends; None: it works, or is refused as it should be."""
    try:
        call(**{argument: value})
    except (ValueError, TypeError) as problem:
        said = str(problem)
        words = f"{argument}|{OTHER_WORDS.get(argument, argument)}"
        files = (str(value),) if isinstance(value, (str, Path)) else ()
        if "\n" in said or len(said) > 500:
            return f"{problem!r:.300}: not a short line"
        if not re.search(words, said) and not any(name in said for name in files):
            return f"{problem!r}: does not name {words}"
        if not TOLD.search(said):
            return f"{problem!r}: does not tell what is allowed"
    except Exception as problem:
        return f"{problem!r}"
    return None


def check(calls):
    """Try every wrong value for every argument.

    Args:
        calls: name: (callable that has what else it needs, names of its arguments).
    """
    complaints = [
        f"{name}({argument}={label}): {wrong}"
        for name, (call, arguments) in calls.items()
        for argument in arguments
        for label, make in VALUES.items()
        if not (argument in CALLED and label in ("class", "function"))
        and (wrong := complaint(call, argument, make())) is not None
    ]
    assert not complaints, "\n".join(complaints[:30])
    return sum(len(arguments) for _, arguments in calls.values()) * len(VALUES)


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    return write_dataset(tmp_path_factory.mktemp("misuse") / "data", tracks=2, seconds=20, seed=1)


@pytest.fixture(autouse=True)
def somewhere(tmp_path, monkeypatch):
    """What "3" as a path makes goes into a folder of its own."""
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")


def with_arguments(call, **good):
    """A callable with good arguments, which it is called with once, and the names of all that it takes."""
    call(**good)
    taken = inspect.signature(call).parameters.values()
    named = [each.name for each in taken if each.kind not in (each.VAR_KEYWORD, each.VAR_POSITIONAL)]
    return partial(call, **good), named


def doors(where, dataset):
    """The public callables."""
    env, envs = ClusterEnv(TINY), ClusterVectorEnv(2, TINY, threads=1)
    env.reset(seed=1), envs.reset(seed=1)
    several, fields = MultiEnv(TINY, targets=2), MultiVectorEnv(1, TINY, targets=2, threads=1)
    world = World(TINY, threads=1)
    state = world.reset([1, 2])
    policy, view = make_policy("nearest1", TINY), View.of(state)
    tracks = read_dataset(dataset)
    calibration = calibrate(tracks)
    calibration.save(where / "calibration.json")
    shipped = PRETRAINED / "PreDC-v0" / "policy.safetensors"
    network = PolicyNetwork.load(shipped)
    evaluation = evaluate(["nearest0", "nearest1"], TINY, [1.0, 4.0], episodes=2, threads=1)
    compared = dict(policy="nearest0", lam=1.0)
    ble = Scenario.named("Ble-v0", calibration=where / "calibration.json", particles=20, periods=5)
    door = with_arguments
    return {
        "ClusterEnv": door(ClusterEnv, scenario=TINY),
        "ClusterEnv.reset": door(env.reset),
        "ClusterVectorEnv": door(ClusterVectorEnv, scenario=TINY, threads=1),
        "ClusterVectorEnv.reset": door(envs.reset),
        "MultiEnv": door(MultiEnv, scenario=TINY),
        "MultiEnv.reset": door(several.reset),
        "MultiEnv.step": door(lambda action: (several.reset(seed=1), several.step(action)), action=[1, 2]),
        "MultiVectorEnv": door(MultiVectorEnv, scenario=TINY, threads=1),
        "MultiVectorEnv.reset": door(fields.reset),
        "MultiVectorEnv.step": door(lambda actions: (fields.reset(seed=1), fields.step(actions)), actions=[[1, 2]]),
        "parallel_env": door(wsn_env.parallel_env, name=TINY),
        "gym.make": (
            partial(gym.make, "wsn_env/PreDC-v0"),
            [name for name in inspect.signature(ClusterEnv).parameters if name not in ("render_mode", "overrides")],
        ),
        "World": door(World, scenario=TINY),
        "World.reset": door(world.reset, keys=[1, 2]),
        "World.allocate": door(world.allocate, rows=2),
        "World.restart": door(world.restart, state=state, rows=[True, False], keys=[1, 2]),
        "World.step": door(world.step, state=state, cluster=policy.act(view)),
        "World.left": door(world.left, state=state),
        "View.of": door(View.of, state=state),
        "View.nearest": door(view.nearest, count=2),
        "View.from_arrays": door(View.from_arrays, arrays=view.as_arrays()),
        "Cluster": door(lambda head, members: Cluster(head, members).check(2), head=[1, 2], members=[[3], [4]]),
        "Cluster.of": door(Cluster.of, head=[1, 2], chosen=np.zeros((2, 16), bool)),
        "Scenario": door(lambda name: Scenario.named(name), name="PreDC-v0"),
        "make_policy": door(make_policy, name="nearest1", scenario=TINY),
        "named_policies": door(named_policies, texts=["nearest1"], scenario=TINY),
        "evaluate": door(evaluate, policies=["nearest1"], scenario=TINY, episodes=2, threads=1),
        "Evaluation.values": door(evaluation.values, **compared, column="rms_m"),
        "Evaluation.summary": door(evaluation.summary, **compared),
        "Evaluation.difference": door(evaluation.difference, **compared, reference="nearest1"),
        "Evaluation.ranked": door(evaluation.ranked, lam=1.0),
        "Evaluation.best_of": door(evaluation.best_of, stem="nearest", lam=1.0),
        "Evaluation.save": door(evaluation.save, out=where / "out"),
        "error_bound": door(error_bound, policy="nearest1", scenario=BOUNDED, episodes=2),
        "register": door(wsn_env.register, id="Misused-v0"),
        "as_policy": door(wsn_env.as_policy, model=lambda observations: np.zeros(len(observations), int)),
        "plot_comparison": door(wsn_env.plot_comparison, evaluation=evaluation),
        "plot_fronts": door(wsn_env.plot_fronts, evaluation=evaluation),
        "plot_episode": door(wsn_env.plot_episode, policy="nearest1", scenario=TINY),
        "score": door(score, act=lambda given: np.ones(2, int), envs=envs),
        "lam_sweep": door(lam_sweep, scenario=TINY),
        "replay": door(replay, policies={"a": policy}, scenario=TINY, seed=2, out=where / "page.html"),
        "reproduce": (partial(reproduce, out=where / "out"), ["name"]),
        "Settings": door(Settings),
        "PolicyNetwork.load": door(PolicyNetwork.load, path=shipped),
        "PolicyNetwork.save": door(network.save, path=where / "network.safetensors"),
        "read_dataset": door(read_dataset, folder=dataset),
        "read_track": door(read_track, path=tracks[0].path),
        "calibrate": door(calibrate, tracks=tracks),
        "Calibration.load": door(Calibration.load, path=where / "calibration.json"),
        "Calibration.save": door(calibration.save, path=where / "again.json"),
        "residual_map": door(residual_map, tracks=tracks, calibration=calibration),
        "save_map": door(save_map, field=residual_map(tracks, calibration), path=where / "map.npz"),
        "evaluate_recorded": door(
            evaluate_recorded, policies=["nearest1"], scenario=ble, folder=dataset, seeds=1, calibrated=True
        ),
        "replay_scenario": door(replay_scenario, scenario=ble, path=tracks[0].path),
        "ConcatVectorEnv": door(ConcatVectorEnv, parts=[envs]),
        "TrainingReward": door(TrainingReward, envs=envs),
        "save_policy": door(save_policy, folder=where, network=network, settings=Settings(), facts={}),
    }


def test_every_argument_of_what_is_public(tmp_path, dataset):
    calls = doors(tmp_path, dataset)
    named = {name.partition(".")[0] for name in calls}
    assert set(wsn_env.__all__) - named == {"__version__", "ScenarioError", "State", "Outcome", "register_envs"}
    assert check(calls) > 2000


@pytest.mark.parametrize("name", ACTIONS)
def test_every_action(name):
    def step(env, **given):
        env.reset(seed=1)
        env.step(**given)

    env, envs = ClusterEnv(TINY, action=name), ClusterVectorEnv(2, TINY, action=name, threads=1)
    check({"ClusterEnv.step": (partial(step, env), ["action"]), "envs.step": (partial(step, envs), ["actions"])})


def test_every_quantity(tmp_path):
    """Of the preset that has it, or of the kind."""
    presets = named_scenarios().values()
    registries = {**BY_NAME, "faults": FAULTS}
    kinds = [(role, kind, made) for role, registry in registries.items() for kind, made in registry.kinds.items()]
    (tmp_path / "track.csv").write_text("t,x,y\n0,1,1\n1,2,2\n2,3,3\n")
    needed = {"span_m": {"tracks": (str(tmp_path / "track.csv"),)}}
    calls = {}
    for name in Quantities.__annotations__:
        preset = next((each for each in presets if name in each.quantities()), Scenario.named("PreDC-v0"))
        kind = next(({role: kind} for role, kind, made in kinds if name in {item.name for item in fields(made)}), {})
        more = {} if name in preset.quantities() else kind | needed.get(name, {})
        calls[f"{preset.name}, {more}"] = partial(preset.override, **more), [name]
        calls[f"ClusterEnv, {preset.name}, {more}"] = (
            partial(ClusterEnv, preset if preset != TINY else "PreDC-v0", **more),
            [name],
        )
    check(calls)


def test_every_parameter_of_the_policies():
    def play(name, **given):
        scenario = Scenario.named("PreDC-v0", periods=2, particles=20) if name == "ppo" else TINY
        policy = make_policy(name, scenario, **given)
        policy.act(View.of(World(scenario, threads=1).reset([1, 2])))

    makers = {point.name: point.load() for point in entry_points(group=GROUP) if point.name in policy_names()}
    parameters = {name: [*inspect.signature(maker).parameters][1:] for name, maker in makers.items()}
    check({name: (partial(play, name), own) for name, own in parameters.items()})


class Checked(Exception):
    """The options were found good."""


def test_every_option_of_training(monkeypatch):
    from wsn_env.training import trainer as train

    def stop(*given):
        raise Checked

    monkeypatch.setattr(train, "open_folder", stop)
    monkeypatch.setattr(train, "make_baselines", lambda scenario: {})

    def begin(**given):
        try:
            train.train(train.Training(**given))
        except Checked:
            return

    check({"train": (begin, [item.name for item in fields(train.Training)])})


TEXTS = ["", "x", "-1", "0", "nan", "1.5", "1e99", "None", "=", "a=b", "[]", "/dev/null", "here.py:X", "."]
COMMANDS = {
    cli.Evaluate: ["evaluate", "--episodes", "1", "--policies", "nearest0", "--lam", "1"],
    cli.Replay: ["replay", "--policy", "nearest0", "--out", "page.html"],
    cli.Calibrate: ["calibrate", "--tracks", "nowhere", "--out", "out"],
    cli.Reproduce: ["reproduce", "nobody", "--out", "out"],
}
SMALL = ["--set", "particles=20", "nodes=16", "side_m=40", "crossing_m=15", "periods=2"]


@pytest.mark.parametrize("kind", COMMANDS)
def test_every_option_of_the_commands(kind, capsys, monkeypatch):
    """Also of tyro's: exit status 2."""
    monkeypatch.setattr("wsn_env.reports.pictures.can_draw", lambda: False)  # it takes seconds
    complaints = []
    for item in fields(kind):
        for text in TEXTS:
            option = [text] if item.name == "paper" else [f"--{item.name.replace('_', '-')}", text]
            small = SMALL if "set" in {each.name for each in fields(kind)} - {item.name} else []
            if item.name == "set" and text in ("", "None", "."):
                continue
            try:
                status = cli.main([*COMMANDS[kind], *small, *option])
            except SystemExit as stop:
                status = f"tyro {stop.code}"
            except BaseException as problem:
                complaints.append(f"{option}: {problem!r}")
                continue
            said = capsys.readouterr().err
            good = status in (0, "tyro 2") or (status == 2 and said.startswith("wsn: ") and said.count("\n") == 1)
            if not good:
                complaints.append(f"{option}: {status}: {said[-300:]}")
    assert not complaints, "\n".join(complaints)
