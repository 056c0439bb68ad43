"""Run the examples for several seeds, each in a virtual environment of its own that holds what its first lines ask for.

    python -m examples                       # all
    python -m examples skrl_ppo rllib_ppo    # these

It renews their rows in the table of docs/toolkits.md, unless seeds or steps are others than there.

An environment that is there already is used again. An example fails where one of its seeds is not better than random
actions, and does not stop the others.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from statistics import mean
from typing import Annotated

import tyro

from wsn_env.reports.markdown import fill_blocks, markdown_table

HERE = Path(__file__).parent
ROOT = HERE.parent
PAGE = ROOT / "docs" / "toolkits.md"
BLOCK = re.compile(r"# /// script\n((?:# .*\n)*)# ///\n")  # inline script metadata, PEP 723
CLOSING = re.compile(
    r"(?P<name>.+): return (?P<trained>\S+) after .* \((?P<speed>\S+) a second\); random actions (?P<random>\S+),"
)
COLUMNS = "example", "toolkit", "time steps a second", "return", "random actions", "better than random"
TORCH = "torch==2.13.0"
LIMIT_S = 300  # a seed


@dataclass
class Settings:
    """Which, and where."""

    names: Annotated[list[str], tyro.conf.Positional] = field(default_factory=lambda: list(EXAMPLES))
    """Names of scripts; left out: all."""
    seeds: tuple[int, ...] = (0, 1, 2)
    """A training each."""
    steps: int = 20_000
    """Time steps of a training."""
    out: Path = Path("out/examples")
    """Folder of the virtual environments."""
    torch_index: str = ""
    """pip's options for torch, for example "--index-url URL" of CPU wheels."""


def first_lines(script: Path) -> dict:
    """What stands in a script's inline metadata; {} where it has none."""
    block = BLOCK.match(script.read_text(encoding="utf-8"))
    return tomllib.loads(re.sub("^# ", "", block[1], flags=re.M)) if block else {}


def needs(script: Path) -> list[str]:
    """What a script asks for; the toolkit stands last."""
    return first_lines(script).get("dependencies", []) + without_dependencies(script)


def without_dependencies(script: Path) -> list[str]:
    """Of those, toolkits whose own pins are too narrow: installed without what they ask for."""
    return first_lines(script).get("tool", {}).get("examples", {}).get("without-dependencies", [])


EXAMPLES = {path.stem: path for path in sorted(HERE.glob("*.py")) if needs(path)}


def main() -> int:
    """Run them; exit status 1 where one failed."""
    settings = tyro.cli(Settings, description=__doc__)
    unknown = [name for name in settings.names if name not in EXAMPLES]
    if unknown:
        print(f"examples: {unknown} are unknown: {', '.join(EXAMPLES)}", file=sys.stderr)
        return 2
    rows, failed = [], []
    for name in settings.names:
        try:
            python = environment(EXAMPLES[name], settings)
            trainings = [train(python, EXAMPLES[name], settings.steps, seed) for seed in settings.seeds]
        except (subprocess.CalledProcessError, subprocess.TimeoutExpired) as problem:
            print(f"{name} FAILED: {problem}\n{(problem.stderr or '')[-2000:]}", file=sys.stderr)
            failed.append(name)
            continue
        rows.append(summarize(python, EXAMPLES[name], trainings))
        print(f"{name}: {', '.join(rows[-1][1:])}", flush=True)
        if not all(one.better for one in trainings):
            failed.append(name)
    print(f"{len(settings.names)} examples" + (f", FAILED: {', '.join(failed)}" if failed else ": each seed learned"))
    if (settings.seeds, settings.steps) == (Settings.seeds, Settings.steps):
        renew(rows)
    return bool(failed)


@dataclass
class Training:
    """What an example's closing line says of one seed."""

    mean_return: float
    speed: float  # time steps a second
    random_return: float
    better: bool  # than random actions, by the interval over the held-out episodes


def train(python: Path, script: Path, steps: int, seed: int) -> Training:
    """Run a script for one seed. Prints its closing line.

    Raises:
        subprocess.CalledProcessError: without a closing line.
    """
    command = [python, script, "--steps", str(steps), "--seed", str(seed)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=LIMIT_S)
    line = next((line for line in reversed(done.stdout.splitlines()) if CLOSING.match(line)), None)
    if line is None:
        raise subprocess.CalledProcessError(done.returncode or 1, command, done.stdout, done.stderr)
    print(f"seed {seed}: {line}", flush=True)
    found = CLOSING.match(line)
    numbers = (float(found[name].replace(",", "")) for name in ("trained", "speed", "random"))
    return Training(*numbers, better=done.returncode == 0)


def summarize(python: Path, script: Path, trainings: list[Training]) -> list[str]:
    """The example's row of the table: mean (min to max) over its seeds."""
    pinned = [need for need in needs(script) if "==" in need] or ["stable-baselines3"]  # the toolkit stands last
    toolkit = re.split(r"[\[=]", pinned[-1])[0]
    ask = f"from importlib.metadata import version; print(version({toolkit!r}))"
    version = subprocess.run([python, "-c", ask], check=True, capture_output=True, text=True).stdout.strip()
    returns = [one.mean_return for one in trainings]
    return [
        f"[{script.name}](../examples/{script.name})",
        f"{toolkit} {version}",
        f"{mean(one.speed for one in trainings):,.0f}",
        f"{mean(returns):.1f} ({min(returns):.1f} to {max(returns):.1f})",
        f"{mean(one.random_return for one in trainings):.1f}",
        f"{sum(one.better for one in trainings)} of {len(trainings)} seeds",
    ]


def environment(script: Path, settings: Settings) -> Path:
    """Python of the script's virtual environment, made where it is not there."""
    folder = (settings.out / script.stem).absolute()
    python, ready = folder / "bin" / "python", folder / "ready"
    wanted = "\n".join(needs(script))
    if not ready.exists() or ready.read_text(encoding="utf-8") != wanted:
        print(f"{script.stem}: installing {', '.join(needs(script))} ...", flush=True)
        own = [need.replace("wsn_env", str(ROOT)) for need in needs(script) if need.startswith("wsn_env")]
        bare = without_dependencies(script)
        others = [need for need in needs(script) if not need.startswith("wsn_env") and need not in bare]
        pip = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
        for command in (
            [sys.executable, "-m", "venv", "--clear", folder],
            [*pip, TORCH, *settings.torch_index.split()],
            [*pip, TORCH, *others, "-e", *own],
            *([[*pip, "--no-deps", *bare]] if bare else []),
        ):
            subprocess.run(command, check=True, capture_output=True, text=True)
        ready.write_text(wanted, encoding="utf-8")
    return python


def renew(rows: list[list[str]]) -> None:
    """Put measured rows into the table of their page; the rows of other examples stay."""
    text = PAGE.read_text(encoding="utf-8")
    kept = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("| [")]
    by_example = {row[0]: row for row in [*kept, *rows] if len(row) == len(COLUMNS)}
    table = markdown_table(COLUMNS, [by_example[name] for name in sorted(by_example)], left=(0, 1))
    PAGE.write_text(fill_blocks(text, {"examples": table}), encoding="utf-8")
    print(f"written: {PAGE}")


if __name__ == "__main__":
    sys.exit(main())
