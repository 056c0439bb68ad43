"""Reports that do not say of which target they are: what associating them costs, and how well it is done.

    python -m studies.association --out out/association

Two targets that meet, `meeting.md`: reports that name their target, joint probabilistic data association and the
nearest neighbour, with more and more clutter. The same reports, `stone_soup.md`: ours beside the Kalman filters that
Stone Soup's JPDA corrects (pip install stonesoup), of heads that hear the same nodes.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro

from wsn_env import Cluster, Scenario, View, World, evaluate
from wsn_env.evaluation.correspondence import Correspondence
from wsn_env.evaluation.files import replacing
from wsn_env.evaluation.intervals import Measured
from wsn_env.evaluation.progress import progress_bar
from wsn_env.evaluation.rollout import episodes, evaluation_seeds
from wsn_env.reports.markdown import markdown_table

POLICY, NEAR = "nearest3", 3
ASSOCIATIONS = ("known", "unknown", "nearest")
CLUTTER = (0.0, 0.1, 0.3, 1.0)
RESOLUTION_M = 3.0
Q = 0.05  # m/s^2, of both filters in the second table
AT_ONCE = 25  # of its episodes
COLUMNS = ("rms_m", "gospa_m", "swaps", "lost_tracks", "energy_mj")
HEADER = ("RMS m", "GOSPA m", "swaps", "lost tracks", "energy mJ/step")


@dataclass
class Association:
    """How many episodes."""

    episodes: int = 500
    """Of each line."""
    particles: int = 1000
    """Of each target."""
    out: Path = Path("out/association")
    """Folder."""
    stone_soup: bool = True
    """The second table, too."""


def main(arguments: list[str] | None = None) -> int:
    """Play, print and write the tables."""
    asked = tyro.cli(Association, args=arguments, description=__doc__)
    asked.out.mkdir(parents=True, exist_ok=True)
    tables = {"meeting": meeting} | ({"stone_soup": same_reports} if asked.stone_soup else {})
    for name, make in tables.items():
        table = make(asked)
        with replacing(asked.out / f"{name}.md") as path:
            path.write_text(table, encoding="utf-8")
        print(table)
    return 0


def scenario_of(asked: Association, **more: Any) -> Scenario:
    """Two targets that meet in the field of PreDC-v0."""
    return Scenario.named("PreDC-v0", targets=2, motion="meeting", particles=asked.particles, **more)


def meeting(asked: Association) -> str:
    """Means over the episodes, with their standard errors."""
    rows = []
    cases: list[tuple[str, dict[str, Any]]] = [(f"clutter {each:g}", {"clutter": each}) for each in CLUTTER]
    cases.append((f"clutter 0.3, merged within {RESOLUTION_M:g} m", {"clutter": 0.3, "resolution_m": RESOLUTION_M}))
    for label, more in cases:
        for association in ASSOCIATIONS:
            known = association == "known"
            if known and label != "clutter 0":
                continue
            scenario = scenario_of(asked, association=association, **({} if known else more))
            with progress_bar() as report:
                found = evaluate(POLICY, scenario, 4.0, asked.episodes, progress=report)
            cells = [str(Measured.mean(found.values(POLICY, 4.0, column))) for column in COLUMNS]
            rows.append([f"{label}: `{association}`", *cells])
    return markdown_table(["reports: association", *HEADER], rows)


class HeardByAll:
    """The nodes nearest to any target's prediction sense for all of them, so that all heads hear the same."""

    def __init__(self, targets: int) -> None:
        self._targets = targets

    def act(self, view: View) -> Cluster:
        """Each target's nearest node leads its cluster."""
        nearest = view.nearest(1 + NEAR)[0]
        together = nearest.reshape(-1, self._targets * nearest.shape[1])
        return Cluster(nearest[:, 0].astype(np.int64), np.repeat(together, self._targets, axis=0))


def same_reports(asked: Association) -> str:
    """Both associations of ours, and Stone Soup's on what our heads have heard."""
    rows = []
    for clutter in CLUTTER[:3]:
        found: dict[str, list[np.ndarray]] = {}
        for association in ASSOCIATIONS[1:]:
            scenario = scenario_of(asked, association=association, clutter=clutter, search=False, filter_q=Q)
            with progress_bar() as report:
                for done in range(0, asked.episodes, AT_ONCE):
                    seeds = evaluation_seeds(0, asked.episodes)[done : done + AT_ONCE]
                    for name, measured in play(scenario, seeds, association == "unknown").items():
                        found.setdefault(name, []).append(measured)
                    report(min(done + AT_ONCE, asked.episodes), asked.episodes, f"clutter {clutter:g}: {association}")
        for name, parts in found.items():
            means = (str(Measured.mean(each)) for each in np.concatenate(parts, axis=1))
            rows.append([f"clutter {clutter:g}: {name}", *means])
    return markdown_table(["reports: association", *HEADER[:4]], rows)


def play(scenario: Scenario, seeds: list[int], stone_soup: bool) -> dict[str, np.ndarray]:
    """Episodes of heads that hear the same: of ours, and of Stone Soup's trackers, (4, episodes) of the columns."""
    from studies.stone_soup_jpda import Trackers

    names = [f"`{type(scenario.association).__name__.lower()}`", *(["Stone Soup, JPDA"] if stone_soup else [])]
    followed = [Correspondence(len(seeds), scenario.targets, scenario.radius_m) for _ in names]
    squares, others = np.zeros((len(names), len(seeds))), []

    def begin(state: Any, _: Any) -> None:
        others.extend(Trackers(state, scenario) for _ in names[1:])

    for state, outcome in episodes(HeardByAll(scenario.targets), World(scenario), seeds, begin):
        tracks = [outcome.estimate_m, *(each.correct(state) for each in others)]
        for k, estimates_m in enumerate(tracks):
            followed[k].note(estimates_m, outcome.target_m)
            off = ((estimates_m - outcome.target_m) ** 2).sum(axis=1)
            squares[k] += off.reshape(len(seeds), -1).mean(axis=1) / scenario.periods
    return {
        name: np.stack([np.sqrt(squares[k]), followed[k].gospa_m, followed[k].swaps, followed[k].lost_tracks])
        for k, name in enumerate(names)
    }


if __name__ == "__main__":
    sys.exit(main())
