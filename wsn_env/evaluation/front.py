"""The front of error against energy that policies reach over the trade-offs, and its hypervolume.

A policy's front is its points (mean error, mean energy) over the lams. A rule that takes no notice of lam gives one
point; such rules that differ by a number at the end of their names, nearest0..8, give one front together. The
hypervolume of a front is the area that its points dominate, up to the scenario's reference point (Zitzler & Thiele,
1998); a point beyond the reference point adds nothing.

Intervals are percentile bootstraps over the episodes, which all policies share: a resample takes the same episodes for
every point, so that the difference of two fronts is a paired one.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from wsn_env.evaluation.comparison import Evaluation, stem_of
from wsn_env.evaluation.files import replacing
from wsn_env.evaluation.intervals import RESAMPLES, Summary
from wsn_env.evaluation.versions import versions
from wsn_env.models.arguments import checked, checked_but
from wsn_env.models.quantity import whole_number
from wsn_env.scenario import Scenario

OTHERS = "all others together"
COLUMNS = "front policy lam error_m error_low error_high energy_mj energy_low energy_high".split()


@dataclass(frozen=True)
class Point:
    """What a policy reached at one lam; lam is None where it made no difference."""

    policy: str
    lam: float | None
    values: np.ndarray  # (episodes, 2): error [m], energy [mJ a period]

    @cached_property
    def error(self) -> Summary:
        """Mean error [m]."""
        return Summary.of(self.values[:, 0])

    @cached_property
    def energy(self) -> Summary:
        """Mean energy [mJ a period]."""
        return Summary.of(self.values[:, 1])


Fronts = dict[str, list[Point]]


@dataclass(frozen=True)
class Volume:
    """A front's hypervolume [m mJ], and how far it exceeds the first front's (None for the first)."""

    front: str
    hypervolume: Summary
    difference: Summary | None


@checked_but("number")
def lam_sweep(scenario: Scenario, number: int = 9) -> tuple[float, ...]:
    """Trade-offs, evenly spaced in their logarithm, over the scenario's span [m/mJ]: 0.3 to 30 for PreDC-v0.

    A scenario that draws lam from a pair is swept from the one to the other.
    """
    number = whole_number("number", number, 1)
    low, high = scenario.lam_range
    low, high = (low, high) if low < high else scenario.lam_span
    return tuple(float(f"{lam:.2g}") for lam in np.geomspace(low, high, number))


@checked
def find_fronts(evaluation: Evaluation) -> Fronts:
    """Every policy's points in the order of the lams; a family's in the order of the numbers."""
    families: dict[tuple[str, bool], list[tuple[str, list[Point]]]] = {}
    for policy in evaluation.policies:
        points = policy_points(evaluation, policy)
        stem, number = split_number(policy)
        family = (stem, True) if number and len(points) == 1 else (policy, False)
        families.setdefault(family, []).append((number, points))
    found: Fronts = {}
    for (stem, joins), members in families.items():
        if joins:
            members.sort(key=lambda member: int(member[0]))
            first, last = members[0][0], members[-1][0]
            stem += first if first == last else f"{first}..{last}"
        found[stem] = join_points(points for _, points in members)
    return found


def split_number(policy: str) -> tuple[str, str]:
    """("nearest", "3") from "nearest3"; ("pre_dc", "") from "pre_dc"."""
    stem = stem_of(policy)
    return stem, policy[len(stem) :]


def policy_points(evaluation: Evaluation, policy: str) -> list[Point]:
    """A policy's front: a point for each lam, or a single one where lam made no difference."""
    columns = [
        np.stack([evaluation.values(policy, lam, column) for column in ("error_m", "energy_mj")], axis=-1)
        for lam in evaluation.lams
    ]
    if all(np.array_equal(values, columns[0]) for values in columns):
        return [Point(policy, None if len(columns) > 1 else evaluation.lams[0], columns[0])]
    return [Point(policy, lam, values) for lam, values in zip(evaluation.lams, columns)]


def join_points(some: Iterable[list[Point]]) -> list[Point]:
    """The points of several fronts as one front: their union."""
    return [point for points in some for point in points]


def reference_point(scenario: Scenario) -> tuple[float, float]:
    """(error [m], energy [mJ a period]) that every point of a front must stay below."""
    return scenario.reference_error_m, scenario.reference_energy_mj


@checked
def hypervolume(means: Sequence[np.ndarray] | np.ndarray, reference: tuple[float, float]) -> float:
    """The area between points and the reference point that some point dominates.

    Args:
        means: (..., 2), less is better.
        reference: what both must stay below; 0 where no point does.
    """
    import moocore

    return float(moocore.hypervolume(np.reshape(means, (-1, 2)), ref=reference))


@checked
def hypervolumes(fronts: Fronts, reference: tuple[float, float]) -> list[Volume]:
    """Of each front, and of the union of all but the first; with 95 % intervals and paired differences to the first.

    Args:
        fronts: points that share their episodes.
        reference: error [m], energy [mJ a period].
    """
    if len(fronts) > 2:
        fronts = fronts | {OTHERS: join_points(list(fronts.values())[1:])}
    values = np.stack([point.values for point in join_points(fronts.values())], axis=1)  # (episodes, points, 2)
    ends = np.cumsum([len(points) for points in fronts.values()])[:-1]

    def measure(episodes: np.ndarray | slice) -> list[float]:
        # A mean over the first axis adds row by row: equal columns give equal bits.
        return [hypervolume(part, reference) for part in np.split(values[episodes].mean(axis=0), ends)]

    rng = np.random.default_rng(0)
    number = len(values)
    whole = np.array(measure(slice(None)))
    resampled = np.array([measure(rng.integers(number, size=number)) for _ in range(RESAMPLES)])
    return [
        Volume(
            name,
            Summary.around(whole[i], resampled[:, i]),
            Summary.around(whole[i] - whole[0], resampled[:, i] - resampled[:, 0]) if i else None,
        )
        for i, name in enumerate(fronts)
    ]


@checked
def save_front(evaluation: Evaluation, fronts: Fronts, volumes: list[Volume], out: str | Path) -> None:
    """Write front.csv, a row a point, and front.json, the hypervolumes and what made them, into a folder."""
    import moocore

    out = Path(out)
    out.mkdir(parents=True, exist_ok=True)
    with replacing(out / "front.csv") as path, open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        for name, points in fronts.items():
            for point in points:
                lam = "" if point.lam is None else point.lam
                error, energy = point.error, point.energy
                figures = (error.mean, error.low, error.high, energy.mean, energy.low, energy.high)
                writer.writerow([name, point.policy, lam, *figures])
    error_m, energy_mj = reference_point(evaluation.scenario)
    found = {
        "reference": {"error_m": error_m, "energy_mj": energy_mj},
        "hypervolumes": [
            {"front": volume.front, "hypervolume": vars(volume.hypervolume)}
            | ({} if volume.difference is None else {"difference_to_first": vars(volume.difference)})
            for volume in volumes
        ],
    }
    made_by = {"versions": versions() | {"moocore": moocore.__version__}}
    with replacing(out / "front.json") as path:
        path.write_text(json.dumps(evaluation.settings() | made_by | found, indent=1), encoding="utf-8")


def check_front_libraries(pictures: bool) -> None:
    """See that hypervolumes can be taken, and pictures drawn, before time is spent.

    Raises:
        ValueError: when a library is missing.
    """
    missing = [name for name in ("moocore", *(["matplotlib"] if pictures else [])) if find_spec(name) is None]
    if missing:
        raise ValueError(f"fronts need {' and '.join(missing)}: pip install 'wsn_env[front]'")
