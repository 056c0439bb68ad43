"""train.py end to end in a short form: files, resume, damaged files, the saved policy without torch."""

import json
import shutil
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import torch

import train
from wsn_env import ClusterVectorEnv, Scenario, View, evaluate, make_policy
from wsn_env.agents.ppo import PPOPolicy
from wsn_env.cli import parse_overrides
from wsn_env.learning.actor_critic import actor_network
from wsn_env.learning.network import EntryNetwork, PolicyNetwork

SET = ["particles=50", "nodes=40", "side_m=50", "crossing_m=20", "periods=10"]
SHORT = dict(steps=4096, rows=32, rollout=32, batch=512, epochs=2, episodes=60, checkpoint_steps=1024, set=SET)


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Path:
    runs = tmp_path_factory.mktemp("runs")
    train.train(train.Training(name="short", runs=runs, **SHORT))
    return runs / "short"


def test_a_run_leaves_its_files(run):
    files = "config.json policy.json policy.safetensors checkpoint.zip evaluation.csv evaluation.json report.html"
    for name in [*files.split(), "comparison.png"]:
        assert (run / name).stat().st_size > 0, name
    assert "<h2>Learning</h2>" in (run / "report.html").read_text()
    progress = next(run.glob("progress-*"))
    assert (progress / "progress.csv").exists() and list(progress.glob("events.out.tfevents.*"))
    assert not [path.name for path in run.iterdir() if path.name.startswith(".")]
    means = json.loads((run / "evaluation.json").read_text())["means"]
    assert {"ppo", "pre_dc", "centroid", "static_cluster", "nearest0", "nearest8"} <= {m["policy"] for m in means}


def test_the_saved_policy_is_the_trained_one_without_torch(run):
    """NumPy's logits are torch's; the file opens in a process that never imports torch."""
    from stable_baselines3 import PPO

    model = PPO.load(run / "checkpoint.zip")
    network = PolicyNetwork.load(run / "policy.safetensors")
    assert all(np.array_equal(array, actor_network(model).arrays[name]) for name, array in network.arrays.items())
    scenario = Scenario.named("PreDC-v0", **parse_overrides(SET))
    envs = ClusterVectorEnv(16, scenario, observation="menu")
    observation, _ = envs.reset(seed=0)
    with torch.no_grad():
        wanted = model.policy.get_distribution(torch.as_tensor(observation)).distribution.logits.numpy()
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


def test_a_stopped_training_goes_on(tmp_path, monkeypatch):
    settings = dict(name="stopped", runs=tmp_path) | SHORT | dict(episodes=0)
    real = train.Watch._on_rollout_end

    def stop(self):
        real(self)
        if self.num_timesteps >= 2048:
            raise KeyboardInterrupt

    monkeypatch.setattr(train.Watch, "_on_rollout_end", stop)
    with pytest.raises(KeyboardInterrupt):
        train.train(train.Training(**settings))
    monkeypatch.setattr(train.Watch, "_on_rollout_end", real)
    train.train(train.Training(**settings, resume=True))
    steps = sorted(int(path.name.split("-")[1]) for path in (tmp_path / "stopped").glob("progress-*"))
    assert steps == [0, 2048]
    assert json.loads((tmp_path / "stopped" / "policy.json").read_text())["training"]["steps"] == 4096


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
    half = json.loads((folder / "ray" / "periods.json").read_text())
    assert SHORT["steps"] // 2 <= half < SHORT["steps"] and not (folder / "policy.json").exists()
    with pytest.raises(ValueError, match="--resume"):
        train.train(train.Training(**settings))
    train.train(train.Training(**settings, resume=True))
    assert json.loads((folder / "ray" / "periods.json").read_text()) >= SHORT["steps"]
    left = {"config.json", "policy.json", "policy.safetensors", "ray", "report.html"}
    assert {path.name for path in folder.iterdir()} == left
    network = PolicyNetwork.load(folder / "policy.safetensors")
    assert isinstance(network, EntryNetwork) and network.sizes["outputs"] == 1
    scenario = Scenario.named("PreDC-v0", **parse_overrides(SET))
    assert evaluate([str(folder)], scenario, [4.0], episodes=3).values(str(folder), 4.0, "return").shape == (3,)


def test_damaged_files_say_so(run, tmp_path):
    runs = tmp_path / "runs"
    shutil.copytree(run, runs / "short")
    checkpoint = runs / "short" / "checkpoint.zip"
    checkpoint.write_bytes(checkpoint.read_bytes()[: checkpoint.stat().st_size // 2])
    with pytest.raises(ValueError, match="cut short"):
        train.train(train.Training(name="short", runs=runs, resume=True, **SHORT))
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


@pytest.mark.parametrize("asked, level", [({}, 1.0), ({"level": 0.0}, 0.0), ({"scenario": "Rssi-v0"}, 0.0)])
def test_advantages_are_levelled_as_asked_for_or_where_nodes_measure_positions(asked, level):
    settings = train.Training(**asked)
    scenario = train.complete_settings(settings)
    interface = train.Settings(action="menu", observation="menu", reward="belief", order=settings.order)
    envs = train.VecMonitor(
        train.SB3VecEnv(train.make_envs(settings, scenario, interface, settings.rows), stagger=True)
    )
    buffer = train.make_model(settings, envs, Path("nowhere")).rollout_buffer
    buffer.observations[0, :, :] = envs.reset()
    buffer.rewards[0] = 1.0 + np.arange(buffer.n_envs)
    before = buffer.rewards.copy()
    buffer.compute_returns_and_advantage(torch.zeros(buffer.n_envs), np.ones(buffer.n_envs))
    assert settings.level == level and (level == 0.0) == bool((buffer.advantages[0] == before[0]).all())


@pytest.mark.parametrize(
    "bad",
    [
        dict(rollout=0),
        dict(steps=0),
        dict(gamma=2.0),
        dict(level=1.5),
        dict(seed=2**31),
        dict(episodes=-1),
        dict(units=(0, 8)),
        dict(network="deep"),
        dict(action="subsets"),
        dict(engine="rays"),
        dict(engine="ray", network="flat"),
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
        dict(level=float("nan")),
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
        code = train.main()
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
    assert train.main() == 2
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
    with pytest.raises(ValueError, match="training diverged after .* periods.* learning_rate than 0.002") as told:
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
        EntryNetwork(network.arrays | {"belief.bias": np.full(32, np.nan)})
    with pytest.raises(ValueError, match="does not fit"):
        EntryNetwork(network.arrays | {"belief.bias": np.zeros(31)})
    for kind in ("pre_dc", 5, "nothing"):
        (tmp_path / "policy.json").write_text(json.dumps({"kind": kind}))
        with pytest.raises(ValueError, match="not a saved policy"):
            make_policy(str(tmp_path), scenario)
    with pytest.raises(ValueError, match="none comes with the package for Anchors-v0"):
        make_policy("ppo", Scenario.named("Anchors-v0")).act(None)


def test_help_explains_every_setting():
    answer = subprocess.run([sys.executable, train.__file__, "--help"], capture_output=True, text=True, check=True)
    for name in train.Training.__dataclass_fields__:
        assert f"--{name.replace('_', '-')}" in answer.stdout
    bad = subprocess.run([sys.executable, train.__file__, "--lam", "-3"], capture_output=True, text=True)
    assert bad.returncode == 2 and "lam" in bad.stderr and bad.stderr.count("\n") == 1
