"""How many particles a scenario needs: the error of a rule over that with many particles, on the same episodes.

    python -m studies.particles --out out/particles

Writes particles.md. The rule is greedy, at the trade-off of the scenario.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from pathlib import Path

import tyro

from wsn_env.evaluation.comparison import evaluate
from wsn_env.evaluation.files import replacing
from wsn_env.evaluation.intervals import Measured
from wsn_env.evaluation.progress import progress_bar
from wsn_env.reports.markdown import markdown_table
from wsn_env.scenario import Scenario

COUNTS = (100, 200, 500, 1000, 2000, 5000)
MANY = 20_000
POLICY = "greedy"


@dataclass
class Particles:
    """Which scenarios, how many episodes."""

    scenarios: list[str] = field(
        default_factory=lambda: ["PreDC-v0", "Rssi-v0", "Binary-v0", "Anchors-v0", "Underwater-v0", "Ble-v0"]
    )
    """Presets with a particle filter."""
    episodes: int = 500
    """Common to all numbers of particles."""
    out: Path = Path("out/particles")
    """Folder."""


def main(arguments: list[str] | None = None) -> int:
    """Play, print and write particles.md."""
    asked = tyro.cli(Particles, args=arguments, description=__doc__)
    asked.out.mkdir(parents=True, exist_ok=True)
    rows = []
    with progress_bar() as report:
        for number, name in enumerate(asked.scenarios):
            squares = {}
            for count in (*COUNTS, MANY):
                report(number, len(asked.scenarios), f"{name}, {count:,} particles")
                scenario = Scenario.named(name, particles=count)
                lam = scenario.lam if isinstance(scenario.lam, (int, float)) else scenario.lam[0]
                found = evaluate(POLICY, scenario, lam, asked.episodes, progress=None)
                squares[count] = found.values(POLICY, lam, "rms_m") ** 2
            many = squares[MANY]
            cells = [str(Measured.root_ratio(squares[count], many)) for count in COUNTS]
            rows.append([name, f"{Scenario.named(name).tracking.particles:,}", *cells, str(Measured.root_mean(many))])
    columns = ["scenario", "its P", *(f"P = {count:,}" for count in COUNTS), f"RMS at {MANY:,}, m"]
    text = markdown_table(columns, rows)
    with replacing(asked.out / "particles.md") as path:
        path.write_text(text, encoding="utf-8")
    print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
