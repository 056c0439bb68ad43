"""Every claim, one after the other in a process of its own, then docs/performance.md from their results.

python -m benchmarks [--rounds N] [--short] [--folder FOLDER]
"""

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from rich.console import Console

from benchmarks import page
from benchmarks.race import Result

# Files of this folder; each is a claim, with the command line of race.main. In the order of running.
CLAIMS = (
    *("environment", "vector", "several_targets", "overhead", "nodes", "memory"),
    *("many_rows", "episodes", "training", "whole_training"),
    *("rllib", "recording", "frames", "filter_step", "filter_scaling"),
)
LONG = ("many_rows", "training", "whole_training", "rllib", "filter_step", "filter_scaling")  # a glance leaves them out


def main() -> int:
    """Run, report, renew the page. Returns the exit code: 1 if a claim's process failed, not if a target is missed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, help="turns of each implementation")
    parser.add_argument("--short", action="store_true", help="a glance; leaves docs/performance.md as it is")
    parser.add_argument("--folder", type=Path, help="where to put the results (a glance's are not kept)")
    arguments = parser.parse_args()
    if arguments.short and not arguments.folder:
        with tempfile.TemporaryDirectory() as folder:
            return run(Path(folder), arguments)
    return run(arguments.folder or page.RESULTS, arguments)


def run(folder: Path, arguments: argparse.Namespace) -> int:
    """What main does, with results in this folder."""
    options = ["--short"] * arguments.short + (["--rounds", str(arguments.rounds)] if arguments.rounds else [])
    folder.mkdir(parents=True, exist_ok=True)
    console = Console()
    failed = []
    claims = [claim for claim in CLAIMS if not (arguments.short and claim in LONG)]
    for i, claim in enumerate(claims, start=1):
        console.rule(f"{i}/{len(claims)} {claim}")
        start = time.perf_counter()
        if subprocess.run(command(claim, folder, options)).returncode:
            failed.append(claim)
        console.print(f"{claim}: {time.perf_counter() - start:.0f} s", style="dim")
    missed = [
        claim.what
        for path in sorted(folder.glob("*.json"))
        for claim in Result.load(path).claims
        if claim.holds is False
    ]
    for what in missed:
        console.print(f"missed: {what}")
    for claim in failed:
        console.print(f"failed: benchmarks.{claim}, see above", style="bold red")
    if not arguments.short:
        page.renew_page(folder)
        console.print(f"renewed {page.PAGE}")
    return 1 if failed else 0


def command(claim: str, folder: Path, options: list[str]) -> list[str]:
    """Its process."""
    result = folder / f"{claim}.json"
    result.unlink(missing_ok=True)  # a failing claim must not show an old figure
    return [sys.executable, "-m", f"benchmarks.{claim}", "--json", str(result), *options]


if __name__ == "__main__":
    sys.exit(main())
