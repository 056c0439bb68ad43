"""Commands killed at any moment and run again: whether they end with the files of one that was never stopped."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tyro

from wsn_env.bluetooth.synthetic import write_dataset
from wsn_env.cli import main as wsn

SMALL = "--set particles=30 nodes=20 side_m=40 crossing_m=15 periods=3"
EVALUATE = f"wsn evaluate --policies nearest0 nearest1 pre_dc --episodes 4 {SMALL} --out OUT"
RECORDED = "wsn evaluate --scenario Ble-v0 --tracks WALKS --policies nearest0 informed1 --episodes 2 --set particles=30"
TRAIN = (
    "train.py --resume --name run --runs OUT --steps 4096 --rows 32 --rollout 32 --batch 512 --epochs 2 --episodes 0"
    f" --checkpoint-steps 1024 {SMALL}"
)
COMMANDS = {
    "evaluate": EVALUATE,
    "front": f"{EVALUATE} --pareto --lam 1 4",
    "recorded": f"{RECORDED} --out OUT",
    "replay": f"wsn replay --policy nearest0 pre_dc {SMALL} --out OUT/page.html",
    "calibrate": "wsn calibrate --tracks WALKS --out OUT",
    "reproduce": "wsn reproduce underwater --runs 2 --out OUT",
    "train": TRAIN,
    "tuning": "studies.tuning --scenario PreDC-v0 --lams 4 --episodes 1 --out OUT/tuned.json",
}
DECISIVE = {"train": ("policy.safetensors", "checkpoint.safetensors")}  # the rest tells times
MOST_TRIES = 3  # for a kill before the end
EVENTS = ("open", "os.rename", "os.remove")


@dataclass
class Kills:
    """A command that is killed again and again, each time in a folder of its own."""

    name: tyro.conf.Positional[str]
    """Of the command."""
    folder: tyro.conf.Positional[Path]
    """A temporary one."""
    files: tuple[int, ...] = ()
    """Kill it as it opens, renames or removes its so many-th file."""
    random: int = 0
    """Kill it so often before its end, at random: by turns at a file and at a time."""
    blank: bool = False
    """Write pictures that show nothing."""


def kill(name: str, folder: Path, *more: str) -> dict[str, Any]:
    """Kill a command in a process of its own.

    Args:
        name: one of COMMANDS.
        folder: a temporary one.
        more: options of `Kills`.

    Returns: "killed", how often it was before its end; "differ", the files that another was in then.
    """
    command = [sys.executable, "-m", "studies.reliability.kills", name, str(folder), *more]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise ValueError(f"kills of {name}: {done.stderr[-2000:]}")
    return json.loads(done.stdout.splitlines()[-1])


def _run(command: list[str]) -> int:
    if command[0] == "wsn":
        return wsn(command[1:])
    if command[0] == "studies.tuning":
        from studies import tuning

        return tuning.main(command[1:]) or 0
    import train as script

    return script.main(command[1:])


def _forked(command: list[str], out: Path, last: int = 0, seconds: float | None = None) -> tuple[int, int]:
    """Run it in a child that is killed at its `last` file or after so many seconds: status, files counted."""
    child = os.fork()
    if child == 0:
        count = 0

        def watch(event: str, given: tuple[Any, ...]) -> None:
            nonlocal count
            if event in EVENTS and str(given[0]).startswith(str(out)):
                count += 1
                if count == last:
                    os.kill(os.getpid(), signal.SIGKILL)

        sys.addaudithook(watch)
        status = _run(command)
        out.with_suffix(".count").write_text(str(count), encoding="utf-8")
        os._exit(status)
    if seconds is not None:
        time.sleep(seconds)
        os.kill(child, signal.SIGKILL)
    status = os.waitpid(child, 0)[1]
    counted = out.with_suffix(".count")
    return status, int(counted.read_text(encoding="utf-8")) if counted.exists() else 0


def _draw_small(blank: bool) -> None:
    from matplotlib.figure import Figure

    save = Figure.savefig

    def draw(self: Figure, target: Any, **more: Any) -> None:
        if blank and isinstance(target, (str, Path)):
            Path(target).write_bytes(b"a picture")
        else:
            save(self, target, **more | {"dpi": 20})

    Figure.savefig = draw  # type: ignore[method-assign]


def main(arguments: list[str] | None = None) -> None:
    """Kill, run again, compare, print what was found as JSON."""
    asked = tyro.cli(Kills, args=arguments, description=__doc__)
    _draw_small(asked.blank)
    walks = write_dataset(asked.folder / "walks", tracks=2, seconds=15)
    text = COMMANDS[asked.name].replace("WALKS", str(walks))

    def run(number: int, last: int = 0, seconds: float | None = None) -> tuple[int, int]:
        out = asked.folder / str(number)
        out.mkdir(exist_ok=True)
        return _forked(text.replace("OUT", str(out)).split(), out, last, seconds)

    def files(number: int) -> dict[str, bytes]:
        out = asked.folder / str(number)
        found = {str(path.relative_to(out)): path.read_bytes() for path in out.rglob("*") if path.is_file()}
        wanted = DECISIVE.get(asked.name)
        return {path: data for path, data in found.items() if wanted is None or Path(path).name in wanted}

    if asked.name != "train":  # whose threads would be missing in a child
        assert _run(text.replace("OUT", str(asked.folder / "first")).split()) == 0  # imports, kernels
    started = time.monotonic()
    status, count = run(0)
    seconds, whole = time.monotonic() - started, files(0)
    assert status == 0 and whole, (status, whole.keys())
    rng, tries, killed = random.Random(22), 0, 0
    differ: list[str] = []
    while tries < max(len(asked.files), MOST_TRIES * asked.random) and killed < max(len(asked.files), asked.random):
        tries += 1
        if asked.files:
            moment: Any = (asked.files[tries - 1], None)
        else:
            moment = (rng.randint(1, count), None) if tries % 2 else (0, rng.uniform(0.02, 0.98) * seconds)
        killed += os.WIFSIGNALED(run(tries, *moment)[0])
        assert run(tries)[0] == 0, moment
        made = files(tries)
        differ += [f"{moment}: {path}" for path in made.keys() | whole.keys() if made.get(path) != whole.get(path)]
    print(json.dumps({"killed": killed, "differ": differ}))


if __name__ == "__main__":
    main()
