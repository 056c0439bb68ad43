"""Folders that nobody may write into, disks that are full: one line, the old files intact; before time is spent."""

import os
import subprocess
import sys
import tempfile
from io import BytesIO, TextIOWrapper
from pathlib import Path

import pytest

from wsn_env.bluetooth.synthetic import write_dataset
from wsn_env.cli import main

pytestmark = pytest.mark.skipif(os.name != "posix", reason="limits and permissions of POSIX")

SMALL = ["--set", "particles=30", "nodes=20", "side_m=40", "crossing_m=15", "periods=3"]
BLE = ["--scenario", "Ble-v0", "--set", "particles=30", "--tracks", "DATA"]
COMMANDS = {
    "evaluate": ["evaluate", "--policies", "nearest0", "nearest1", "--episodes", "2", *SMALL, "--out", "OUT"],
    "front": "evaluate --policies nearest0 nearest1 --pareto --lam 1 4 --episodes 2".split() + [*SMALL, "--out", "OUT"],
    "recorded": ["evaluate", "--policies", "nearest0", "--episodes", "1", *BLE, "--out", "OUT"],
    "replay": ["replay", "--policy", "nearest0", *SMALL, "--out", "OUT/page.html"],
    "calibrate": ["calibrate", "--tracks", "DATA", "--maps", "--out", "OUT"],
    "reproduce": ["reproduce", "underwater", "--runs", "2", "--out", "OUT"],
}
HARNESS = """
import contextlib, io, os, resource, shutil, sys, tempfile
from pathlib import Path
from matplotlib.figure import Figure
from wsn_env.cli import main

folder, arguments = Path(sys.argv[1]), sys.argv[2:]
out = folder / "out"
def draw(self, target, **more):
    data = b"a picture" * 100
    target.write(data) if hasattr(target, "write") else Path(target).write_bytes(data)
if "evaluate" not in arguments:
    Figure.savefig = draw
def files():
    return {str(path.relative_to(out)): path.read_bytes() for path in sorted(out.rglob("*")) if path.is_file()}
def run():
    return main([argument.replace("OUT", str(out)) for argument in arguments])
def forked(prepare):
    child = os.fork()
    if child == 0:
        said = io.StringIO()
        prepare()
        with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
            status = run()
        os.write(pipe[1], said.getvalue().encode())
        os._exit(status)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    os.write(pipe[1], b"\\0")
    said = b""
    while not said.endswith(b"\\0"):
        said += os.read(pipe[0], 10000)
    return status, said[:-1].decode()

assert run() == 0
whole, pipe = files(), os.pipe()
"""
FULL = """
older = (".md", ".html", ".png", ".csv")
old = {name: b"old " + data if name.endswith(older) else data for name, data in whole.items()}
sizes = sorted({len(data) for data in whole.values()})
limits = [*sorted({20, *(size - 1 for size in sizes if size > 30)})]
step = max(1, len(limits) // 5)
for limit in limits[::step]:
    for name, data in old.items():
        (out / name).write_bytes(data)
    status, said = forked(lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)))
    assert status == 2, (limit, status, said)
    assert said.startswith("wsn: ") and said.count("\\n") == 1 and "File too large" in said, (limit, said)
    assert f"'{out}" in said, said
    left = files()
    assert not [name for name in left if Path(name).name.startswith(".")], left.keys()
    assert all(left[name] in (old[name], whole[name]) for name in old)
    assert forked(lambda: None)[0] == 0
    assert files() == whole
print("limits", len(limits[::step]))
"""
CLOSED = """
import wsn_env.simulation.world as world
import wsn_env.models.recordings.dataset as dataset
def close():
    if os.getuid() == 0:
        os.setgroups([])
        os.setgid(65534)
        os.setuid(65534)
    def play(*given, **more):
        os._exit(9)
    world.World.restart = dataset.read_dataset = play
for path in (folder, *folder.parents):  # pytest's are for their owner alone
    if path.stat().st_uid == os.getuid() and Path(tempfile.gettempdir()) in path.parents:
        path.chmod(0o755)
for present in (True, False):
    if not present:
        shutil.rmtree(out)
    for place in (folder, *([out, *(path for path in out.rglob("*") if path.is_dir())] if present else [])):
        place.chmod(0o555)
    status, said = forked(close)
    for place in (folder, *([out, *(path for path in out.rglob("*") if path.is_dir())] if present else [])):
        place.chmod(0o755)
    assert status == 2, (present, status, said)
    words = f"{out}: must be a folder that files can be written to: Permission denied"
    assert said == f"wsn: {words}\\n", said
    assert not present or files() == whole
"""


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    return write_dataset(tmp_path_factory.mktemp("unwritable") / "data", tracks=2, seconds=15, seed=1)


def play(program, name, data, folder):
    command = [argument.replace("DATA", str(data)) for argument in COMMANDS[name]]
    ran = [sys.executable, "-c", HARNESS + program, str(folder), *command]
    done = subprocess.run(ran, capture_output=True, text=True, timeout=1000)
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout


def with_short(*short):
    """All commands, the others than these in the long form of the tests."""
    long = [pytest.mark.slow, pytest.mark.full]
    return [pytest.param(name, marks=[] if name in short else long) for name in COMMANDS]


@pytest.mark.parametrize("name", with_short("evaluate", "replay"))
def test_a_full_disk_is_a_line_with_the_file_and_what_was_there_stays(name, data, tmp_path):
    assert "limits" in play(FULL, name, data, tmp_path)


@pytest.mark.parametrize("name", with_short("evaluate", "replay"))
def test_a_folder_that_nobody_may_write_into_is_told_before_anything_is_played(name, data, tmp_path):
    play(CLOSED, name, data, tmp_path)


TRAIN = """
import contextlib, io, os, resource, sys
from pathlib import Path
import train as script
from wsn_env.training import trainer as train

folder = Path(sys.argv[1])
def run(name, *more):
    sizes = "--steps 512 --rows 16 --rollout 16 --batch 128 --epochs 1 --episodes 0 --checkpoint-steps 256".split()
    small = "--set particles=30 nodes=20 side_m=40 crossing_m=15 periods=3".split()
    return script.main(["--runs", str(folder), "--name", name, *more, *sizes, *small])
def limited(size):
    child = os.fork()
    if child == 0:
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
        with contextlib.redirect_stderr(io.StringIO()) as said:
            status = run("limited", "--resume")
        os.write(pipe[1], said.getvalue().encode())
        os._exit(status)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    return status, os.read(pipe[0], 10000).decode()
pipe = os.pipe()
assert run("whole") == 0
kept = ("policy.safetensors", "checkpoint.safetensors")
whole = {name: (folder / "whole" / name).read_bytes() for name in kept}
for size in (100, 2000, len(whole["policy.safetensors"]) - 1, len(whole["checkpoint.safetensors"]) - 1):
    status, said = limited(size)
    assert status == 2, (size, status, said)
    assert said.startswith("train.py: ") and said.count("\\n") == 1 and "File too large" in said, (size, said)
    assert f"'{folder}" in said, said
    hidden = [path for path in (folder / "limited").rglob("*") if path.name.startswith(".")]
    assert not hidden, hidden
assert run("limited", "--resume") == 0
for name in kept:
    assert (folder / "limited" / name).read_bytes() == whole[name], name
os.chmod(folder, 0o755)
if os.getuid() == 0:
    os.setgroups([]), os.setgid(65534), os.setuid(65534)
train.learn_locally = lambda *given: os._exit(9)
with contextlib.redirect_stderr(io.StringIO()) as said:
    status = run("nobody")
assert (status, said.getvalue().count("\\n")) == (2, 1) and "Permission denied" in said.getvalue(), said.getvalue()
"""


@pytest.mark.slow
def test_training_where_nothing_can_be_written(tmp_path):
    """What was trained before the disk was full is not lost."""
    for path in (tmp_path, *tmp_path.parents):  # pytest's are for their owner alone
        if path.stat().st_uid == os.getuid() and Path(tempfile.gettempdir()) in path.parents:
            path.chmod(0o755)
    done = subprocess.run([sys.executable, "-c", TRAIN, tmp_path], capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr[-3000:]


@pytest.fixture
def nothing_is_played(monkeypatch):
    def play(*given, **more):
        raise AssertionError("played")

    monkeypatch.setattr("wsn_env.simulation.world.World.restart", play)


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (
            "evaluate --policies nearest0 ppo:of=Mine-v0",
            "PPOPolicy.of = 'Mine-v0': allowed are Anchors-v0, Binary-v0, ",
        ),
        ("evaluate --policies nearest0 greedy:terms=3", "terms = 3: must be a list of list of number or None"),
        ("evaluate --policies nearest0 adaptive:order=best", "order 'best' is unknown: did you mean nearest?"),
        ("evaluate --policies nearest0 nowhere/policy.json", "policy 'nowhere/policy.json' does not exist"),
        (
            "evaluate --scenario Ble-v0 --tracks DATA --policies nearest0 p={track}/policy.json",
            "policy 'walk_0/policy.json' does not exist",
        ),
        ("replay --policy nearest0 ppo:of=Mine-v0", "PPOPolicy.of = 'Mine-v0': allowed are"),
        ("replay --policy nearest0 --out file/page.html", "file: must be a folder that files can be written to"),
        ("replay --policy nearest0 --out .", "is a folder: must be a regular file, or not exist yet"),
        ("reproduce all --out out", "out/grnn: must be a folder that files can be written to: File exists"),
        ("reproduce pre_dc --out file", "file: must be a folder that files can be written to: File exists"),
    ],
)
def test_what_cannot_end_well_is_told_before_anything_is_played(
    command, said, data, tmp_path, monkeypatch, capsys, nothing_is_played
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "grnn").write_text("")
    assert main([part.replace("DATA", str(data)) for part in command.split()]) == 2
    line = capsys.readouterr().err
    assert line.startswith("wsn: ") and said in line and line.count("\n") == 1
    assert {path.name for path in tmp_path.iterdir()} == {"file", "out"}
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["grnn"]


@pytest.mark.parametrize("encoding", ["ascii", "latin-1"])
def test_a_terminal_without_a_letter_loses_nothing(encoding, data, tmp_path, monkeypatch):
    terminal = TextIOWrapper(BytesIO(), encoding)
    monkeypatch.setattr("sys.stdout", terminal)
    monkeypatch.setattr("wsn_env.reports.pictures.can_draw", lambda: False)
    command = [part.replace("DATA", str(data)).replace("OUT", str(tmp_path)) for part in COMMANDS["recorded"]]
    assert main(command) == 0
    terminal.flush()
    shown = terminal.buffer.getvalue().decode(encoding)
    assert "nearest0" in shown and "written: " in shown
    assert {"tracks.csv", "tracks.json", "tracks.md"} <= {path.name for path in tmp_path.iterdir()}
