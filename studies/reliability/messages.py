"""Each kind of mistake made once, and what is said about it."""

from __future__ import annotations

import contextlib
import io
import json
import shlex
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import gymnasium

import wsn_env
from wsn_env.bluetooth.synthetic import write_dataset
from wsn_env.cli import main

COMMANDS = ("wsn", "train.py")
FILES = {
    "mine.py": "import nowhere\n",
    "lines.py": 'class Mine:\n    def __init__(self, scenario):\n        self.cost = {}["J"]\n',
    "late.py": 'class Mine:\n    def __init__(self, scenario): ...\n    def act(self, view):\n        return {}["J"]\n',
    "nothing.csv": "",
    "short.csv": "t,x,y\n0,1,2\n",
    "other.csv": "time,east,north\n0,1,2\n1,1,2\n",
    "twice.csv": "t,x,y,x\n0,1,2,3\n1,1,2,3\n",
    "comma.csv": "t,x,y\n0,1,5,2\n1,1,5,2\n",
    "nan.csv": "t,x,y\n0,1,2\n1,nan,2\n",
    "back.csv": "t,x,y\n1,1,2\n0,1,2\n",
    "stamps.csv": "t,x,y\n2026-01-01 12:00,1,2\n2026-01-01 12:01,1,2\n",
    "far.csv": "t,x,y\n0,500,2\n100,500,2\n",
    "policy.json": '{"kind": "ppo"',
    "weights.json": '{"kind": "ppo", "scenario": {}}',
    "calibration.json": '{"kind": "other"}',
    "elsewhere/tetam.dev": "rx1,1,2\n",
}
MISTAKES = {
    "Scenarios and quantities": """
        wsn evaluate --scenario PreDC
        Scenario.named("PreDC-v1")
        wsn evaluate --set node=400
        wsn evaluate --set nodes
        wsn evaluate --set nodes=many
        wsn evaluate --set layout=grid nodes=224
        wsn evaluate --set motion=zigzag
        wsn evaluate --set motion=sine,size=3
        wsn evaluate --set amplitude_m=3
        wsn evaluate --set measurement=nowhere.py:Mine
        wsn evaluate --lam -1
        wsn evaluate --set radius_m=nan
        wsn evaluate --set noise_m=1e-9
        wsn evaluate --set decay_power=170
        wsn evaluate --set packet_success=1.5
        wsn evaluate --set tracker=kf
        wsn evaluate --set tracker=ekf measurement=binary
        wsn evaluate --scenario Underwater-v0 --set sleep_w=0.02
        wsn evaluate --set battery_j=-1
        Scenario(name="a\\nb")
        Scenario.named("PreDC-v0", lam=(4, 1))
    """,
    "Environments and actions": """
        gym.make("wsn_env/PreDC-v0", action="menus")
        gym.make("wsn_env/PreDC-v0", observation="dictionary")
        gym.make("wsn_env/PreDC-v0", reward="both")
        gym.make("wsn_env/PreDC-v0", node=400)
        ClusterVectorEnv(0, "PreDC-v0")
        ClusterVectorEnv(2, "PreDC-v0", threads=1.5)
        ClusterEnv("PreDC-v0").step(0)
        ClusterEnv("PreDC-v0").reset(seed=1.5)
        ClusterEnv("PreDC-v0").reset(options=3)
        reset(ClusterEnv("PreDC-v0", action="menu")).step(28)
        reset(ClusterEnv("PreDC-v0", action="menu")).step(1.5)
        reset(ClusterVectorEnv(2, "PreDC-v0", action="menu")).step([1, 2, 3])
    """,
    "Policies": """
        wsn evaluate --policies predc
        wsn evaluate --policies pre_dc:thetaa=2
        wsn evaluate --policies pre_dc:phi0_m=-1
        wsn evaluate --policies =pre_dc
        wsn evaluate --policies nowhere.py:Mine
        wsn evaluate --policies mine.py:Mine
        wsn evaluate --policies late.py:Yours
        wsn evaluate --policies lines.py:Mine
        wsn evaluate --policies late.py:Mine --episodes 1
        wsn evaluate --policies none/policy.json
        wsn evaluate --policies policy.json
        wsn evaluate --policies weights.json
        wsn evaluate --policies ppo:of=Mine-v0
        Cluster.of([1, 2], 3)
    """,
    "Evaluations": """
        wsn evaluate --episodes 0
        wsn evaluate --seed -1
        wsn evaluate --engine ray --address localhost:1
        wsn evaluate --policies nearest0 --episodes 2 --out nothing.csv
        evaluate(["nearest0"], "PreDC-v0", [4.0], episodes="3")
        evaluate(["nearest0"], "PreDC-v0", [])
        evaluate([], "PreDC-v0", [4.0])
        error_bound("nearest3", "PreDC-v0")
        wsn reproduce predc --out out
        wsn reproduce pre_dc --out out --runs 1
        wsn replay --policy nearest0 nearest1 nearest2
        wsn replay --policy nearest0 --seed -1
    """,
    "Recorded tracks": """
        wsn evaluate --tracks nowhere.csv
        wsn evaluate --tracks nothing.csv
        wsn evaluate --tracks short.csv
        wsn evaluate --tracks other.csv
        wsn evaluate --tracks twice.csv
        wsn evaluate --tracks comma.csv
        wsn evaluate --tracks nan.csv
        wsn evaluate --tracks back.csv
        wsn evaluate --tracks stamps.csv
        wsn evaluate --tracks far.csv
        wsn evaluate --scenario Ble-v0 --tracks nowhere
        wsn evaluate --scenario Ble-v0 --tracks elsewhere
        wsn evaluate --scenario Ble-v0 --tracks milliseconds
        wsn evaluate --scenario Ble-v0 --tracks stamps
        wsn evaluate --scenario Ble-v0 --set calibration=nowhere.json
        wsn evaluate --scenario Ble-v0 --set calibration=calibration.json
        wsn calibrate --tracks nowhere --out out
        wsn calibrate --tracks walks --out out --leave-out walk7
        wsn replay --policy nearest0 --scenario Ble-v0 --recording nowhere.mbd
    """,
    "Trainings": """
        train.py --steps 0
        train.py --gamma 2
        train.py --learning-rate 0
        train.py --lam 3 1
        train.py --units 8 0
        train.py --scenario PreDC
        train.py --set nodes=many
        train.py --name begun --runs runs
        train.py --name lost --runs runs --resume
    """,
}


def reset(env: Any) -> Any:
    """An environment that has been reset."""
    env.reset(seed=1)
    return env


def say(mistake: str) -> str:
    """What is said in the present folder. A command ends with exit status 2 and one line.

    Raises:
        ValueError: something else happens.
    """
    said, status = io.StringIO(), 2
    arguments = shlex.split(mistake)
    if arguments[0] in COMMANDS:
        run = main if arguments[0] == "wsn" else _train
        with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
            status = run(arguments[1:])
        lines = said.getvalue().strip().splitlines()
    else:
        names = {name: getattr(wsn_env, name) for name in wsn_env.__all__}
        try:
            eval(mistake, names | {"gym": gymnasium, "reset": reset})
            lines = []
        except (ValueError, gymnasium.error.Error) as problem:
            lines = f"{type(problem).__name__}: {problem}".splitlines()
    if status != 2 or len(lines) != 1:
        raise ValueError(f"{mistake}: ends with status {status} and says {lines}")
    return lines[0].replace(str(Path.cwd()) + "/", "")


def _train(arguments: list[str]) -> int:
    import train as script

    return script.main(arguments)


def write_files(folder: Path) -> None:
    """Those that the mistakes name."""
    for name, text in FILES.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    write_dataset(folder / "walks", tracks=2, seconds=15)
    for name, of_time in (("milliseconds", lambda s: f"{1e3 * s:.0f}"), ("stamps", lambda s: f"2026-01-01T{s:.0f}")):
        for path in write_dataset(folder / name, tracks=2, seconds=15).glob("*.mbd"):
            lines = [line.partition(",") for line in path.read_text(encoding="utf-8").splitlines()]
            path.write_text("".join(f"{of_time(float(time))},{rest}\n" for time, _, rest in lines), encoding="utf-8")
    for name in ("begun", "lost"):
        (folder / "runs" / name).mkdir(parents=True)
        (folder / "runs" / name / "policy.json").write_text("{}", encoding="utf-8")
    (folder / "runs" / "begun" / "config.json").write_text(json.dumps({}), encoding="utf-8")


def messages() -> str:
    """By subject, as in a terminal: a mistake and its message, each."""
    text = ""
    with TemporaryDirectory() as folder, contextlib.chdir(folder):
        write_files(Path(folder))
        for subject, mistakes in MISTAKES.items():
            lines = []
            for mistake in map(str.strip, mistakes.strip().splitlines()):
                prompt = "$" if mistake.startswith(COMMANDS) else ">>>"
                lines.append(f"{prompt} {mistake}\n{say(mistake)}\n")
            text += f"### {subject}\n\n```text\n{''.join(lines)}```\n\n"
    return text
