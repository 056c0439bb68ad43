"""Comparison of policies: paired rollouts over common seeds, intervals, tables, files.

Every policy meets the same fields, tracks, detections and noises, so that differences are taken episode by episode.
Work goes in blocks of 50 seeds, whatever the machine: the rows are the same to the byte. Finished blocks are kept
beside the result, and a run that was stopped continues from them. A policy that does not look at lam plays its episodes
once; at every other lam only the return is another.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from functools import cached_property
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from wsn_env.evaluation.files import alone_in, replacing
from wsn_env.evaluation.intervals import Summary
from wsn_env.evaluation.kept_blocks import KeptBlocks
from wsn_env.evaluation.policies import Policy, named_policies
from wsn_env.evaluation.progress import Progress, no_progress, progress_bar
from wsn_env.evaluation.rollout import BLOCK, Block, Engine, change_lam, evaluation_seeds, in_this_process
from wsn_env.evaluation.versions import versions
from wsn_env.models.arguments import checked, checked_but
from wsn_env.models.quantity import NUMBERS, short, suggest
from wsn_env.scenario import Scenario
from wsn_env.simulation.lifetime import METRICS
from wsn_env.simulation.reference import has_reference

COLUMNS = (
    "policy scenario lam episode seed periods return error_m rms_m energy_mj members handovers searches lost"
    " first_death half_dead functional tracked stranded_mj stranded_sd"
    " reference_m reference_all_awake_m anees variance_ratio gospa_m swaps lost_tracks"
).split()
Row = dict[str, str | float]  # of the columns in COLUMNS
MEANS = ("return", "rms_m", "error_m", "energy_mj", "members", "handovers", "searches", "lost", *METRICS)


@dataclass(frozen=True)
class Evaluation:
    """One row per (policy, lam, episode), as written to evaluation.csv."""

    scenario: Scenario
    policies: tuple[str, ...]
    lams: tuple[float, ...]
    episodes: int
    seed: int
    rows: list[Row]

    @property
    def middle_lam(self) -> float:
        """The one that pictures are drawn at."""
        return sorted(self.lams)[len(self.lams) // 2]

    @cached_property
    def _rows_of(self) -> dict[tuple[str, float], list[Row]]:
        found: dict[tuple[str, float], list[Row]] = {}
        for row in self.rows:
            found.setdefault((str(row["policy"]), float(row["lam"])), []).append(row)
        return found

    @checked
    def values(self, policy: str, lam: float, column: str) -> np.ndarray:
        """(episodes,) in the order of the seeds, so that two policies' values are pairs."""
        if (policy, lam) not in self._rows_of:
            lams = ", ".join(f"{each:g}" for each in self.lams)
            raise ValueError(f"policy {policy!r} at lam = {lam!r}: compared were {', '.join(self.policies)} at {lams}")
        if column not in COLUMNS:
            raise ValueError(f"column {column!r} is unknown: {suggest(column, COLUMNS)}")
        return np.array([row[column] for row in self._rows_of[policy, lam]])

    def summary(self, policy: str, lam: float) -> dict[str, Summary]:
        """Means with intervals of the quantities in MEANS."""
        return {column: Summary.of(self.values(policy, lam, column)) for column in MEANS}

    def rms_over_reference(self, policy: str, lam: float) -> Summary | None:
        """Root of the mean squared error over the mean squared reference, of all episodes; None: there is none."""
        if not has_reference(self.scenario):
            return None
        return Summary.of_root_ratio(*(self.values(policy, lam, column) ** 2 for column in ("rms_m", "reference_m")))

    def reference_all_awake_m(self) -> float | None:
        """Root mean square of the reference with all nodes awake, the same for every policy; None: there is none."""
        if not has_reference(self.scenario):
            return None
        return float(np.sqrt(np.mean(self.values(self.policies[0], self.lams[0], "reference_all_awake_m") ** 2)))

    def difference(self, policy: str, reference: str, lam: float, column: str = "return") -> Summary:
        """Paired difference policy - reference over the common episodes."""
        return Summary.of(self.values(policy, lam, column) - self.values(reference, lam, column))

    @checked
    def ranked(self, lam: float) -> list[str]:
        """Policies, the best mean return first."""
        return sorted(self.policies, key=lambda policy: -self.values(policy, lam, "return").mean())

    def to_frame(self) -> Any:
        """The rows as a pandas DataFrame, one for each (policy, lam, episode), with the columns of evaluation.csv.

        Raises:
            ValueError: without pandas.
        """
        try:
            import pandas
        except ImportError:
            raise ValueError("to_frame needs pandas: pip install pandas") from None
        return pandas.DataFrame(self.rows, columns=COLUMNS)

    def _repr_html_(self) -> str:
        """What a notebook shows: at each lam the policies, the best first, with 95 % intervals."""
        what = {"return": "return", "rms_m": "RMS m", "error_m": "error m", "energy_mj": "energy mJ a time step"}
        head = "".join(f"<th>{escape(name)}</th>" for name in ("lam", "policy", *what.values()))
        rows = []
        for lam in self.lams:
            for policy in self.ranked(lam):
                summary = self.summary(policy, lam)
                cells = [f"{lam:g}", policy, *(summary[column].text for column in what)]
                rows.append("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in cells) + "</tr>")
        title = f"{self.scenario.title}, {self.episodes} common episodes, seed {self.seed}; means, 95 % intervals"
        return f"<table><caption>{escape(title)}</caption><tr>{head}</tr>{''.join(rows)}</table>"

    def families(self) -> list[str]:
        """Stems of the policies whose names differ only by a number at the end: "nearest" of nearest0, nearest1, ..."""
        stems = [stem_of(policy) for policy in self.policies if stem_of(policy) != policy]
        return [stem for stem in dict.fromkeys(stems) if stems.count(stem) > 1]

    def family_name(self, stem: str) -> str:
        """ "nearest0..8", by the least and the largest number that was compared."""
        member_numbers = [
            int(policy.removeprefix(stem)) for policy in self.policies if policy != stem == stem_of(policy)
        ]
        return f"{stem}{min(member_numbers)}..{max(member_numbers)}"

    @checked
    def best_of(self, stem: str, lam: float) -> str:
        """The member of a numbered family with the best mean return: the best in hindsight.

        Raises:
            ValueError: for a stem without members, or a lam that was not compared at.
        """
        members = [policy for policy in self.policies if policy != stem and stem_of(policy) == stem]
        if not members:
            raise ValueError(f"family {stem!r} has no members: {suggest(stem, self.families())}")
        if lam not in self.lams:
            raise ValueError(f"lam = {lam:g}: must be one of {', '.join(f'{each:g}' for each in self.lams)}")
        return max(members, key=lambda policy: self.values(policy, lam, "return").mean())

    @checked
    def save(self, out: str | Path) -> None:
        """Write evaluation.csv and evaluation.json into a folder, each whole or not at all."""
        out = Path(out)
        out.mkdir(parents=True, exist_ok=True)
        with replacing(out / "evaluation.csv") as path, open(path, "w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
            writer.writeheader()
            writer.writerows(self.rows)
        means = [
            {"policy": policy, "lam": lam}
            | {column: vars(value) for column, value in self.summary(policy, lam).items()}
            | {f"return_minus_{self.policies[0]}": vars(self.difference(policy, self.policies[0], lam))}
            | self._compare_to_reference(policy, lam)
            for lam in self.lams
            for policy in self.policies
        ]
        with replacing(out / "evaluation.json") as path:
            path.write_text(
                json.dumps(self.settings() | {"versions": versions(), "means": means}, indent=1), encoding="utf-8"
            )

    def _compare_to_reference(self, policy: str, lam: float) -> dict[str, object]:
        ratio = self.rms_over_reference(policy, lam)
        if ratio is None:
            return {}
        return {"rms_over_reference": vars(ratio), "reference_all_awake_m": self.reference_all_awake_m()}

    def settings(self) -> dict[str, Any]:
        """What was asked for."""
        return _settings(self.scenario, self.policies, self.lams, self.episodes, self.seed)


def stem_of(policy: str) -> str:
    """A policy's name without the number at its end."""
    return policy.rstrip("0123456789")


@checked_but("policies", "lams", "episodes", "seed", "threads")
def evaluate(  # noqa: PLR0913
    policies: str | Sequence[str] | dict[str, Policy],
    scenario: Scenario | str,
    lams: float | Sequence[float] | None = None,
    episodes: int = 100,
    seed: int = 0,
    keep: str | Path | None = None,
    progress: Progress | bool | None = True,
    threads: int | None = None,
    engine: Engine | None = None,
) -> Evaluation:
    """Paired comparison of policies.

    Args:
        policies: as for `named_policies`, or name -> Policy. The first is the reference of differences. One
            with `sees_lam = False` plays once for all lams.
        scenario: what they act in, or a preset's name.
        lams: the trade-offs [m/mJ], or one of them; None: the scenario's, which must then be a single one.
        episodes: common random episodes for each policy and lam.
        seed: another seed, other episodes; training never meets any of them.
        keep: a folder for finished blocks, so that a stopped run continues; None: none are kept. Of an object without
            a repr its state decides whether they are its own; what it reads, too, but for files read before.
        progress: called with (blocks done, of, what); True: a bar, in terminals and notebooks; False or
            None: nothing.
        threads: as World's.
        engine: where the blocks are played; None: in this process. The rows do not depend on it.

    Raises:
        ValueError: for an unknown policy, seed and episodes out of range, or another run that keeps blocks there.
    """
    scenario = Scenario.of(scenario)
    seeds = evaluation_seeds(seed, episodes)
    seed, episodes, lams = int(seed), len(seeds), _trade_offs(lams, scenario)
    named = named_policies(policies, scenario)
    blocks: dict[tuple[str, float | None, int], Block] = {}
    for lam in lams:
        at_this = scenario.override(lam=lam)
        for name, policy in named.items():
            used_lam = lam if getattr(policy, "sees_lam", True) else None
            for number in range(-(-episodes // BLOCK)):
                own = seeds[number * BLOCK : (number + 1) * BLOCK]
                blocks.setdefault((name, used_lam, number), Block(name, used_lam, number, policy, at_this, own))
    with nullcontext() if keep is None else alone_in(keep):
        kept = KeptBlocks(keep, scenario, _settings(scenario, named, lams, episodes, seed), list(named.values()))
        missing = [block for block in blocks.values() if not kept.has(block)]
        played = (engine or in_this_process(threads))(missing)
        with progress_bar(None if progress is True else progress or no_progress) as report:
            for done, (block, measured) in enumerate(played, len(blocks) - len(missing)):
                kept.put(block, measured)
                at = "" if block.lam is None else f", lam {block.lam:g}"
                report(done + 1, len(blocks), block.name + at)
    rows: list[Row] = []
    for lam in lams:
        for name, policy in named.items():
            used_lam = lam if getattr(policy, "sees_lam", True) else None
            measured = [one for number in range(-(-episodes // BLOCK)) for one in kept.get(name, used_lam, number)]
            for episode, values in enumerate(change_lam(measured, lam)):
                row: dict[str, Any] = {
                    "policy": name,
                    "scenario": scenario.title,
                    "episode": episode,
                    "seed": seeds[episode],
                } | values
                rows.append({column: row[column] for column in COLUMNS})
    return Evaluation(scenario, tuple(named), lams, episodes, seed, rows)


def _trade_offs(lams: Any, scenario: Scenario) -> tuple[float, ...]:
    """The lams to compare at, each once."""
    if lams is None:
        if isinstance(scenario.lam, (tuple, list)):
            raise ValueError(f"scenario.lam = {scenario.lam}: name the lams to compare at, one number each")
        lams = scenario.lam
    lams = lams.tolist() if isinstance(lams, np.ndarray) else lams
    each = list(lams) if np.iterable(lams) and not isinstance(lams, str) else [lams]
    if not each or any(not isinstance(lam, NUMBERS) or isinstance(lam, bool) for lam in each):
        raise ValueError(f"lams = {short(repr(lams))}: must be a number of m/mJ, or at least one in a list")
    return tuple(dict.fromkeys(map(float, each)))


def _settings(
    scenario: Scenario, policies: Iterable[str], lams: Iterable[float], episodes: int, seed: int
) -> dict[str, Any]:
    return {
        "scenario": scenario.as_dict(),
        "policies": list(policies),
        "lams": list(lams),
        "episodes": episodes,
        "seed": seed,
    }
