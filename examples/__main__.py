"""Run the examples, each in a virtual environment of its own that holds what its first lines ask for.

    python -m examples                       # all; renews the measured table of docs/toolkits.md
    python -m examples skrl_ppo rllib_ppo

An environment that is there already is used again. A failing example does not stop the others.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from wsn_env.reports.markdown import fill_blocks, markdown_table

HERE = Path(__file__).parent
ROOT = HERE.parent
PAGE = ROOT / "docs" / "toolkits.md"
BLOCK = re.compile(r"# /// script\n((?:# .*\n)*)# ///\n")  # inline script metadata, PEP 723
CLOSING = re.compile(r"(?P<name>.+): return (?P<trained>\S+) after .* \((?P<speed>\S+) a second\); .* (?P<random>\S+),")
TORCH = "torch==2.13.0"
LIMIT_S = 180


@dataclass
class Settings:
    """Which, and where."""

    names: Annotated[list[str], tyro.conf.Positional] = field(default_factory=lambda: list(EXAMPLES))
    """Names of scripts; left out: all."""
    steps: int = 20_000
    """Periods of training."""
    out: Path = Path("out/examples")
    """Folder of the virtual environments."""
    torch_index: str = ""
    """pip's options for torch, for example "--index-url URL" of CPU wheels."""


def needs(script: Path) -> list[str]:
    """What a script asks for in its first lines; [] where it does not."""
    block = BLOCK.match(script.read_text(encoding="utf-8"))
    return tomllib.loads(block[1].replace("# ", ""))["dependencies"] if block else []


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
            rows.append(run(EXAMPLES[name], settings))
        except (subprocess.CalledProcessError, subprocess.TimeoutExpired) as problem:
            print(f"{name} FAILED: {problem}\n{(problem.stderr or '')[-2000:]}", file=sys.stderr)
            failed.append(name)
    print(f"{len(rows)} examples learned something" + (f", FAILED: {', '.join(failed)}" if failed else ""))
    if not failed and len(rows) == len(EXAMPLES):
        renew(rows)
    return bool(failed)


def run(script: Path, settings: Settings) -> list[str]:
    """One example: its row of the table. Prints its closing line."""
    python = environment(script, settings)
    command = [python, script, "--steps", str(settings.steps)]
    done = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True, timeout=LIMIT_S)
    line = next(line for line in reversed(done.stdout.splitlines()) if CLOSING.match(line))
    print(line, flush=True)
    found = CLOSING.match(line)
    pinned = [need for need in needs(script) if "==" in need] or ["stable-baselines3"]  # the toolkit stands last
    toolkit = re.split(r"[\[=]", pinned[-1])[0]
    ask = f"from importlib.metadata import version; print(version({toolkit!r}))"
    version = subprocess.run([python, "-c", ask], check=True, capture_output=True, text=True).stdout.strip()
    cells = f"[{script.name}](../examples/{script.name})", f"{toolkit} {version}", found["speed"], found["trained"]
    return list(cells)


def environment(script: Path, settings: Settings) -> Path:
    """Python of the script's virtual environment, made where it is not there."""
    folder = (settings.out / script.stem).absolute()
    python, ready = folder / "bin" / "python", folder / "ready"
    wanted = "\n".join(needs(script))
    if not ready.exists() or ready.read_text(encoding="utf-8") != wanted:
        print(f"{script.stem}: installing {', '.join(needs(script))} ...", flush=True)
        own = [need.replace("wsn_env", str(ROOT)) for need in needs(script) if need.startswith("wsn_env")]
        others = [need for need in needs(script) if not need.startswith("wsn_env")]
        pip = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
        for command in (
            [sys.executable, "-m", "venv", "--clear", folder],
            [*pip, TORCH, *settings.torch_index.split()],
            [*pip, TORCH, *others, "-e", *own],
        ):
            subprocess.run(command, check=True, capture_output=True, text=True)
        ready.write_text(wanted, encoding="utf-8")
    return python


def renew(rows: list[list[str]]) -> None:
    """Put the measured table into its page."""
    table = markdown_table(("example", "toolkit", "periods a second", "return"), rows, left=(0, 1))
    PAGE.write_text(fill_blocks(PAGE.read_text(encoding="utf-8"), {"examples": table}), encoding="utf-8")
    print(f"written: {PAGE}")


if __name__ == "__main__":
    sys.exit(main())
