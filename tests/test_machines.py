"""Other machines: terminals, locales, systems without names of Linux, folders that cannot be written to."""

import ast
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
COMMAND = """-m wsn_env evaluate --policies nearest2 b=pre_dc --episodes 2 --lam 1 4 --out out
 --set particles=50 periods=5 nodes=30""".split()
PLAIN = {"PYTHONIOENCODING": "", "LC_ALL": "C.UTF-8"}
HOSTILE = dict(LC_ALL="C", PYTHONUTF8="0", PYTHONCOERCECLOCALE="0", PYTHONIOENCODING="ascii", COLUMNS="40", LINES="5")
HOSTILE |= dict(TERM="dumb", NO_COLOR="1", TZ="Asia/Kathmandu", MPLBACKEND="bogus", PYTHONOPTIMIZE="2")
INTERPRETED = sorted(
    str(path) for path in (ROOT / "tests").glob("test_*.py") if "mark.interpreted" in path.read_text("utf-8")
)


def play(folder, *before, without=(), after=COMMAND, **environment):
    """(exit status, stdout, stderr) of a command in a folder, and the files that it leaves there."""
    folder.mkdir(exist_ok=True)
    kept = {name: value for name, value in os.environ.items() if name not in without}
    command = [*before, sys.executable, *after]
    done = subprocess.run(command, cwd=folder, env=kept | PLAIN | environment, capture_output=True)
    files = {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    return (done.returncode, done.stdout.decode(errors="replace"), done.stderr.decode(errors="replace")), files


@pytest.mark.slow
@pytest.mark.full  # its settings one by one: below
def test_a_comparison_leaves_the_same_files_whatever_the_terminal(tmp_path):
    (status, _, said), files = play(tmp_path / "plain")
    assert status == 0, said
    assert set(files) == {
        f"out/{name}" for name in ("evaluation.csv", "evaluation.json", "evaluation.md", "report.html")
    }
    (status, printed, said), others = play(tmp_path / "hostile", without=["HOME", "USER", "LANG"], **HOSTILE)
    assert status == 0 and others == files, said
    assert printed.isascii() and said.isascii()
    shell = "sh", "-c", 'exec "$@" >&- 2>&- <&-', "sh"
    (status, *_), others = play(tmp_path / "closed", *shell)
    assert status == 0 and others == files


@pytest.mark.slow
@pytest.mark.parametrize(
    "after", [COMMAND, "-m wsn_env replay --policy nearest1 --out out.html --set particles=50 periods=5".split()]
)
def test_no_network_is_needed(after, tmp_path):
    alone = "unshare", "--net"
    if shutil.which("unshare") is None or subprocess.run([*alone, "true"], capture_output=True).returncode:
        pytest.skip("no network can be taken away here")
    (status, _, said), files = play(tmp_path / "alone", *alone, after=after)
    assert status == 0 and files, said


@pytest.mark.parametrize("after", [["-m", "wsn_env", "--help"], ["train.py", "--help"]], ids=["wsn", "train"])
def test_help_is_shown_where_only_ascii_is(after):
    ascii_only = {name: value for name, value in HOSTILE.items() if name.startswith(("LC", "PYTHON"))}
    done = subprocess.run([sys.executable, *after], cwd=ROOT, env=os.environ | ascii_only, capture_output=True)
    assert done.returncode == 0 and b"usage: " in done.stdout and not done.stderr, done.stderr


@pytest.mark.parametrize(
    ("shell", "status", "said"),
    [
        ('exec "$@" >/dev/full', 2, "wsn: [Errno 28] No space left on device\n"),
        ('"$@" | true; exit ${PIPESTATUS[0]}', 1, ""),
    ],
    ids=["full", "pipe"],
)
def test_results_are_there_where_the_table_cannot_be_printed(tmp_path, shell, status, said):
    (found, printed, told), files = play(tmp_path / "run", "bash", "-c", shell, "bash")
    assert (found, printed, told) == (status, "", said)
    assert {f"out/{name}" for name in ("evaluation.csv", "evaluation.json", "evaluation.md", "report.html")} <= set(
        files
    )


def calls_without_encoding(path: Path) -> list[str]:
    """Files opened as text by a call that does not say how it is encoded: Windows would take what it likes."""
    found = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if not isinstance(node, ast.Call):
            continue
        owner = node.func.value if isinstance(node.func, ast.Attribute) else None
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        if name == "open":
            mode = [word.value for word in node.keywords if word.arg == "mode"] + node.args[owner is None :][:1]
            binary = bool(mode) and "b" in ast.unparse(mode[0])
            text = not binary and (owner is None or ast.unparse(owner) not in ("os", "Image", "webbrowser", "tarfile"))
        else:
            text = owner is not None and name in ("read_text", "write_text")
        if text and "encoding" not in {word.arg for word in node.keywords}:
            found.append(f"{path.relative_to(ROOT)}:{node.lineno}")
    return found


@pytest.mark.parametrize("top", ["wsn_env", "agents", "examples", "studies", "benchmarks", "docs"])
def test_text_files_are_utf8_on_every_system(top):
    files = [*(ROOT / top).rglob("*.py"), *([ROOT / "train.py"] if top == "wsn_env" else [])]
    assert files and not [place for path in files for place in calls_without_encoding(path)]


def test_calls_without_encoding_are_found(tmp_path, monkeypatch):
    monkeypatch.setattr(sys.modules[__name__], "ROOT", tmp_path)
    lines = ["open(a)", "open(a, 'w')", "a.open()", "a.open(mode='r')", "a.read_text()", "a.write_text(b)"]
    fine = ["open(a, 'rb')", "a.open('wb')", "a.open(mode='rb')", "os.open(a, b)", "a.read_text(encoding=b)"]
    (tmp_path / "x.py").write_text("\n".join(lines + fine), encoding="utf-8")
    assert len(calls_without_encoding(tmp_path / "x.py")) == len(lines)


# A file that is open can be neither replaced nor removed, and there are no locks but those of msvcrt.
WINDOWS = """
import os, sys, types
import gymnasium, matplotlib.figure, numba, rich.console, rich.progress, scipy.stats, tyro

def refuse(function):
    def checked(*paths, **others):
        for path in paths:
            whole = os.path.abspath(os.fsdecode(path))
            if any(target(name) == whole for name in os.listdir("/proc/self/fd")):
                raise PermissionError(13, "The process cannot access the file because it is being used", str(path))
        return function(*paths, **others)
    return checked

def target(name):
    try:
        return os.readlink(f"/proc/self/fd/{name}")
    except OSError:
        return ""

for name in ("replace", "rename", "unlink", "remove"):
    setattr(os, name, refuse(getattr(os, name)))
locked = []
sys.modules["fcntl"] = None
sys.modules["msvcrt"] = types.SimpleNamespace(
    locking=lambda file, mode, count: locked.append((mode, count)), LK_NBLCK=2
)
for name in ("register_at_fork", "sched_getaffinity", "fork", "getuid", "geteuid"):
    delattr(os, name)
from wsn_env.cli import main
for _ in range(2):
    assert main(sys.argv[1:]) == 0
assert locked == [(2, 1)] * 2, locked
"""


@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="finds open files in /proc")
def test_a_comparison_runs_where_open_files_cannot_be_replaced(tmp_path):
    (status, _, said), files = play(tmp_path / "run", after=["-c", WINDOWS, *COMMAND[2:]])
    assert status == 0, said
    files.pop("out/.wsn.lock", None)  # open when its run ends: it stays
    assert files == play(tmp_path / "plain")[1]


def test_marked_tests_pass_without_compiled_kernels():
    """NUMBA_DISABLE_JIT=1 pytest -m interpreted: with its help people debug, and measure coverage."""
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-p",
        "no:cacheprovider",
        "-m",
        "interpreted",
        "-W",
        "error",
        *INTERPRETED,
    ]
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTEST_ADDOPTS": ""}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
    assert done.returncode == 0 and " passed" in done.stdout, done.stdout
