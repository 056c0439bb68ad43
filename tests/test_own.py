"""Sensors, motions and policies from a user's own files, copied to another folder, work everywhere."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

from wsn_env import Scenario, View, World, evaluate, make_policy
from wsn_env.models.own import class_in
from wsn_env.models.quantity import ScenarioError

EXAMPLES = Path(__file__).parents[1] / "examples"
SMALL = {"particles": 400, "periods": 25}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder elsewhere with copies of the three examples."""
    folder = tmp_path_factory.mktemp("elsewhere")
    for path in EXAMPLES.glob("own_*.py"):
        assert len(path.read_text().splitlines()) < 60
        shutil.copy(path, folder)
    return folder


@pytest.fixture(scope="module")
def bearing(folder):
    return class_in(folder / "own_sensor.py", "Bearing")


def run(folder, *arguments):
    command = [sys.executable, *map(str, arguments)]
    done = subprocess.run(command, cwd=folder, env=os.environ | {"COLUMNS": "200"}, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


def test_the_particle_filter_tracks_by_bearings_near_the_reference(bearing):
    """Three bearings of 2 degrees at some 5 m: errors of a few decimetres."""
    scenario = Scenario.named("PreDC-v0", measurement=bearing(sd_deg=2), **SMALL | {"particles": 2000})
    rows = evaluate(["all", "informed2", "greedy"], scenario, episodes=6, threads=1).rows
    rms = {name: np.mean([row["rms_m"] for row in rows if row["policy"] == name]) for name in ("all", "informed2")}
    reference = np.mean([row["reference_m"] for row in rows if row["policy"] == "all"])
    assert 0.9 * reference < rms["all"] < 1.5 * reference and rms["all"] < rms["informed2"] < 1.5


def test_a_sharper_sensor_tracks_better(bearing):
    rms = []
    for sd_deg in (1, 20):
        scenario = Scenario.named("PreDC-v0", measurement=bearing(sd_deg=sd_deg), **SMALL)
        rms.append(np.mean([row["rms_m"] for row in evaluate(["all"], scenario, episodes=4, threads=1).rows]))
    assert rms[0] < 0.5 * rms[1]


def test_the_extended_filter_unwraps_angles(bearing):
    """Targets left of a node are seen at +-pi: an innovation of a whole turn would throw the estimate out."""
    scenario = Scenario.named("PreDC-v0", measurement=bearing(sd_deg=2), tracker="ekf", **SMALL)
    rows = evaluate(["all"], scenario, episodes=6, threads=1).rows
    assert max(row["rms_m"] for row in rows) < 1.0


def test_the_menu_and_the_order_of_information_see_across(bearing):
    """Two bearings from one side tell less than two at a right angle; the second candidate is the one across."""
    scenario = Scenario.named("PreDC-v0", measurement=bearing(), positions=((50.0, 44.0), (50.0, 43.0), (44.0, 50.0)))
    state = World(scenario.override(start="field", **SMALL)).reset([1])
    state.belief.row["predicted_mean"], state.belief.row["predicted_cov"] = (
        (50, 0, 50, 0),
        np.diag([4.0, 0.1, 4.0, 0.1]),
    )
    cluster = make_policy("informed1", scenario).act(View.of(state))
    assert {int(cluster.head[0]), *cluster.members[0].tolist()} - {-1} == {0, 2}
    env = gym.make("wsn_env/PreDC-v0", measurement=bearing(), observation="menu", **SMALL)
    low, high = (env.reset(seed=seed)[0] for seed in (1, 2))
    assert np.isfinite(low).all() and (low != high).any()


def test_a_motion_of_ones_own_goes_its_way(folder):
    patrol = class_in(folder / "own_motion.py", "Patrol")
    state = World(Scenario.named("PreDC-v0", motion=patrol(square_m=40.0), particles=50)).reset([3, 4])
    x, y = state.track[:, :, 0] - 50, state.track[:, :, 2] - 50
    assert np.allclose(np.maximum(abs(x), abs(y)), 20) and not np.allclose(x[0], x[1])
    with pytest.raises(ScenarioError, match=r"Patrol.square_m = 140.0: must be at most 100.0 m"):
        World(Scenario.named("PreDC-v0", motion=patrol(square_m=140.0)))


def test_the_command_line_takes_all_three(folder, bearing):
    said = run(
        folder, "-m", "wsn_env", "evaluate", "--policies", "own_policy.py:Beside:apart_m=4", "greedy", "--episodes", 2,
        "--set", "measurement=own_sensor.py:Bearing,sd_deg=5", "motion=own_motion.py:Patrol,square_m=40", "periods=10",
        "particles=100", "--out", folder / "out",
    )  # fmt: skip
    assert "own_policy.py:Beside:apart_m=4" in said and "greedy" in said
    saved = json.loads((folder / "out" / "evaluation.json").read_text())["scenario"]
    assert saved["measurement"]["sd_deg"] == 5 and saved["motion"]["square_m"] == 40
    said = run(
        folder, "-m", "wsn_env", "replay", "--policy", "own_policy.py:Beside", "--out", folder / "replay.html",
        "--set", "measurement=own_sensor.py:Bearing", "particles=100", "periods=10",
    )  # fmt: skip
    assert "RMS" in said and (folder / "replay.html").stat().st_size > 20_000


def test_train_learns_with_it(folder):
    train = EXAMPLES.parent / "train.py"
    said = run(
        folder, train, "--steps", 1024, "--rows", 16, "--rollout", 16, "--batch", 128, "--epochs", 1, "--episodes", 2,
        "--runs", folder / "runs", "--name", "mine", "--set", "measurement=own_sensor.py:Bearing,sd_deg=2",
        "particles=50", "periods=8",
    )  # fmt: skip
    assert "trained 1,024 periods" in said and (folder / "runs" / "mine" / "policy.safetensors").exists()


def test_frames_are_drawn(bearing):
    env = gym.make("wsn_env/PreDC-v0", measurement=bearing(), render_mode="rgb_array", frame_px=200, **SMALL)
    env.reset(seed=1)
    env.step(12)
    assert env.render().std() > 5


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("own_sensor.py:Baering", "did you mean Bearing"),
        ("nowhere.py:Bearing", "there is no file nowhere.py"),
        ("own_motion.py:Patrol", "Patrol must be a Measurement"),
        ("own_sensor.py:Bearing,sd_degg=3", "Bearing has no quantity 'sd_degg': did you mean sd_deg"),
        ("own_sensor.py:Bearing,sd_deg=-3", "Bearing.sd_deg = -3: must be a finite number above 0"),
    ],
)
def test_mistakes_are_named(folder, monkeypatch, text, words):
    monkeypatch.chdir(folder)
    with pytest.raises(ValueError, match=words):
        Scenario.named("PreDC-v0", measurement=text)
