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
from wsn_env.cli import main
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
        scenario = Scenario.named("PreDC-v0", measurement=bearing(sd_deg=sd_deg), filter_q=0.05, **SMALL)
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
    assert "trained 1,024 time steps" in said and (folder / "runs" / "mine" / "policy.safetensors").exists()


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


WSN = [sys.executable, "-c", "import sys; sys.path.pop(0); from wsn_env.cli import main; sys.exit(main())"]  # as `wsn`
OWN = """
import helper
from wsn_env import Cluster

class Mine:
    '''With a helper beside it.'''

    def __init__(self, scenario, mode="none"):
        self.mode = mode
        if mode == "made":
            {}["made"]
        if mode == "type":
            len(3)

    def act(self, view):
        import late
        if self.mode == "act":
            return {}["act"]
        if self.mode == "beside":
            late.fail()
        return Cluster.of(view.nearest_living(), view.alive & False)

    def numbers(self):
        import late
        return helper.NUMBER, late.NUMBER
"""
FILES = {
    "mine.py": OWN,
    "helper.py": "NUMBER = 1\n",
    "late.py": "import helper\n\nNUMBER = 10 * helper.NUMBER\n\ndef fail():\n    raise KeyError('late')\n",
    "syntax.py": "x = 1\ndef f(:\n",
    "imports.py": "\nimport nosuchmodule\n",
    "beside.py": "import broken\n",
    "broken.py": "\n\n1 / 0\n",
    "key.py": "{}['key']\n",
    "exits.py": "import sys\nsys.exit(3)\n",
    "lines.py": "raise RuntimeError('one\\ntwo')\n",
    "empty.py": "",
    "deep.py": "def f():\n    f()\nf()\n",
    "name.py": "class Mine(Missing):\n    pass\n",
}


@pytest.fixture
def own(tmp_path):
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    return tmp_path


@pytest.mark.parametrize(
    ("policy", "said"),
    [
        ("syntax.py:X", "policy 'syntax.py:X': {}/syntax.py:2: SyntaxError: invalid syntax"),
        ("imports.py:X", "policy 'imports.py:X': {}/imports.py:2: ModuleNotFoundError: No module named 'nosuchmodule'"),
        ("beside.py:X", "policy 'beside.py:X': {}/broken.py:3: ZeroDivisionError: division by zero"),
        ("key.py:X", "policy 'key.py:X': {}/key.py:1: KeyError: 'key'"),
        ("exits.py:X", "policy 'exits.py:X': {}/exits.py:2: SystemExit: 3"),
        ("lines.py:X", "policy 'lines.py:X': {}/lines.py:1: RuntimeError: one"),
        ("empty.py:X", "policy 'empty.py:X': the file has no such class: known are none"),
        ("deep.py:X", "policy 'deep.py:X': {}/deep.py:2: RecursionError: maximum recursion depth exceeded"),
        ("name.py:X", "policy 'name.py:X': {}/name.py:1: NameError: name 'Missing' is not defined"),
        ("mine.py:Mine:mode=made", "policy 'mine.py:Mine:mode=made': {}/mine.py:11: KeyError: 'made'"),
        ("mine.py:Mine:mode=type", "policy 'mine.py:Mine:mode=type': {}/mine.py:13: cannot be made with"),
        ("mine.py:Mine:mode=act", "{}/mine.py:18: KeyError: 'act'"),
        ("mine.py:Mine:mode=beside", "{}/late.py:6: KeyError: 'late'"),
    ],
)
def test_an_error_in_own_code_is_a_line_with_its_place(own, monkeypatch, capsys, policy, said):
    monkeypatch.chdir(own)
    assert main(["evaluate", "--policies", policy, "--episodes", "1", "--set", "particles=50", "periods=3"]) == 2
    last = capsys.readouterr().err.strip().splitlines()[-1]
    assert last.startswith(f"wsn: {said.format(own)}")


SENSOR = """
from dataclasses import dataclass
from wsn_env.models import Line, Measurement
import helper

@dataclass(frozen=True)
class Own(Measurement):
    def __post_init__(self):
        {made}

    @staticmethod
    def sample(m, stream, node, x, y):
        return x + helper.NUMBER, 0.0

    @staticmethod
    def log_likelihood(m, value, second, node, x, y):
        return {value}

    @staticmethod
    def linearise(m, node, belief):
        return (Line(belief.x, 1.0, 0.0, 1.0),)
"""


@pytest.mark.parametrize(
    ("made", "value", "line", "said"),
    [
        ("{}['made']", "0.0", 9, "KeyError: 'made'"),
        ("pass", "missing * value", None, "TypingError: NameError: name 'missing' is not defined"),
        ("pass", "'a' * value", None, "TypingError: No implementation of function"),
    ],
)
def test_an_error_in_an_own_sensor_is_a_line_with_its_place(own, monkeypatch, capsys, made, value, line, said):
    monkeypatch.chdir(own)
    (own / "sensor.py").write_text(SENSOR.replace("{made}", made).replace("{value}", value))
    small = ["particles=50", "periods=3", "nodes=20", "side_m=50", "crossing_m=20", "measurement=sensor.py:Own"]
    assert main(["evaluate", "--policies", "nearest1", "--episodes", "1", "--set", *small]) == 2
    last = capsys.readouterr().err.strip().splitlines()[-1]
    assert last.startswith(f"wsn: {own}/sensor.py:{line or ''}") and said in last


def test_files_beside_an_own_one_are_found_by_the_console_script(own):
    command = [*WSN, "evaluate", "--policies", f"{own}/mine.py:Mine", "--episodes", "1"]
    elsewhere = own / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "helper.py").write_text("raise ValueError('the wrong helper')\n")
    done = subprocess.run(
        [*command, "--set", "particles=50", "periods=3"], cwd=elsewhere, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


def test_folders_with_files_of_the_same_names_do_not_mix(own, tmp_path_factory, monkeypatch):
    other = tmp_path_factory.mktemp("other")
    for name in ("mine.py", "late.py"):
        shutil.copy(own / name, other)
    (other / "helper.py").write_text("NUMBER = 2\n")
    (other / "random.py").write_text("raise ValueError('the wrong random')\n")
    monkeypatch.syspath_prepend(str(tmp_path_factory.mktemp("path")))
    first, second = (class_in(folder / "mine.py", "Mine")(None) for folder in (own, other))
    assert first.numbers() == (1, 10) and second.numbers() == (2, 20) and first.numbers() == (1, 10)
    assert "helper" not in sys.modules and "late" not in sys.modules
    import random

    assert random.random() < 1


@pytest.mark.parametrize("edited", ["mine.py", "helper.py", "late.py"])
def test_an_edited_file_is_read_again_in_the_same_session(own, edited):
    """Of the same size, within the same second: Python's bytecode would be taken for current."""
    before = class_in(own / "mine.py", "Mine")
    assert before(None).numbers() == (1, 10) and class_in(own / "mine.py", "Mine") is before
    texts = {"mine.py": ("(self):\n        import late", "(self):\n        late = helper"), "helper.py": ("1", "3")}
    old, new = texts.get(edited, ("10 *", "20 *"))
    stat = (own / edited).stat()
    (own / edited).write_text((own / edited).read_text().replace(old, new))
    os.utime(own / edited, ns=(stat.st_atime_ns, stat.st_mtime_ns))
    after = class_in(own / "mine.py", "Mine")
    assert after(None).numbers() == {"mine.py": (1, 1), "helper.py": (3, 30), "late.py": (1, 20)}[edited]


def test_packages_and_relative_imports_beside_an_own_file(own):
    (own / "tools").mkdir()
    (own / "tools" / "__init__.py").write_text("from .inner import VALUE\n")
    (own / "tools" / "inner.py").write_text("import helper\n\nVALUE = 5 + helper.NUMBER\n")
    (own / "uses.py").write_text(
        "import os.path, tools.inner as inner, tools\nfrom .helper import NUMBER\nfrom tools import VALUE\n"
        "class Own:\n    found = NUMBER, VALUE, inner.VALUE, tools.inner.VALUE\n"
    )
    assert class_in(own / "uses.py", "Own").found == (1, 6, 6, 6)
    (own / "broken.py").write_text("NOW = 7\n")
    with pytest.raises(ValueError, match="KeyError"):
        class_in(own / "key.py", "X")
    (own / "key.py").write_text("import broken\nclass X:\n    now = broken.NOW\n")
    assert class_in(own / "key.py", "X").now == 7
