"""train.py end to end in a short form: files, resume, damaged files, the saved policy without torch."""

import json
import shutil
import subprocess
import sys
import time
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import safetensors.numpy
import torch

import train as script
from wsn_env import ClusterVectorEnv, Scenario, View, evaluate, make_policy
from wsn_env.agents.ppo import PPOPolicy
from wsn_env.evaluation.versions import versions
from wsn_env.learning import run_folder
from wsn_env.learning.actor_critic import actor_network
from wsn_env.learning.checkpoint_file import pack, read_checkpoint, unpack, write_checkpoint
from wsn_env.learning.network import EntryNetwork, PolicyNetwork
from wsn_env.models.quantity import parse_overrides
from wsn_env.reports.pages.learning_curves import read_progress
from wsn_env.training import settings as training_settings
from wsn_env.training import trainer as train

SET = ["particles=50", "nodes=40", "side_m=50", "crossing_m=20", "periods=10"]
SHORT = dict(steps=4096, rows=32, rollout=32, batch=512, epochs=2, episodes=8, checkpoint_steps=1024, set=SET)


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Path:
    runs = tmp_path_factory.mktemp("runs")
    train.train(train.Training(name="short", runs=runs, **SHORT))
    return runs / "short"


def make_model(settings):
    """A new model as train.py makes it, and the facts of its checkpoints."""
    scenario = train.complete_settings(settings)
    interface = train.Settings(settings.action, "menu", settings.reward, settings.order)
    envs = train.SB3VecEnv(train.make_envs(settings, scenario, interface, settings.rows), stagger=True)
    return train.make_model(settings, train.ReplayableRows(envs)), train.facts_of(
        train.settings_as_json(settings), scenario
    )


def train_until(monkeypatch, periods, **settings):
    """Ctrl-C in the middle of a rollout, so many periods after the beginning."""
    real = train.Watch._on_step

    def stop(self):
        if self.num_timesteps >= periods:
            raise KeyboardInterrupt
        return real(self)

    with monkeypatch.context() as patch:
        patch.setattr(train.Watch, "_on_step", stop)
        with pytest.raises(KeyboardInterrupt):
            train.train(train.Training(**settings))


def test_a_run_leaves_its_files(run):
    files = (
        "config.json policy.json policy.safetensors checkpoint.safetensors evaluation.csv evaluation.json report.html"
    )
    for name in [*files.split(), "comparison.png"]:
        assert (run / name).stat().st_size > 0, name
    assert "<h2>Learning</h2>" in (run / "report.html").read_text()
    progress = next(run.glob("progress-*"))
    assert (progress / "progress.csv").exists() and list(progress.glob("events.out.tfevents.*"))
    assert not [path.name for path in run.iterdir() if path.name.startswith(".")]
    means = json.loads((run / "evaluation.json").read_text())["means"]
    assert {"ppo", "pre_dc", "centroid", "static_cluster", "nearest0", "nearest8"} <= {m["policy"] for m in means}


def test_the_learning_curve_ends_with_the_saved_policy_and_begins_early(run):
    """Its last point is the lead of the policy that is saved, on the same episodes; the first comes within the first
    rollouts, at every trade-off."""
    settings = train.Training(name="short", runs=run.parent, **SHORT)
    scenario = train.complete_settings(settings)
    interface = train.Settings(settings.action, "menu", settings.reward, settings.order)
    lead = train.make_held_out(settings, scenario, interface)(PolicyNetwork.load(run / "policy.safetensors"))
    progress = read_progress(run)
    assert list(lead) == list(scenario.lam_octaves)
    for lam, (mean, error) in lead.items():
        curve = progress[f"held_out/lam_{lam:g}"]
        assert np.isfinite(curve).sum() >= 3 and np.isfinite(curve[:2]).any()
        assert curve[-1] == pytest.approx(mean, rel=1e-6) and error > 0
    assert "return over the best rule" in (run / "report.html").read_text().lower()


def test_a_training_without_points_has_none(tmp_path):
    train.train(train.Training(name="short", runs=tmp_path, points=0, **SHORT | dict(steps=1024, episodes=0)))
    assert not [name for name in read_progress(tmp_path / "short") if name.startswith("held_out")]


def test_the_saved_policy_is_the_trained_one_without_torch(run):
    """NumPy's logits are torch's; the file opens in a process that never imports torch."""
    settings = train.Training(name="short", runs=run.parent, **SHORT)
    model, facts = make_model(settings)
    train.load_checkpoint(model, run, settings.steps, facts)
    network = PolicyNetwork.load(run / "policy.safetensors")
    assert all(np.array_equal(array, actor_network(model).arrays[name]) for name, array in network.arrays.items())
    scenario = Scenario.named("PreDC-v0", **parse_overrides(SET))
    envs = ClusterVectorEnv(16, scenario, observation="menu")
    observation, _ = envs.reset(seed=0)
    whole = torch.zeros(16, *model.observation_space.shape)  # what only the critic sees moves no logit
    whole[:, : observation.shape[1]] = torch.as_tensor(observation)
    with torch.no_grad():
        wanted = model.policy.get_distribution(whole).distribution.logits.numpy()
    ours = network.logits(observation)
    assert np.allclose(ours - ours.max(1, keepdims=True), wanted - wanted.max(1, keepdims=True), atol=1e-5)
    assert (ours == np.concatenate([network.logits(observation[i : i + 1]) for i in range(16)])).all()
    code = (
        "import sys\nfrom wsn_env.cli import main\n"
        f"main(['evaluate', '--policies', 'nearest1', 'ppo={run}', '--episodes', '3', '--set', *{SET!r}])\n"
        "assert 'torch' not in sys.modules and 'stable_baselines3' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)


def test_resume_continues_and_guards(run, tmp_path):
    runs = tmp_path / "runs"
    shutil.copytree(run, runs / "short")
    settings = dict(name="short", runs=runs) | SHORT
    with pytest.raises(ValueError, match="--resume"):
        train.train(train.Training(**settings))
    with pytest.raises(ValueError, match="learning_rate"):
        train.train(train.Training(**settings, resume=True, learning_rate=1.0))
    before = (runs / "short" / "policy.safetensors").read_bytes()
    train.train(train.Training(**settings, resume=True))  # all steps are done: only compares
    assert (runs / "short" / "policy.safetensors").read_bytes() == before


def same_files(one, other):
    """Policy and checkpoint are the same to the byte, and so is what was logged but for times."""
    for name in ("policy.safetensors", "checkpoint.safetensors"):
        assert (one / name).read_bytes() == (other / name).read_bytes(), name
    first, second = read_progress(one), read_progress(other)
    assert first.keys() == second.keys() and len(first["time/total_timesteps"]) > 1
    for name in first:
        if not name.startswith("time/") or name == "time/total_timesteps":
            assert np.array_equal(first[name], second[name], equal_nan=True), name


def test_a_stopped_training_ends_as_one_that_was_never_stopped(run, tmp_path, monkeypatch):
    settings = dict(name="short", runs=tmp_path) | SHORT | dict(episodes=0)
    train_until(monkeypatch, 1500, **settings)
    train_until(monkeypatch, 3500, **settings, resume=True)
    train.train(train.Training(**settings, resume=True))
    same_files(run, tmp_path / "short")
    steps = sorted(int(path.name.split("-")[1]) for path in (tmp_path / "short").glob("progress-*"))
    assert steps == [0, 1024, 3072]
    assert json.loads((tmp_path / "short" / "policy.json").read_text())["training"]["steps"] == 4096


@pytest.mark.parametrize(
    ("own", "other"),
    [
        ("ends_outside=True", "nodes=30,periods=7"),  # episodes of several lengths, that end outside
        ("targets=2", "targets=3,periods=7,association=unknown,clutter=0.2"),  # in fields of several targets
        ("tells_others=True", "targets=3,periods=7"),  # with what observations tell of the others
    ],
)
def test_so_does_one_in_unequal_worlds(tmp_path, monkeypatch, own, other):
    world = ["particles=50", "nodes=40", "side_m=40", "crossing_m=20", "periods=10", own]
    settings = dict(name="short", action="subset", network="flat", set=world, vary=[other])
    settings |= dict(steps=1536, rows=16, rollout=16, batch=128, epochs=2, episodes=0, checkpoint_steps=512)
    train.train(train.Training(**settings, runs=tmp_path / "whole"))
    train_until(monkeypatch, 1, **settings, runs=tmp_path / "stopped")
    train_until(monkeypatch, 700, **settings, runs=tmp_path / "stopped", resume=True)
    train.train(train.Training(**settings, runs=tmp_path / "stopped", resume=True))
    same_files(tmp_path / "whole" / "short", tmp_path / "stopped" / "short")


def test_so_does_one_that_was_killed(run, tmp_path):
    """Also with another checkpoint_steps, before the training's end or after it."""
    settings = SHORT | dict(episodes=0, checkpoint_steps=1)
    options = [f"--{name.replace('_', '-')}={value}" for name, value in settings.items() if name != "set"]
    command = [sys.executable, script.__file__, "--name=short", f"--runs={tmp_path}", *options, "--set", *SET]
    checkpoint = tmp_path / "short" / "checkpoint.safetensors"
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        while not checkpoint.exists() and process.poll() is None:
            time.sleep(0.01)
        process.kill()
    assert checkpoint.exists() and not (tmp_path / "short" / "policy.json").exists()
    train.train(train.Training(name="short", runs=tmp_path, resume=True, **settings))
    same_files(run, tmp_path / "short")


def test_what_a_stopped_training_logged_after_its_checkpoint_is_removed(tmp_path):
    for name in ("progress-0", "progress-1024", "progress-2048", "progress-old", "notes"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "progress.csv").write_text("a\n1\n")
    assert train.open_progress(tmp_path, 1024) == tmp_path / "progress-1024"
    assert {path.name for path in tmp_path.iterdir()} == {"progress-0", "progress-old", "notes"}


def resume(runs, **changed):
    """The message with which a run is not resumed."""
    with pytest.raises(ValueError) as caught:
        train.train(train.Training(name="short", runs=runs, resume=True, **(SHORT | changed)))
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 1000
    return str(caught.value)


def cut(share):
    return lambda content: content[: int(share * len(content))]


def flip(share):
    def flipped(content):
        place = int(share * len(content))
        return content[:place] + bytes([content[place] ^ 1]) + content[place + 1 :]

    return flipped


@pytest.mark.parametrize(
    "damage",
    [cut(0), cut(0.001), cut(0.5), cut(0.999), *map(flip, (0, 0.0002, 0.001, 0.01, 0.1, 0.3, 0.5, 0.7, 0.9, 0.999))]
    + [lambda content: b"PK\x03\x04" + content, lambda content: content + b" ", lambda content: b"[]" * 1000]
    + [lambda content: safetensors.numpy.save({"a": np.zeros(3)})]
    + [lambda content: safetensors.numpy.save({"a": np.zeros(3)}, {"checkpoint": "[" * 10**5})],
)
def test_a_damaged_checkpoint_is_refused(run, tmp_path, damage):
    shutil.copytree(run, tmp_path / "short")
    path = tmp_path / "short" / "checkpoint.safetensors"
    path.write_bytes(damage(path.read_bytes()))
    resume(tmp_path)  # the run has moved: config.json says so
    before = {file: file.read_bytes() for file in sorted(tmp_path.rglob("*.*")) if file.is_file()}
    assert resume(tmp_path).startswith(f"{path} is damaged or no checkpoint: remove it to begin anew (")
    assert before == {file: file.read_bytes() for file in sorted(tmp_path.rglob("*.*")) if file.is_file()}


CHANGES = {
    "far": dict(periods=10**12),
    "further": dict(periods=1024 * 10**9),
    "past its end": dict(periods=5120),
    "negative": dict(periods=-1024),
    "between updates": dict(periods=1000),
    "true": dict(periods=True),
    "no number": dict(periods="1024"),
    "shape": {"policy.mlp_extractor.belief.bias": np.zeros(31, np.float32)},
    "type": {"policy.mlp_extractor.belief.bias": np.zeros(32)},
    "NaN": {"policy.mlp_extractor.belief.bias": np.full(32, np.nan, np.float32)},
    "NaN moments": {"optimizer.0.exp_avg": lambda old: old * np.nan},
    "no weights": {"policy.mlp_extractor.belief.bias": None},
    "no generator": {"generators.torch": None},
    "short generator": {"generators.torch": np.zeros(7, np.uint8)},
    "generator's place": {"generators.numpy_place": np.array([10**9, 0, 0.0])},
    "action": {"actions": lambda old: np.full_like(old, 255)},
    "negative action": {"actions": lambda old: old.astype(np.int8) - 1},
    "other actions": {"actions": lambda old: (old + 1) % 2},
    "no actions": {"actions": lambda old: old[:0]},
    "ages": {"ages": lambda old: old * 0 - 1},
    "episodes": {"episodes": lambda old: old * 0 + 10**15},
    "other episodes": {"episodes": lambda old: old - 1},
    "observation": {"observation": lambda old: old + 1},
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_a_checkpoint_that_cannot_be_is_refused(run, tmp_path, change):
    settings = train.Training(name="short", runs=tmp_path, **SHORT)
    model, wanted = make_model(settings)
    arrays, facts = read_checkpoint(run / "checkpoint.safetensors", wanted)
    for name, value in change.items():
        if name == "periods":
            facts[name] = value
        elif value is None:
            del arrays[name]
        else:
            arrays[name] = value(arrays[name]) if callable(value) else value
    path = tmp_path / "checkpoint.safetensors"
    write_checkpoint(path, arrays, facts)
    with pytest.raises(ValueError) as caught:
        train.load_checkpoint(model, tmp_path, settings.steps, wanted)
    assert str(caught.value).startswith(f"{path} does not suit this training: remove it to begin anew (")
    assert "\n" not in str(caught.value)


def test_a_checkpoint_of_other_code_or_settings_is_refused(run, tmp_path, monkeypatch):
    shutil.copytree(run, tmp_path / "short")
    path = tmp_path / "short" / "checkpoint.safetensors"
    now = versions()
    for name, value in (("torch", "1.0"), ("wsn_env", "0.0.1"), ("python", "3.99.0")):
        with monkeypatch.context() as patch:
            patch.setattr(run_folder, "versions", lambda: now | {name: value})  # noqa: B023
            wanted = f"{path} was written with version {name} = {now[name]}, and now it is {value}: go back"
            assert resume(tmp_path).startswith(wanted)
    with monkeypatch.context() as patch:
        patch.setattr(run_folder, "sources_digest", lambda: "0" * 64)
        assert "version sources of wsn_env" in resume(tmp_path)
    with monkeypatch.context() as patch:
        preset = Scenario.named("PreDC-v0", decay_power=2.5)
        patch.setattr(training_settings, "make_scenario", lambda *_: preset.override(**parse_overrides(SET)))
        assert "quantity detection.decay_power = " in resume(tmp_path)
    config = tmp_path / "short" / "config.json"
    config.write_text(config.read_text().replace('"gamma": 0.98', '"gamma": 0.5'))
    assert resume(tmp_path, gamma=0.5).startswith(f"{path} was written with setting gamma = 0.98, and now it is 0.5")


def test_a_checkpoint_knows_the_files_beside_an_own_sensor(tmp_path):
    (tmp_path / "sharp.py").write_text(
        "from dataclasses import dataclass\nfrom wsn_env.models.measurement.position import Position\nimport beside\n"
        "@dataclass(frozen=True)\nclass Sharp(Position):\n    pass\n"
    )

    def files(number):
        (tmp_path / "beside.py").write_text(f"NUMBER = {number}\n")
        scenario = Scenario.named("PreDC-v0", measurement=f"{tmp_path / 'sharp.py'}:Sharp")
        return run_folder.facts_of({"tracks": []}, scenario)["file"]

    first, again, edited = files(1), files(1), files(2)
    assert first == again and first.keys() == edited.keys()
    assert {Path(path).name for path in first if first[path] != edited[path]} == {"beside.py"}


@pytest.mark.parametrize("content", [None, "", "[]", "null", "3", '{"steps": 4096', "[" * 10**5, b"\xff\xfe", "folder"])
def test_a_run_without_its_settings_is_not_resumed(run, tmp_path, content):
    shutil.copytree(run, tmp_path / "short")
    config = tmp_path / "short" / "config.json"
    config.unlink()
    if content == "folder":
        config.mkdir()
    elif content is not None:
        config.write_bytes(content if isinstance(content, bytes) else content.encode())
    state = "missing" if content is None else "damaged"
    assert resume(tmp_path).startswith(f"{config} is {state}: nobody knows the run's settings; --name begins another")


def test_checkpoints_that_could_execute_anything_are_not_opened(run, tmp_path, capsys, monkeypatch):
    shutil.copytree(run, tmp_path / "short")
    (tmp_path / "short" / "checkpoint.safetensors").rename(tmp_path / "short" / "checkpoint.zip")
    old = f"{tmp_path / 'short' / 'checkpoint.zip'}: checkpoints of this kind can execute anything and are not read"
    assert resume(tmp_path).startswith(old)
    options = [f"--{name.replace('_', '-')}={value}" for name, value in SHORT.items() if name != "set"]
    command = ["train.py", "--resume", "--name=short", f"--runs={tmp_path}", *options, "--set", *SET]
    monkeypatch.setattr(sys, "argv", command)
    assert script.main() == 2
    said = capsys.readouterr().err
    assert said.splitlines()[-1].startswith(f"train.py: {old}")


def periods_of(checkpoint):
    return read_checkpoint(checkpoint, {})[1]["periods"]


def test_a_tree_of_plain_values_and_arrays_is_kept_as_it_is():
    tree = {"a": {0: (1, 2.5, None), 1: [True, "x", {}]}, "lr": [(0.9, float("nan"))], "b": (), "c": []}
    arrays, plain = pack(tree | {"w": np.arange(3, dtype=np.int16), "n": np.float64(0.1)})
    again = unpack(arrays, json.loads(json.dumps(plain)))
    assert again.pop("w").dtype == np.int16 and again.pop("n") == 0.1 and repr(again) == repr(tree)
    with pytest.raises(TypeError, match="function"):
        pack({"a": print})


@pytest.mark.slow
@pytest.mark.xdist_group("ray")
def test_rllib_trains_the_same_network_and_goes_on_where_it_was_stopped(tmp_path, monkeypatch):
    pytest.importorskip("ray")
    settings = dict(SHORT, engine="ray", runners=1, episodes=0, name="short", runs=tmp_path)

    @contextmanager
    def stopping():
        def stop(done, total, what):
            if done >= total // 2:
                raise KeyboardInterrupt

        yield stop

    with monkeypatch.context() as patch:
        patch.setattr(train, "progress_bar", stopping)
        with pytest.raises(KeyboardInterrupt):
            train.train(train.Training(**settings))
    folder = tmp_path / "short"
    half = periods_of(folder / "ray.safetensors")
    assert SHORT["steps"] // 2 <= half < SHORT["steps"] and not (folder / "policy.json").exists()
    with pytest.raises(ValueError, match="--resume"):
        train.train(train.Training(**settings))
    train.train(train.Training(**settings, resume=True))
    assert periods_of(folder / "ray.safetensors") >= SHORT["steps"]
    left = {"config.json", "policy.json", "policy.safetensors", "ray.safetensors", "report.html"}
    assert {path.name for path in folder.iterdir()} == left
    network = PolicyNetwork.load(folder / "policy.safetensors")
    assert isinstance(network, EntryNetwork) and network.sizes["outputs"] == 1
    scenario = Scenario.named("PreDC-v0", **parse_overrides(SET))
    assert evaluate([str(folder)], scenario, [4.0], episodes=3).values(str(folder), 4.0, "return").shape == (3,)


def test_damaged_files_say_so(run, tmp_path):
    runs = tmp_path / "runs"
    shutil.copytree(run, runs / "short")
    scenario = Scenario.named("PreDC-v0", **parse_overrides(SET))
    weights = runs / "short" / "policy.safetensors"
    weights.write_bytes(weights.read_bytes()[:-100])
    view = View.of(ClusterVectorEnv(2, scenario).world.reset([0, 1]))
    with pytest.raises(ValueError, match="cut short"):
        make_policy(str(runs / "short"), scenario).act(view)
    saved = runs / "short" / "policy.json"
    saved.write_text(saved.read_text()[:50])
    with pytest.raises(ValueError, match="not a saved policy"):
        make_policy(str(saved), scenario)
    with pytest.raises(ValueError, match="is not a saved policy"):
        PPOPolicy(scenario, path=str(tmp_path / "none.json")).act(view)


@pytest.mark.parametrize(
    "bad",
    [
        dict(rollout=0),
        dict(steps=0),
        dict(gamma=2.0),
        dict(points=-1),
        dict(privileged=True, network="flat"),
        dict(seed=2**31),
        dict(episodes=-1),
        dict(units=(0, 8)),
        dict(network="deep"),
        dict(action="subsets"),
        dict(engine="rays"),
        dict(engine="ray", network="flat"),
        dict(even_worlds=True, engine="ray"),
        dict(address="auto"),
        dict(runners=-1),
        dict(rows=5, engine="ray"),
        dict(batch=1),
        dict(batch=-5),
        dict(rows=0),
        dict(steps=-1),
        dict(epochs=0),
        dict(checkpoint_steps=0),
        dict(torch_threads=10**9),
        dict(units=(8, 10**9)),
        dict(critic=(-1, 8)),
        dict(learning_rate=1e30),
        dict(learning_rate=0.0),
        dict(learning_rate=-1e-3),
        dict(learning_rate=float("nan")),
        dict(learning_rate=float("inf")),
        dict(entropy=float("nan")),
        dict(entropy=-0.1),
        dict(entropy=1e30),
        dict(gamma=float("nan")),
        dict(gae_lambda=-0.1),
        dict(lam=[float("nan")]),
        dict(lam=[-1.0]),
        dict(lam=[3.0, 1.0]),
        dict(lam=[1.0, 2.0, 3.0]),
        dict(seed=-1),
    ],
)
def test_bad_settings_are_refused_before_anything_is_done(bad, tmp_path):
    with pytest.raises(ValueError, match=next(iter(bad))):
        train.train(train.Training(name="bad", runs=tmp_path, **(SHORT | bad)))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "options",
    [
        "--batch 1",
        "--learning-rate 1e30",
        "--learning-rate nan",
        "--entropy nan",
        "--rows 0",
        "--lam a",
        "--vary nodes",
    ],
)
def test_bad_options_are_one_line(options, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["train.py", "--runs", str(tmp_path), "--episodes", "0", *options.split()])
    try:
        code = script.main()
    except SystemExit as stopped:  # what tyro finds out prints its usage
        code = stopped.code
    said = capsys.readouterr().err
    assert code == 2 and (options == "--lam a" or said.count("\n") == 1), said


@pytest.mark.parametrize("beside", ["", "short"])
def test_a_file_where_a_folder_is_wanted_is_one_line(beside, tmp_path, monkeypatch, capsys):
    runs = tmp_path / "runs"
    if beside:
        runs.mkdir()
    (runs / beside).write_text("")
    asked = ["--runs", str(runs), "--name", "short", "--episodes", "0", "--set", *SET]
    monkeypatch.setattr(sys, "argv", ["train.py", *asked])
    assert script.main() == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and str(runs) in said


@pytest.mark.parametrize("when", ["update", "end"])
def test_a_training_that_diverges_stops_and_keeps_the_checkpoint_before(when, tmp_path, monkeypatch, capsys):
    """Weights that are no numbers: said in one line, not saved."""
    kept = []
    real = train.PPO.train

    def diverge(model):
        real(model)
        if model.num_timesteps >= (2048 if when == "update" else SHORT["steps"]):
            kept.extend(path.read_bytes() for path in (tmp_path / "bad").glob("checkpoint*"))
            with torch.no_grad():
                next(iter(model.policy.parameters()))[:] = np.nan

    monkeypatch.setattr(train.PPO, "train", diverge)
    with pytest.raises(ValueError, match="training diverged after .* periods.* learning_rate than 0.005") as told:
        train.train(train.Training(name="bad", runs=tmp_path, **(SHORT | dict(episodes=0))))
    assert "\n" not in str(told.value)
    assert kept and [path.read_bytes() for path in (tmp_path / "bad").glob("checkpoint*")] == kept
    assert not (tmp_path / "bad" / "policy.json").exists()


def test_a_mistyped_run_leaves_no_trap(tmp_path):
    with pytest.raises(ValueError, match="rewad"):
        train.train(train.Training(name="short", runs=tmp_path, reward="rewad", **SHORT))
    train.train(train.Training(name="short", runs=tmp_path, **(SHORT | dict(steps=1024, episodes=0))))


def test_saved_policies_are_checked(run, tmp_path):
    scenario = Scenario.named("PreDC-v0", **parse_overrides(SET))
    network = PolicyNetwork.load(run / "policy.safetensors")
    with pytest.raises(ValueError, match="finite"):
        EntryNetwork(network.arrays | {"belief.bias": np.full(64, np.nan)})
    with pytest.raises(ValueError, match="does not fit"):
        EntryNetwork(network.arrays | {"belief.bias": np.zeros(63)})
    for kind in ("pre_dc", 5, "nothing"):
        (tmp_path / "policy.json").write_text(json.dumps({"kind": kind}))
        with pytest.raises(ValueError, match="not a saved policy"):
            make_policy(str(tmp_path), scenario)
    with pytest.raises(ValueError, match="none comes with the package for Mine-v0, only for Anchors-v0, Binary-v0, "):
        make_policy("ppo", replace(Scenario.named("Anchors-v0"), name="Mine-v0")).act(None)


def test_help_explains_every_setting(capsys):
    with pytest.raises(SystemExit) as ended:
        script.main(["--help"])
    shown = capsys.readouterr().out
    for name in train.Training.__dataclass_fields__:
        assert f"--{name.replace('_', '-')}" in shown
    assert not ended.value.code and script.main(["--lam", "-3"]) == 2
    told = capsys.readouterr().err
    assert "lam" in told and told.count("\n") == 1
