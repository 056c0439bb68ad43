"""Comparison of policies: paired rollouts over common seeds, intervals, tables, files.

Every policy meets the same fields, tracks, detections and noises, so that differences are taken episode by episode.
Work goes in blocks of 50 seeds, whatever the machine: the rows are the same to the byte. Finished blocks are kept
beside the result, and a run that was stopped continues from them. A policy that does not look at lam plays its episodes
once; at every other lam only the return is another.
"""

from __future__ import annotations

import csv
import hashlib
import json
import platform
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import NamedTuple

import numpy as np

from wsn_env import draws
from wsn_env.bounds import Bound, bound_kind
from wsn_env.compiling import kernels_stamp
from wsn_env.files import replacing
from wsn_env.intervals import Summary
from wsn_env.policies import Policy, make_policy
from wsn_env.progress import Progress
from wsn_env.quantity import suggest
from wsn_env.scenario import Scenario
from wsn_env.types import Cluster, Outcome, State
from wsn_env.view import View
from wsn_env.world import World

BLOCK = 50
FIRST_SEED, SEEDS_PER_RUN = 2**31, 10**5  # training seeds lie below FIRST_SEED
COLUMNS = (
    "policy scenario lam episode seed periods return error_m rms_m energy_mj members handovers searches lost"
    " bound_m floor_m anees"
).split()
MEANS = ("return", "rms_m", "error_m", "energy_mj", "members", "handovers", "searches", "lost")
BLOCKS_FILE = "evaluation.blocks.jsonl"


@dataclass(frozen=True)
class Evaluation:
    """One row per (policy, lam, episode), as written to evaluation.csv."""

    scenario: Scenario
    policies: tuple[str, ...]
    lams: tuple[float, ...]
    episodes: int
    seed: int
    rows: list[dict]

    @cached_property
    def _rows_of(self) -> dict[tuple[str, float], list[dict]]:
        found: dict[tuple[str, float], list[dict]] = {}
        for row in self.rows:
            found.setdefault((row["policy"], row["lam"]), []).append(row)
        return found

    def values(self, policy: str, lam: float, column: str) -> np.ndarray:
        """(episodes,) in the order of the seeds, so that two policies' values are pairs."""
        if (policy, lam) not in self._rows_of:
            lams = ", ".join(f"{each:g}" for each in self.lams)
            raise ValueError(f"policy {policy!r} at lam = {lam!r}: compared were {', '.join(self.policies)} at {lams}")
        return np.array([row[column] for row in self._rows_of[policy, lam]])

    def summary(self, policy: str, lam: float) -> dict[str, Summary]:
        """Means with intervals of the quantities in MEANS."""
        return {column: Summary.of(self.values(policy, lam, column)) for column in MEANS}

    def rms_over_bound(self, policy: str, lam: float) -> Summary | None:
        """Root of the mean squared error over the mean squared bound, of all episodes; None: there is no bound."""
        if bound_kind(self.scenario) == "none":
            return None
        return Summary.of_root_ratio(*(self.values(policy, lam, column) ** 2 for column in ("rms_m", "bound_m")))

    def floor_m(self) -> float | None:
        """Root of the mean squared floor, the same for every policy; None: there is no bound."""
        if bound_kind(self.scenario) == "none":
            return None
        return float(np.sqrt(np.mean(self.values(self.policies[0], self.lams[0], "floor_m") ** 2)))

    def difference(self, policy: str, reference: str, lam: float, column: str = "return") -> Summary:
        """Paired difference policy - reference over the common episodes."""
        return Summary.of(self.values(policy, lam, column) - self.values(reference, lam, column))

    def families(self) -> list[str]:
        """Stems of the policies whose names differ only by a number at the end: "nearest" of nearest0, nearest1, ..."""
        stems = [stem_of(policy) for policy in self.policies if stem_of(policy) != policy]
        return [stem for stem in dict.fromkeys(stems) if stems.count(stem) > 1]

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

    def save(self, out: str | Path) -> None:
        """Write evaluation.csv and evaluation.json into a folder, each whole or not at all."""
        out = Path(out)
        out.mkdir(parents=True, exist_ok=True)
        with replacing(out / "evaluation.csv") as path, open(path, "w", newline="") as file:
            writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
            writer.writeheader()
            writer.writerows(self.rows)
        means = [
            {"policy": policy, "lam": lam}
            | {column: vars(value) for column, value in self.summary(policy, lam).items()}
            | {f"return_minus_{self.policies[0]}": vars(self.difference(policy, self.policies[0], lam))}
            | self._against_the_bound(policy, lam)
            for lam in self.lams
            for policy in self.policies
        ]
        with replacing(out / "evaluation.json") as path:
            path.write_text(json.dumps(self.settings() | {"versions": versions(), "means": means}, indent=1))

    def _against_the_bound(self, policy: str, lam: float) -> dict:
        ratio = self.rms_over_bound(policy, lam)
        return (
            {} if ratio is None else {f"rms_over_{bound_kind(self.scenario)}": vars(ratio), "floor_m": self.floor_m()}
        )

    def settings(self) -> dict:
        """What was asked for."""
        return _settings(self.scenario, self.policies, self.lams, self.episodes, self.seed)


def evaluation_seeds(seed: int, episodes: int) -> list[int]:
    """The literal reset seeds of an evaluation; `gym.make(...).reset(seed=s)` replays episode s."""
    if not 0 <= seed < 10**4:
        raise ValueError(f"seed = {seed}: must be in 0..9999")
    if not 1 <= episodes <= SEEDS_PER_RUN:
        raise ValueError(f"episodes = {episodes}: must be in 1..{SEEDS_PER_RUN}")
    return [FIRST_SEED + seed * SEEDS_PER_RUN + episode for episode in range(episodes)]


def stem_of(policy: str) -> str:
    """A policy's name without the number at its end."""
    return policy.rstrip("0123456789")


def episodes(
    policy: Policy, world: World, seeds: Sequence[int], begin: Callable[[State], object] | None = None
) -> Iterator[tuple[State, Outcome]]:
    """Play one episode for each seed, a row each; gives state and outcome after every period.

    `begin` is called with the state before the first.
    """
    state = world.reset(np.array([draws.key_of_seed(seed) for seed in seeds], dtype=np.uint64))
    if begin is not None:
        begin(state)
    for _ in range(world.scenario.periods):
        cluster = _checked(policy.act(View.of(state)), policy, world.scenario.field.nodes)
        state, outcome = world.step(state, cluster, donate=True)
        yield state, outcome


def _checked(cluster: Cluster, policy: Policy, nodes: int) -> Cluster:
    """What a policy chose; the world would drop and count nodes that do not exist, here they are a mistake."""
    if not isinstance(cluster, Cluster):
        chose = type(cluster).__name__
        raise ValueError(f"{type(policy).__name__}.act: returned a {chose}: must be a Cluster(head, members)")
    highest = max(np.max(cluster.head), np.max(cluster.members, initial=-1))
    if highest >= nodes:
        raise ValueError(f"{type(policy).__name__}.act: chose node {highest}: must be below {nodes}")
    return cluster


def rollout(policy: Policy, world: World, seeds: Sequence[int]) -> list[dict]:
    """Play one episode for each seed and measure it.

    Args:
        policy: sees only views.
        world: of a scenario with one lam.
        seeds: reset seeds, one a row.

    Returns: the measured columns of each episode, and the sums that its return is made of. `anees` is the mean of the
    squared error over what the belief takes it to be, the trace of its position covariance: 1 where the filter is
    honest, more where it is too sure.
    """
    scenario = world.scenario
    sums = dict.fromkeys(("error", "square", "energy", "members", "handovers", "searches", "lost"), 0.0)
    judged, ratios = np.zeros(len(seeds)), np.zeros(len(seeds))
    bound = None if bound_kind(scenario) == "none" else Bound(scenario, len(seeds), world.threads)
    for state, outcome in episodes(policy, world, seeds, bound and bound.begin):
        square, believed = outcome.error_m**2, outcome.posterior_rms_m**2
        sums["error"] += outcome.error_m
        if state.period[0] > scenario.unscored:
            sums["square"] += square
            judged += believed > 0
            ratios += np.divide(square, believed, out=np.zeros(len(seeds)), where=believed > 0)
        sums["energy"] += outcome.energy_mj
        sums["members"] += outcome.members
        sums["handovers"] += outcome.handover
        sums["searches"] += outcome.searched
        sums["lost"] += outcome.error_m > 2 * scenario.radius_m
        if bound is not None:
            bound.advance(state, outcome)
    n = scenario.periods
    columns = {
        "lam": state.lam,
        "periods": np.full(len(seeds), n),
        "return": -(sums["error"] + state.lam * sums["energy"]),
        "sum_error_m": sums["error"],
        "sum_energy_mj": sums["energy"],
        "error_m": sums["error"] / n,
        "rms_m": np.sqrt(sums["square"] / scenario.scored),
        "energy_mj": sums["energy"] / n,
        "members": sums["members"] / n,
        "handovers": sums["handovers"].astype(int),
        "searches": sums["searches"].astype(int),
        "lost": sums["lost"].astype(int),
        "bound_m": np.full(len(seeds), "") if bound is None else bound.episode_m(),
        "floor_m": np.full(len(seeds), "") if bound is None else bound.floor_m(state),
        "anees": ratios / np.maximum(judged, 1),
    }
    return [{name: values[i].item() for name, values in columns.items()} for i in range(len(seeds))]


def at_lam(measured: Sequence[dict], lam: float) -> list[dict]:
    """The same episodes with the return at another lam: what `rollout` gives of a policy that does not look at it."""
    return [
        values | {"lam": lam, "return": -(values["sum_error_m"] + lam * values["sum_energy_mj"])} for values in measured
    ]


class Block(NamedTuple):
    """Up to BLOCK episodes of a policy: what an engine plays at a time."""

    name: str
    lam: float | None  # that the policy sees; None: it does not look, and this serves all
    number: int
    policy: Policy
    scenario: Scenario
    seeds: list[int]


Engine = Callable[
    [Sequence[Block]], Iterator[tuple[Block, list[dict]]]
]  # each with what `rollout` measured, as it comes


def in_this_process(threads: int | None = None) -> Engine:
    """Plays the blocks one after the other.

    Args:
        threads: as World's.
    """

    def play(blocks):
        world = None
        for block in blocks:
            if world is None or world.scenario is not block.scenario:
                world = World(block.scenario, threads)
            yield block, rollout(block.policy, world, block.seeds)

    return play


def evaluate(
    policies: Sequence[str] | dict[str, Policy],
    scenario: Scenario,
    lams: Sequence[float] | None = None,
    episodes: int = 100,
    seed: int = 0,
    keep: str | Path | None = None,
    progress: Progress | None = None,
    threads: int | None = None,
    engine: Engine | None = None,
) -> Evaluation:
    """Paired comparison of policies.

    Args:
        policies: as for `named_policies`, or name -> Policy. The first is the reference of differences. One
            with `sees_lam = False` plays once for all lams.
        scenario: what they act in.
        lams: the trade-offs [m/mJ]; None: the scenario's, which must then be a single one.
        episodes: common random episodes for each policy and lam.
        seed: another seed, other episodes; training never meets any of them.
        keep: a folder for finished blocks, so that a stopped run continues; None: none are kept.
        progress: called with (blocks done, of, what).
        threads: as World's.
        engine: where the blocks are played; None: in this process. The rows do not depend on it.

    Raises:
        ValueError: for an unknown policy, or seed and episodes out of range.
    """
    if lams is None and isinstance(scenario.lam, (tuple, list)):
        raise ValueError(f"scenario.lam = {scenario.lam}: name the lams to compare at, one number each")
    lams = tuple(dict.fromkeys(map(float, [scenario.lam] if lams is None else lams)))
    if not policies or not lams:
        raise ValueError("policies and lams must name at least one each")
    named = policies if isinstance(policies, dict) else named_policies(policies, scenario)
    seeds = evaluation_seeds(seed, episodes)
    kept = _Kept(keep, _settings(scenario, named, lams, episodes, seed), list(named.values()))
    blocks: dict[tuple, Block] = {}
    for lam in lams:
        at_this = scenario.override(lam=lam)
        for name, policy in named.items():
            seen = lam if getattr(policy, "sees_lam", True) else None
            for number in range(-(-episodes // BLOCK)):
                own = seeds[number * BLOCK : (number + 1) * BLOCK]
                blocks.setdefault((name, seen, number), Block(name, seen, number, policy, at_this, own))
    missing = [block for block in blocks.values() if not kept.has(block)]
    for done, (block, measured) in enumerate((engine or in_this_process(threads))(missing), len(blocks) - len(missing)):
        kept.put(block, measured)
        if progress:
            progress(done + 1, len(blocks), block.name if block.lam is None else f"{block.name}, lam {block.lam:g}")
    rows = []
    for lam in lams:
        for name, policy in named.items():
            seen = lam if getattr(policy, "sees_lam", True) else None
            measured = [one for number in range(-(-episodes // BLOCK)) for one in kept.get(name, seen, number)]
            for episode, values in enumerate(at_lam(measured, lam)):
                row = {"policy": name, "scenario": scenario.name, "episode": episode, "seed": seeds[episode]} | values
                rows.append({column: row[column] for column in COLUMNS})
    return Evaluation(scenario, tuple(named), lams, episodes, seed, rows)


def named_policies(texts: Sequence[str], scenario: Scenario) -> dict[str, Policy]:
    """Policies by label, from names, paths of saved policies, "FILE.py:Class", or "label=" and any of these.

    Raises:
        ValueError: for an unknown policy, or two with one label.
    """
    named: dict[str, Policy] = {}
    for text in dict.fromkeys(texts):
        if not isinstance(text, str):
            raise ValueError(
                f"policies: {type(text).__name__} is no name: give policies of your own as {{name: policy}}"
            )
        label, policy = _made(text, scenario)
        if label in named:
            raise ValueError(f"policies: {label!r} is there twice: labels must differ")
        named[label] = policy
    return named


def _made(text: str, scenario: Scenario) -> tuple[str, Policy]:
    """("ppo", policy) from "ppo=runs/mine/policy.json"; a name or a path alone is its own label."""
    label, equals, source = text.partition("=")
    labelled = equals and ":" not in label  # else parameters: quadrants:n=2
    return (label, make_policy(source, scenario)) if labelled else (text, make_policy(text, scenario))


class _Kept:
    """Finished blocks in a JSON-lines file; one of other settings or policies is not read but begun anew.

    A policy is known by its repr, which for a dataclass shows its parameters, and by the file of its class.
    """

    def __init__(self, folder: str | Path | None, settings: dict, policies: Sequence[Policy]):
        self._blocks: dict[tuple, list[dict]] = {}
        self._path = None if folder is None else Path(folder) / BLOCKS_FILE
        if self._path is None:
            return
        head = _digest(settings, policies)
        lines = self._path.read_text(errors="replace").splitlines() if self._path.exists() else []
        if lines and lines[0] == json.dumps(head):
            for line in lines[1:]:
                try:
                    name, lam, number, measured = json.loads(line)
                    self._blocks[name, lam, number] = [dict(values) for values in measured]
                except (ValueError, TypeError):
                    continue  # cut short when the run was killed
        self._path.parent.mkdir(parents=True, exist_ok=True)
        kept = [[*key, measured] for key, measured in self._blocks.items()]
        with replacing(self._path) as path:
            path.write_text("".join(json.dumps(line) + "\n" for line in [head, *kept]))

    def has(self, block: Block) -> bool:
        return len(self._blocks.get(block[:3], ())) == len(block.seeds)

    def get(self, name: str, lam: float | None, number: int) -> list[dict]:
        return self._blocks[name, lam, number]

    def put(self, block: Block, measured: list[dict]) -> None:
        self._blocks[block[:3]] = measured
        if self._path is not None:
            with open(self._path, "a") as file:
                file.write(json.dumps([*block[:3], measured]) + "\n")


def forget_blocks(folder: str | Path) -> None:
    """Remove the kept blocks of a finished run."""
    (Path(folder) / BLOCKS_FILE).unlink(missing_ok=True)


def _digest(settings: dict, policies: Sequence[Policy]) -> str:
    """Of all that decides the rows: settings, policies, recorded tracks, versions and the package's own kernels."""
    sources = [getattr(sys.modules.get(type(policy).__module__), "__file__", None) for policy in policies]
    files = [*settings["scenario"]["motion"].get("tracks", ()), *filter(None, sources)]
    contents = [hashlib.sha256(Path(file).read_bytes()).hexdigest() for file in files]
    known = [settings, versions(), kernels_stamp(), list(map(repr, policies)), contents]
    return hashlib.sha256(json.dumps(known, sort_keys=True).encode()).hexdigest()


def versions() -> dict[str, str]:
    """What made a result."""
    found = {"python": platform.python_version()}
    for name in ("wsn_env", "numpy", "numba", "gymnasium", "filterpy", "scipy", "stable-baselines3", "torch"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            pass
    return found


def _settings(scenario: Scenario, policies, lams, episodes: int, seed: int) -> dict:
    return {
        "scenario": scenario.as_dict(),
        "policies": list(policies),
        "lams": list(lams),
        "episodes": episodes,
        "seed": seed,
    }
