"""Kernels are kept by what they compute: docstrings and comments compile nothing, constants whoever uses them."""

import os
import pickle
import subprocess
import sys
import textwrap
from concurrent.futures import ThreadPoolExecutor

import numba
import pytest

MODULES = {
    "numbers_of.py": '"""Constants."""\n\nFACTOR = 3.0\nOTHER = 5.0\nTABLE = (1.0, 2.0)\n',
    "pieces.py": """
        import numbers_of
        from numbers_of import FACTOR
        from wsn_env.compiled.kernels import lean_piece

        @lean_piece
        def scaled(x):
            '''What it does.'''
            return FACTOR * x

        @lean_piece
        def shifted(x):
            return numbers_of.OTHER + x
        """,
    "work.py": """
        import sys
        from wsn_env.compiled.kernels import kernel
        from pieces import scaled, shifted

        @kernel
        def first(x):
            '''Scales.'''
            return scaled(x)

        @kernel
        def second(x):
            return shifted(x)

        if __name__ == "__main__":
            from wsn_env.compiled import store
            print(first(2.0), second(2.0), *(name.rpartition(".")[2] for name in store.compiled))
        """,
}


@pytest.fixture
def folder(tmp_path):
    for name, text in MODULES.items():
        (tmp_path / name).write_text(textwrap.dedent(text))
    return tmp_path


def edit(path, old, new):
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def run(folder, *arguments, before=(), **environment):
    """(stdout's words, stderr) of the module `work`, with kernels kept in a folder beside it."""
    kept = {"NUMBA_CACHE_DIR": str(folder / "kept"), "PYTHONDONTWRITEBYTECODE": "1"}
    command = [*before, sys.executable, *(arguments or ("work.py",))]
    done = subprocess.run(command, cwd=folder, env=os.environ | kept | environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.split(), done.stderr


def test_what_is_compiled_is_what_has_changed(folder):
    assert run(folder)[0] == ["6.0", "7.0", "first", "second"]
    assert run(folder)[0] == ["6.0", "7.0"]
    edit(folder / "work.py", "Scales.", "Scales,\n    in other words.")
    edit(folder / "pieces.py", "What it does.", "Another docstring,\n    of two lines.")
    edit(folder / "pieces.py", "return FACTOR * x", "return FACTOR * x  # a comment")
    edit(folder / "numbers_of.py", '"""Constants."""', '"""Numbers."""\n\nUNUSED = 7')
    assert run(folder)[0] == ["6.0", "7.0"]
    edit(folder / "numbers_of.py", "FACTOR = 3.0", "FACTOR = 4.0")  # in another file than the kernel's
    assert run(folder)[0] == ["8.0", "7.0", "first"]
    edit(folder / "numbers_of.py", "OTHER = 5.0", "OTHER = 6.0")  # reached through its module
    assert run(folder)[0] == ["8.0", "8.0", "second"]
    edit(folder / "numbers_of.py", "FACTOR = 4.0", "FACTOR = 3.0")  # an earlier version is still there
    assert run(folder)[0] == ["6.0", "8.0"]
    edit(folder / "pieces.py", "return FACTOR * x", "return 1.0 + FACTOR * x")
    assert run(folder)[0] == ["7.0", "8.0", "first"]


def damaged(whole):
    """Contents of a file by what has become of it."""
    middle = len(whole) // 2
    return {
        "cut": whole[:middle],
        "changed": whole[:middle] + bytes(255 - byte for byte in whole[middle : middle + 64]) + whole[middle + 64 :],
        "empty": b"",
        "garbage": bytes(range(256)) * 8,
        "byte": whole[:1],
        "pickle": pickle.dumps({"no": ["index"]}),
        "other": pickle.dumps(numba.__version__) + pickle.dumps((None, {0: 1})),
    }


def kernels_of(names):
    """A module of kernels that tells what they give, and which of them were compiled."""
    made = "".join(f"@kernel\ndef {name}(x):\n    return scaled(x)\n\n" for name in names)
    calls = ", ".join(f"{name}(2.0)" for name in names)
    return f"from work import kernel, scaled\n{made}print({calls})\n{COMPILED}"


COMPILED = "from wsn_env.compiled import store\nprint(*(name.rpartition('.')[2] for name in store.compiled))\n"


def test_a_damaged_file_is_compiled_anew_and_said(folder):
    """One kernel for each ending and each damage, and one that is whole."""
    damages = {f"{damage}_{ending}": (damage, ending) for ending in ("nbc", "nbi") for damage in damaged(b"")}
    names = ["whole", *damages]
    (folder / "many.py").write_text(kernels_of(names))
    values = ["6.0"] * len(names)
    assert run(folder, "many.py")[0] == values + names
    for name, (damage, ending) in damages.items():
        (path,) = [path for path in (folder / "kept").rglob(f"*.{ending}") if name in path.name]
        path.write_bytes(damaged(path.read_bytes())[damage])
    words, said = run(folder, "many.py")
    assert words == values + names[1:]
    told = {name for name in names if f".{name} " in said}
    assert told == damages.keys() - {"pickle_nbi", "other_nbi"}  # which Numba takes for those of another version
    assert said.count("is damaged") == said.count("the kept kernel") == len(told)
    assert run(folder, "many.py") == (values, "")


def test_processes_that_compile_at_once_do_not_damage_each_other(folder):
    with ThreadPoolExecutor(3) as pool:
        both = list(pool.map(lambda _: run(folder), range(3)))
    assert all(words[:2] == ["6.0", "7.0"] and "damaged" not in said for words, said in both)
    assert sum(len(words) - 2 for words, _ in both) == 2  # each kernel once: who comes later waits and loads it
    assert run(folder) == (["6.0", "7.0"], "")


def test_an_edit_of_a_kind_compiles_what_uses_the_kind(folder):
    """The type of a kind's constants carries the stamp of its code."""
    (folder / "kinds.py").write_text(
        textwrap.dedent(
            """
            from dataclasses import dataclass
            import numpy as np
            from wsn_env import Scenario
            from wsn_env.compiled import store
            from wsn_env.filters.linear import LinearModel
            from wsn_env.models import Line, Measurement

            OFFSET = 2.0

            @dataclass(frozen=True)
            class Own(Measurement):
                @staticmethod
                def sample(m, stream, node, x, y):
                    return x, 0.0

                @staticmethod
                def log_likelihood(m, value, second, node, x, y):
                    return -((value - x) ** 2)

                @staticmethod
                def linearise(m, node, belief):
                    '''About a point.'''
                    return (Line(belief.x + OFFSET, 1.0, 0.0, 1.0),)

            for measurement in (Own(), "position"):
                model = LinearModel(Scenario.named("PreDC-v0", measurement=measurement))
                print(model.expected([(1.0, 2.0)], np.zeros((1, 2)))[0, 0], end=" ")
            print(len(store.compiled))
            """
        )
    )
    assert run(folder, "kinds.py")[0] == ["3.0", "1.0", "2"]  # one kernel, for each of two types
    assert run(folder, "kinds.py")[0] == ["3.0", "1.0", "0"]
    edit(folder / "kinds.py", "About a point.", "About another.")
    assert run(folder, "kinds.py")[0] == ["3.0", "1.0", "0"]
    edit(folder / "kinds.py", "OFFSET = 2.0", "OFFSET = 3.0")
    assert run(folder, "kinds.py")[0] == ["4.0", "1.0", "1"]


def test_another_layout_of_a_record_compiles_what_reads_it(folder):
    """Kernels read a record's arrays by their places in the handle: with a stale one they would read elsewhere."""
    (folder / "layout.py").write_text(
        textwrap.dedent(
            """
            from dataclasses import dataclass
            import numpy as np
            from wsn_env.compiled import store
            from wsn_env.compiled.arrays import Arrays, array, opener
            from wsn_env.compiled.kernels import kernel

            @dataclass(frozen=True, eq=False)
            class Pair(Arrays):
                first: np.ndarray = array(float, "rows")
                second: np.ndarray = array(float, "rows")

            pair_at = opener(Pair)

            @kernel
            def second(handle):
                return pair_at(handle).second[0]

            pair = Pair.zeros(rows=3)
            pair.first[:], pair.second[:] = 1.0, 2.0
            print(second(pair.handle), len(store.compiled))
            """
        )
    )
    assert run(folder, "layout.py")[0] == ["2.0", "1"]
    assert run(folder, "layout.py")[0] == ["2.0", "0"]
    lines = '    first: np.ndarray = array(float, "rows")\n', '    second: np.ndarray = array(float, "rows")\n'
    edit(folder / "layout.py", lines[0] + lines[1], lines[1] + lines[0])
    assert run(folder, "layout.py")[0] == ["2.0", "1"]
    edit(folder / "layout.py", lines[1], '    other: np.ndarray = array(int, "rows", "columns")\n' + lines[1])
    assert run(folder, "layout.py")[0] == ["2.0", "1"]


OF_TWO_KINDS = """
import sys
import numpy as np
from wsn_env.compiled import store
from wsn_env.compiled.kernels import kernel, piece

@piece  # long enough to be called, not copied into its callers
def long(cs, x):
    total = 0.0
    for i in range(40):
        for _ in range(3):
            x = x * 1.01 + np.sqrt(abs(x - 1.5)) - (x if x > i else cs.first)
            for k in range(3):
                total += np.sqrt(x * x + k) / (1.0 + abs(x)) + cs.first
                if total > 1e6:
                    total -= np.sqrt(total)
    return total

@kernel
def play(cs, x):
    return long(cs, x) + long(cs, x + 1.0) + long(cs, x * 2.0) + long(cs, x - 3.0)

for order in sys.argv[1:]:
    constants = np.zeros((), [(name, float) for name in order.split(",")])
    constants["first"], constants["second"] = 1.0, 100.0
    print(play(constants[()], 2.0))
print(len(store.compiled))
"""


def test_kernels_of_two_processes_do_not_call_each_others_functions(folder):
    """Both are loaded by a third; Numba would give the same names to what they are made of."""
    orders = "first,second", "second,first"
    found = [run(folder, "-c", OF_TWO_KINDS, order)[0] for order in orders]
    assert found[0] == found[1] and found[0][1] == "1"
    assert run(folder, "-c", OF_TWO_KINDS, *orders)[0] == [found[0][0]] * 2 + ["0"]


PLAY = """
import gymnasium as gym, wsn_env
for name in ("PreDC-v0", "Binary-v0", "Underwater-v0", "Ble-v0"):
    env = gym.make(f"wsn_env/{name}", particles=30, periods=4, observation="menu", disable_env_checker=True)
    env.reset(seed=0)
    print(*(round(float(env.step(action)[1]), 6) for action in (10, 3, 5)))
"""


def test_without_compiling_the_same_comes_out(folder):
    """NUMBA_DISABLE_JIT=1: people debug and measure coverage so. Sums may run in another order."""
    compiled = subprocess.run([sys.executable, "-c", PLAY], capture_output=True, text=True, check=True)
    words, said = run(folder, "-c", PLAY, NUMBA_DISABLE_JIT="1")
    assert [float(word) for word in words] == pytest.approx(list(map(float, compiled.stdout.split())), rel=0.05)
    assert "compiling" not in said and "Warning" not in said


def test_what_lies_beside_a_kernel_may_be_anything(folder):
    texts = {"empty": b"", "bytes": b"\xff\xfe\x00", "words": b"a b c\n" * 9}
    places = {f"{text}_{name}": (texts[text], f"{name}.{end}") for text in texts for name, end in BESIDE.items()}
    (folder / "many.py").write_text(kernels_of(places))
    values = ["6.0"] * len(places)
    assert run(folder, "many.py")[0] == values + list(places)
    for name, (text, file) in places.items():
        paths = [path for path in (folder / "kept").rglob(file) if f".{name}-" in path.parent.name]
        assert paths
        for path in paths:
            path.write_bytes(text)
    assert run(folder, "many.py")[0][: len(places)] == values
    assert run(folder, "many.py") == (values, "")


BESIDE = {"kernel": "py", "sums": "txt"}

WITHOUT = {
    "Windows": "fcntl resource pwd grp termios",
    "macOS": "",
}
MISSING = {
    "Windows": "os.register_at_fork os.sched_getaffinity os.sched_setaffinity os.fork os.getuid os.geteuid os.getgid"
    " os.uname os.sysconf os.mkfifo os.getloadavg os.killpg os.getpgid os.O_DIRECTORY signal.SIGKILL signal.SIGHUP"
    " signal.SIGALRM",
    "macOS": "os.sched_getaffinity os.sched_setaffinity os.memfd_create os.posix_fadvise",
}
IMPORT = """
import importlib, os, pathlib, pkgutil, signal, sys
import gymnasium, matplotlib, numba, rich.console, scipy.stats, stable_baselines3, torch, tyro, safetensors.numpy

for name in {modules!r}.split():
    sys.modules[name] = None  # to import it raises ImportError
for name in {names!r}.split():
    module, name = name.split(".")
    vars(globals()[module]).pop(name, None)
import wsn_env, wsn_env.agents
for package in (wsn_env, wsn_env.agents):
    for module in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
        if module.name not in ("wsn_env.__main__", "wsn_env.learning.rllib", "wsn_env.learning.native_runner"):
            importlib.import_module(module.name)
from wsn_env.compiled.kernels import available_threads
import work
print(work.first(2.0), available_threads() > 0)
"""


@pytest.mark.parametrize("system", MISSING)
def test_it_imports_and_runs_where_names_of_linux_are_missing(folder, system):
    code = IMPORT.format(modules=WITHOUT[system], names=MISSING[system])
    assert run(folder, "-c", code)[0] == ["6.0", "True"]


def test_a_store_that_can_only_be_read_is_read(folder):
    """A folder that somebody else has filled: here, where the lock cannot be opened."""
    run(folder)
    for path in (folder / "kept").rglob("lock"):
        path.unlink()
        path.mkdir()
    assert run(folder) == (["6.0", "7.0"], "")


def test_a_store_that_cannot_be_written_is_done_without(folder):
    (folder / "file").write_text("")
    words, said = run(folder, NUMBA_CACHE_DIR=str(folder / "file"))
    assert words == ["6.0", "7.0", "first", "second"]
    told = "wsn_env: compiling at every start, up to a minute: compiled kernels cannot be kept in"
    why = "(Not a directory); set NUMBA_CACHE_DIR to a folder that can be written to"
    assert said == f"{told} {folder / 'file'}/wsn_env {why}\n"


def mounting(command):
    """Before a command: a mount that it alone sees, for which one must be root."""
    before = "unshare", "-m", "sh", "-c", f'{command} && exec "$@"', "sh"
    try:
        allowed = subprocess.run([*before, "true"], capture_output=True).returncode == 0
    except FileNotFoundError:
        allowed = False
    if not allowed:
        pytest.skip("nothing can be mounted here")
    return before


@pytest.mark.parametrize("kept", [pytest.param("NUMBA_CACHE_DIR", marks=pytest.mark.full), "XDG_CACHE_HOME"])
def test_a_store_on_a_disk_that_can_only_be_read_is_read(folder, kept):
    """As an image of a container, or another user's."""
    places = {"NUMBA_CACHE_DIR": "", kept: str(folder / "kept")}
    run(folder, **places)
    read_only = mounting(f"mount --bind -o ro {folder / 'kept'} {folder / 'kept'}")
    assert run(folder, before=read_only, TMPDIR=str(folder), **places) == (["6.0", "7.0"], "")
    assert not list(folder.glob("wsn_env-*"))
    edit(folder / "numbers_of.py", "FACTOR = 3.0", "FACTOR = 4.0")
    words, said = run(folder, before=read_only, **places)
    assert words == ["8.0", "7.0", "first"]
    assert said.count("\n") == 1 and "(Read-only file system); set NUMBA_CACHE_DIR" in said
    for path in (folder / "kept").rglob("*.nb[ic]"):
        path.unlink()
    words, said = run(folder, before=read_only, **places)
    assert words == ["8.0", "7.0", "first", "second"]
    assert said.count("\n") == 1 and "cannot be kept in" in said


def test_a_damaged_file_on_a_disk_that_can_only_be_read_is_compiled_anew(folder):
    run(folder)
    for path in (folder / "kept").rglob("*.nbc"):
        path.write_bytes(path.read_bytes()[:-9])
    words, said = run(folder, before=mounting(f"mount --bind -o ro {folder / 'kept'} {folder / 'kept'}"))
    assert words == ["6.0", "7.0", "first", "second"]
    assert said.count("is damaged") == 2 and said.count("cannot be kept in") == 1


@pytest.mark.parametrize("room", ["4k", "24k", "40k"])
def test_a_full_disk_is_done_without(folder, room):
    (folder / "kept").mkdir()
    words, said = run(folder, before=mounting(f"mount -t tmpfs -o size={room} none {folder / 'kept'}"))
    assert words[:2] == ["6.0", "7.0"]
    assert said.count("(No space left on device); set NUMBA_CACHE_DIR") == 1


NO_HOME = """
import pwd, runpy

def nobody(number):
    raise KeyError(number)

pwd.getpwuid = nobody
runpy.run_path("work.py", run_name="__main__")
"""


def test_a_user_without_home_is_told_that_kernels_cannot_be_kept(folder):
    """A user who is only a number, as containers have; for the test, one who is not root."""
    kept = {name: "" for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")}
    no_disk = mounting("mount --bind -o ro / /")
    words, said = run(folder, "-c", NO_HOME, before=("env", "-u", "HOME", *no_disk), **kept)
    assert words == ["6.0", "7.0", "first", "second"]
    assert said.count("\n") == 1 and "cannot be kept in /nonexistent/.cache/wsn_env/kernels (" in said


def test_wsn_compile_says_at_once_that_kernels_cannot_be_kept(folder):
    (folder / "file").write_text("")
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder / "file")}
    done = subprocess.run([sys.executable, "-m", "wsn_env", "compile"], env=environment, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (2, "")
    why = "(Not a directory); set NUMBA_CACHE_DIR to a folder that can be written to"
    assert done.stderr == f"wsn: compiled kernels cannot be kept in {folder / 'file'}/wsn_env {why}\n"
