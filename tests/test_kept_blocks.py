"""Kept blocks are taken again where nothing that made them has changed, and never else; runs do not mix."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from wsn_env import Scenario, View, evaluate, make_policy
from wsn_env.bluetooth.fitting import calibrate
from wsn_env.bluetooth.residual_map import residual_map, save_map
from wsn_env.bluetooth.synthetic import write_dataset
from wsn_env.cli import main
from wsn_env.evaluation.files import LOCK_FILE, alone_in, replacing
from wsn_env.evaluation.kept_blocks import BLOCKS_FILE
from wsn_env.evaluation.policies import named_policies
from wsn_env.models import own_files
from wsn_env.models.own_files import file_digest
from wsn_env.models.recordings.dataset import read_dataset

SCENARIO = Scenario.named("PreDC-v0", particles=30, nodes=20, side_m=40.0, crossing_m=15.0, periods=3)
SMALL = ["--set", "particles=30", "nodes=20", "side_m=40", "crossing_m=15", "periods=3"]


@pytest.fixture
def played(monkeypatch):
    """Names of the policies of the blocks that are played, not taken. Files that other tests have read and
    changed are forgotten."""
    import wsn_env.evaluation.rollout as module

    own_files.watch("tests")
    for name in ("tests", own_files.IMPORTED):
        current = {path: digest for path, digest in own_files._read[name].items() if file_digest(path) == digest}
        monkeypatch.setitem(own_files._read, name, current)

    names, rollout = [], module.rollout
    monkeypatch.setattr(module, "rollout", lambda *given: names.append(type(given[0]).__name__) or rollout(*given))
    return names


def run_again(played, keep, policies, scenario=SCENARIO, **further):
    """(rows, blocks played)."""
    played.clear()
    named = named_policies(policies, scenario) if isinstance(policies, list) else policies
    rows = evaluate(named, scenario, [1.0], episodes=3, keep=keep, threads=1, **further).rows
    return rows, len(played)


READERS = {  # of a number in data.txt
    "when imported": "N = int(open(HERE / 'data.txt').read())\nclass P(Base):\n    def n(self): return N",
    "when made": "class P(Base):\n    def __init__(self, scenario):\n        super().__init__(scenario)\n"
    "        self.k = int(np.loadtxt(HERE / 'data.txt'))\n    def n(self): return self.k",
    "when it acts": "class P(Base):\n    def n(self): return int((HERE / 'data.txt').read_text())",
    "by a parameter": "@dataclass\nclass P:\n    scenario: object\n    path: str = PATH\n"
    "    def act(self, view):\n        n = int(Path(self.path).read_text())\n"
    "        return make_policy(f'nearest{n}', self.scenario).act(view)",
    "by a module beside it": "import beside_IT\nclass P(Base):\n    def n(self): return beside_IT.number()",
}
OWN = """
import sys
from dataclasses import dataclass
from pathlib import Path
import numpy as np
from wsn_env import make_policy
HERE = Path(__file__).parent
PATH = str(HERE / "data.txt")
sys.path.insert(0, str(HERE))
class Base:
    def __init__(self, scenario): self.scenario = scenario
    def act(self, view): return make_policy(f"nearest{self.n()}", self.scenario).act(view)
"""


@pytest.mark.parametrize("when", READERS)
def test_what_own_code_reads_decides_and_nothing_else(when, tmp_path, played):
    beside = f"beside_{list(READERS).index(when)}"
    (tmp_path / "mine.py").write_text(OWN + READERS[when].replace("beside_IT", beside))
    (tmp_path / f"{beside}.py").write_text(
        "from pathlib import Path\ndef number(): return int(Path(__file__).with_name('data.txt').read_text())"
    )
    (tmp_path / "data.txt").write_text("1")
    (tmp_path / "other.txt").write_text("1")
    policy = [f"{tmp_path / 'mine.py'}:P"]
    rows, count = run_again(played, tmp_path / "out", policy)
    assert count == 1 and rows[0]["members"] <= 2
    (tmp_path / "other.txt").write_text("2")
    assert run_again(played, tmp_path / "out", policy) == (rows, 0)
    (tmp_path / "data.txt").write_text("7")
    if when == "when imported":
        sys.modules.pop(type(named_policies(policy, SCENARIO)[policy[0]]).__module__)  # as in a new process
    changed, count = run_again(played, tmp_path / "out", policy)
    assert count == 1 and changed[0]["members"] > 2
    assert run_again(played, tmp_path / "out", policy) == (changed, 0)


def test_two_files_that_share_a_third_are_both_played_again(tmp_path, played):
    for name in ("first", "second"):
        (tmp_path / f"{name}.py").write_text(OWN + "import shared\nclass P(Base):\n    def n(self): return shared.N")
    (tmp_path / "shared.py").write_text("N = 1")
    for name in ("first", "second"):
        policy = [f"{tmp_path / name}.py:P"]
        assert [run_again(played, tmp_path / name, policy)[1] for _ in range(2)] == [1, 0]
    (tmp_path / "shared.py").write_text("N = 7")
    for name in ("first", "second"):
        rows, count = run_again(played, tmp_path / name, [f"{tmp_path / name}.py:P"])
        assert count == 1 and rows[0]["members"] > 2


def test_files_of_one_name_are_two_modules_and_an_edited_one_is_read_again(tmp_path, played):
    for folder, n in (("a", 1), ("b", 7)):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "mine.py").write_text(OWN + f"class P(Base):\n    def n(self): return {n}")
    labels = {name: f"{name}={tmp_path / name / 'mine.py'}:P" for name in "ab"}
    rows, _ = run_again(played, tmp_path / "out", list(labels.values()))
    awake = {name: np.mean([row["members"] for row in rows if row["policy"] == name]) for name in "ab"}
    assert awake["a"] <= 2 < awake["b"]
    (tmp_path / "a" / "mine.py").write_text(OWN + "class P(Base):\n    def n(self): return 7")
    again, count = run_again(played, tmp_path / "out", list(labels.values()))
    values = [[row["return"] for row in again if row["policy"] == name] for name in "ab"]
    assert count == 2 and values[0] == values[1]


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    folder = tmp_path_factory.mktemp("dataset")
    write_dataset(folder, tracks=2, seconds=20, seed=1)
    tracks = read_dataset(folder)
    calibration = calibrate(tracks)
    save_map(residual_map(tracks, calibration), folder / "map.npz")
    return folder, calibration.quantities, tracks[0].path


@pytest.mark.parametrize("changed", ["recording", "tetam.dev", "map.npz"])
def test_recordings_and_maps_decide(dataset, changed, tmp_path, played):
    folder, quantities, recording = dataset
    for path in folder.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    recording = tmp_path / recording.name

    def scenario():
        maps = {"residual_map": str(tmp_path / "map.npz")}
        given = quantities | maps | {"motion": "replay", "recording": str(recording), "periods": 8}
        return Scenario.named("Ble-v0", particles=50, **given)

    first, count = run_again(played, tmp_path / "out", ["informed1"], scenario())
    assert (count, run_again(played, tmp_path / "out", ["informed1"], scenario())) == (1, (first, 0))
    if changed == "recording":
        lines = recording.read_text().splitlines()
        recording.write_text("\n".join(line.replace(f",{line.split(',')[3]},", ",-70,", 1) for line in lines) + "\n")
        os.utime(recording, ns=(1, 1))
    elif changed == "map.npz":
        field = np.load(tmp_path / "map.npz")["residual_db"]
        save_map(field + np.float32(9.0), tmp_path / "map.npz")
    else:
        (tmp_path / "tetam.dev").write_text((tmp_path / "tetam.dev").read_text() + "\n")
    rows, count = run_again(played, tmp_path / "out", ["informed1"], scenario())
    assert count == 1 and (rows != first or changed == "tetam.dev")


def test_the_interface_of_a_trained_policy_decides(tmp_path, played):
    shipped = Path(sys.modules["wsn_env"].__file__).parents[1] / "agents" / "pretrained" / "PreDC-v0"
    for name in ("policy.json", "policy.safetensors"):
        (tmp_path / name).write_bytes((shipped / name).read_bytes())
    scenario = Scenario.named("PreDC-v0", particles=30, periods=3)
    policy = [str(tmp_path / "policy.json")]
    first, _ = run_again(played, tmp_path / "out", policy, scenario)
    assert run_again(played, tmp_path / "out", policy, scenario) == (first, 0)
    saved = json.loads((tmp_path / "policy.json").read_text())
    saved["interface"]["order"] = {"nearest": "information"}.get(saved["interface"]["order"], "nearest")
    (tmp_path / "policy.json").write_text(json.dumps(saved))
    assert run_again(played, tmp_path / "out", policy, scenario)[1] == 1


class Plain:
    """No dataclass, no repr."""

    def __init__(self, weights):
        self.weights = weights

    def act(self, view: View):
        return make_policy(f"nearest{int(self.weights.sum() > 0.5) * 7}", SCENARIO).act(view)


class Named(Plain):
    """A repr that hides what matters."""

    def __repr__(self):
        return "Named()"


@pytest.mark.parametrize("kind", [Plain, Named])
@pytest.mark.parametrize("size", [2, 5000])
def test_the_state_of_an_object_decides(kind, size, tmp_path, played):
    """Whatever its repr says or leaves out; in long arrays, too."""
    weights = np.zeros(size)
    first, _ = run_again(played, tmp_path, {"mine": kind(weights)})
    assert run_again(played, tmp_path, {"mine": kind(weights.copy())}) == (first, 0)
    weights = weights.copy()
    weights[size // 2] = 1.0
    rows, count = run_again(played, tmp_path, {"mine": kind(weights)})
    assert count == 1 and rows != first


@pytest.mark.parametrize(
    "damage",
    [
        lambda line: line.replace(b'"error_m": ', b'"error_m": 1', 1),
        lambda line: line.replace(b'"handovers": 0', b'"handovers": 1', 1),
        lambda line: line[:2] + b"0" * 64 + line[66:],
        lambda line: line.replace(b'"rms_m"', b'"rms"', 1),
        lambda line: line.replace(b'"energy_mj": ', b'"energy_mj": NaN, "x": ', 1),
        lambda line: line[:80] + b"\xff\xfe" + line[82:],
        lambda line: b"[" * 100_000,
        lambda line: line[: len(line) // 2],
        lambda line: b"5",
        lambda line: b"\0" * 500,
    ],
)
def test_a_damaged_line_is_played_again_and_said_once(damage, tmp_path, played, capsys):
    first, _ = run_again(played, tmp_path, ["nearest0", "nearest1"])
    blocks = tmp_path / BLOCKS_FILE
    lines = blocks.read_bytes().splitlines()
    blocks.write_bytes(lines[0] + b"\n" + damage(lines[1]) + b"\n")
    capsys.readouterr()
    assert run_again(played, tmp_path, ["nearest0", "nearest1"]) == (first, 1)
    said = capsys.readouterr().err
    assert said == f"wsn_env: {blocks}: 1 line is damaged: played again where needed\n"
    assert run_again(played, tmp_path, ["nearest0", "nearest1"]) == (first, 0) and not capsys.readouterr().err


def test_swapped_episodes_are_damage(tmp_path, played):
    first, _ = run_again(played, tmp_path, ["nearest0"])
    blocks = tmp_path / BLOCKS_FILE
    checksum, body = json.loads(blocks.read_text())
    body[-1][:2] = body[-1][1::-1]
    blocks.write_text(json.dumps([checksum, body]) + "\n")
    assert run_again(played, tmp_path, ["nearest0"]) == (first, 1)


def test_lines_of_another_command_are_not_taken(tmp_path, played, capsys):
    first, _ = run_again(played, tmp_path, ["nearest0"])
    theirs = (tmp_path / BLOCKS_FILE).read_bytes()
    other = SCENARIO.override(nodes=30)
    second, _ = run_again(played, tmp_path, ["nearest0"], other)
    assert "1 line is of another command, other files or another version" in capsys.readouterr().err
    with open(tmp_path / BLOCKS_FILE, "ab") as file:
        file.write(theirs)
    assert run_again(played, tmp_path, ["nearest0"], other) == (second, 0)
    assert second != first and len((tmp_path / BLOCKS_FILE).read_bytes().splitlines()) == 1


HOLDS = """
import sys, time
from wsn_env.evaluation.files import alone_in
with alone_in(sys.argv[1]):
    print("held", flush=True)
    time.sleep(600)
"""


@pytest.fixture
def holder(tmp_path):
    """A process that writes into the folder."""
    with subprocess.Popen([sys.executable, "-c", HOLDS, tmp_path], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "held\n"
        yield process
        process.kill()


def test_a_second_run_in_a_folder_says_so_and_a_killed_one_holds_nothing(tmp_path, holder, capsys):
    folder = str(tmp_path)
    commands = [
        ["evaluate", "--policies", "nearest0", "--episodes", "2", "--out", folder, *SMALL],
        ["calibrate", "--tracks", folder, "--out", folder],
    ]
    for command in commands:
        assert main(command) == 2
        said = capsys.readouterr().err
        assert said == (
            f"wsn: {folder}: another run (process {holder.pid}) writes into this folder: wait for its end, or name"
            " another folder\n"
        )
    with pytest.raises(ValueError, match="another run"):
        evaluate(["nearest0"], SCENARIO, [1.0], episodes=2, keep=tmp_path)
    holder.kill()
    holder.wait()
    assert (tmp_path / LOCK_FILE).exists() and main(commands[0]) == 0
    left = {"evaluation.csv", "evaluation.json", "evaluation.md", "report.html"}
    assert {path.name for path in tmp_path.iterdir()} == left


def test_one_process_may_enter_its_folder_twice(tmp_path):
    with alone_in(tmp_path), alone_in(tmp_path / "." / ""):
        assert (tmp_path / LOCK_FILE).read_text() == str(os.getpid())
    assert not list(tmp_path.iterdir())


KINDS = {"folder": "is a folder", "pipe": "is a device or a pipe", "link": "is a symbolic link"}


def make(path, kind):
    {"folder": os.mkdir, "pipe": os.mkfifo, "link": lambda path: os.symlink(path.with_name("target"), path)}[kind](path)


@pytest.mark.skipif(os.name != "posix", reason="pipes and links")
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["evaluation.csv", "report.html", BLOCKS_FILE, LOCK_FILE])
def test_what_is_no_file_is_not_replaced(kind, name, tmp_path, capsys):
    out = tmp_path / "out"
    out.mkdir()
    make(out / name, kind)
    before = os.lstat(out / name)
    assert main(["evaluate", "--policies", "nearest0", "--episodes", "2", "--out", str(out), *SMALL]) == 2
    said = capsys.readouterr().err
    assert said == f"wsn: {out / name}: {KINDS[kind]}: must be a regular file, or not exist yet\n"
    assert os.lstat(out / name) == before and {path.name for path in out.iterdir()} == {name}


@pytest.mark.skipif(os.name != "posix", reason="pipes and links")
def test_a_page_is_not_written_over_what_is_no_file(tmp_path, capsys):
    for kind in KINDS:
        make(tmp_path / kind, kind)
    for place in (*(tmp_path / kind for kind in KINDS), Path("/dev/null")):
        before = os.lstat(place)
        assert main(["replay", "--policy", "nearest0", "--out", str(place), *SMALL]) == 2
        said = capsys.readouterr().err
        assert (
            said.startswith(f"wsn: {place}: is a ")
            and said.count("\n") == 1
            and os.lstat(place).st_mode == before.st_mode
        )


@pytest.mark.skipif(os.name != "posix", reason="pipes")
def test_a_folder_that_is_none_is_refused(tmp_path, capsys):
    make(tmp_path / "pipe", "pipe")
    (tmp_path / "file").write_text("mine")
    for place in (tmp_path / "pipe", tmp_path / "file", tmp_path / "file" / "inside", Path("/dev/null")):
        assert main(["evaluate", "--policies", "nearest0", "--episodes", "2", "--out", str(place), *SMALL]) == 2
        said = capsys.readouterr().err
        assert (
            said.startswith(f"wsn: {place}: must be a folder that files can be written to: ") and said.count("\n") == 1
        )
    assert (tmp_path / "file").read_text() == "mine"


def test_temporary_files_of_killed_processes_go_and_others_stay(tmp_path):
    with subprocess.Popen([sys.executable, "-c", ""]) as dead:
        dead.wait()
    here = {f".{dead.pid}.a.csv": False, f".{os.getppid()}.a.csv": True, f".{dead.pid}.b.csv": True, ".x.a.csv": True}
    here |= {f".{dead.pid}.a.csv.mine": True, f"{dead.pid}.a.csv": True}
    for name in here:
        (tmp_path / name).write_text("")
    (tmp_path / f".{dead.pid}1.a.csv").mkdir()
    with replacing(tmp_path / "a.csv") as path:
        path.write_text("new")
    stay = {name for name, stays in here.items() if stays}
    assert {path.name for path in tmp_path.iterdir()} == stay | {"a.csv", f".{dead.pid}1.a.csv"}


@pytest.mark.parametrize("label", ["[/b]", "[red]", "[/x][link]", "[", "]"])
def test_labels_are_shown_as_they_are(label, tmp_path, capsys):
    policies = [f"{label}=nearest0", "nearest1"]
    for more in ([], ["--pareto"]):
        command = ["evaluate", "--policies", *policies, "--lam", "1", "--episodes", "2", *more, *SMALL]
        assert main(command) == 0
        assert f"to {label}" in capsys.readouterr().out
