"""Can any tracker beat the bound, or the reference? A particle filter that is given all laws tries.

    python -m studies.bound --episodes 2000 --particles 5000

It is written apart from the package's filters, and is given fields, schedules, the laws of start, motion and detection,
who was awake and silent, and (in the presets' own worlds) that tracks stay inside. Policies play with the scenario's
tracker; their episodes are tracked once more by this filter. Writes bound.md.
"""

from __future__ import annotations

import math
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numba
import numpy as np
import tyro

from wsn_env import Scenario, World, make_policy
from wsn_env.evaluation.files import replacing
from wsn_env.evaluation.intervals import Measured
from wsn_env.evaluation.progress import Progress, progress_bar
from wsn_env.evaluation.rollout import BLOCK, episodes, evaluation_seeds
from wsn_env.models.measurement.level import Level
from wsn_env.models.measurement.position import Position
from wsn_env.reports.markdown import markdown_table
from wsn_env.scenario.options import make_scenario
from wsn_env.simulation.bound import Bound, why_no_bound
from wsn_env.simulation.reference import Reference

FREE = {  # tracks whose law the bound supposes, in fields that they seldom leave
    "PreDC-v0": "motion=free",
    "Rssi-v0": "motion=free",
    "Anchors-v0": "motion=free spread_m=25 speed_ms=0.5 acceleration_ms2=0.1 filter_q=0.1",
    "Underwater-v0": "motion=free spread_m=60 speed_ms=0.5 acceleration_ms2=0.01",
}
ONE_MOTION = "manoeuvre_q=none"  # the tracker's q is what suits the motion
POLICIES = ("nearest3", "static_cluster")
KERNEL = 0.1  # sds of the cloud by which copies of a particle are parted


@dataclass
class Study:
    """RMS of the policy's own tracker and of a strong filter, over bound and reference."""

    scenarios: list[str]
    """Presets; each is played with its own motion and with a free one."""
    policies: list[str]
    """Names of policies."""
    episodes: int = 2000
    """Of the first policy with a free motion; a quarter as many elsewhere."""
    particles: int = 5000
    """Of the strong filter."""
    seed: int = 0
    """Which episodes, as of `wsn evaluate`."""
    out: Path = Path("out/bound")
    """Folder."""


class Played(NamedTuple):
    """What the filter gets of a block of episodes (B, K periods, S nodes), and what it is measured by."""

    positions: np.ndarray  # (B, S, 2) m
    start: np.ndarray  # (B, 4) mean of the first belief
    awake: np.ndarray  # (B, K, S) bool
    reported: np.ndarray  # (B, K, S) bool
    value: np.ndarray  # (B, K, S, 2)
    target: np.ndarray  # (B, K, 2) m


class Law(NamedTuple):
    """The world in numbers: eqs. 2-3 and 7, or a level h(d) = at_1m - slope ln d^2 - absorption d."""

    period_s: float
    q: float
    start_sds: tuple[float, float]  # of the first belief
    prior: tuple[float, float, float, float]  # middle of the field, sds of a free start about it; sds 0: none
    room: tuple[float, float]  # tracks stay inside of it [m]; 0: they may leave
    strengths: bool
    thresholded: bool
    noise: float  # m, or dB
    level: tuple[float, float, float, float]  # at 1 m, slope, absorption, floor [m]
    threshold: float  # dB
    curve: tuple[float, float, float, float, float, float]  # ceiling, (1 - delta) r, (1 + delta) r, l1, b1, b2


def law_of(scenario: Scenario) -> Law:
    """Of a scenario with positions or levels."""
    m, d, motion, t = scenario.measurement, scenario.detection, scenario.motion, scenario.tracking
    if not isinstance(m, (Position, Level)):
        raise ValueError(f"Scenario.measurement = {type(m).__name__}: allowed are Position, Rssi and Sonar")
    strengths, thresholded = hasattr(m, "noise_db"), d.values_decide
    q = scenario.track_q
    side_m, depth_m = scenario.field.room_m
    prior = tuple(map(float, (side_m / 2, depth_m / 2, *(motion.start_sds or (0, 0)))))
    level = (
        tuple(map(float, (m.at_1m_db, 5 * m.exponent / math.log(10), m.absorption_db_per_m, m.floor_m)))
        if strengths
        else (0.0,) * 4
    )
    curve = (0.0,) * 6
    if not thresholded:
        ends = (1 - d.softness) * d.radius_m, (1 + d.softness) * d.radius_m
        curve = tuple(map(float, (d.ceiling, *ends, d.decay, d.decay_power, d.edge_power)))
    return Law(
        float(scenario.period_s),
        float(q),
        (float(t.start_sd_m), float(t.start_sd_ms)),
        prior,
        (float(side_m), float(depth_m)) if motion.bounded else (0.0, 0.0),
        strengths,
        thresholded,
        float(m.noise_db if strengths else m.noise_m),
        level,
        float(d.threshold_db) if thresholded else 0.0,
        curve,
    )


def play(policy: str, scenario: Scenario, seeds: list[int], bound: Bound | None) -> tuple[Played, np.ndarray, ...]:
    """A block of episodes; and (B,) mean squares of the policy's own tracker and of the reference."""
    world, reference = World(scenario), Reference(scenario, len(seeds))
    own, periods, began = np.zeros(len(seeds)), [], []

    def begin(state, _):
        reference.begin(state)
        began.append(state.belief.mean.copy())
        if bound is not None:
            bound.begin(state)

    rows = np.arange(len(seeds))[:, None]
    for state, outcome in episodes(make_policy(policy, scenario), world, seeds, begin):
        reference.advance(state, outcome)
        if bound is not None:
            bound.advance(state, outcome)
        own += outcome.error_m**2 / scenario.periods
        network, reports, nodes = state.network, state.reports, scenario.field.nodes
        awake, reported = np.zeros((2, len(seeds), nodes + 1), bool)
        value = np.zeros((len(seeds), nodes + 1, 2))
        listed = np.arange(nodes) < network.n_members[:, None]
        awake[rows, np.where(listed, network.members, nodes)] = True
        awake[rows, np.where(network.head < 0, nodes, network.head)[:, None]] = True
        awake[np.asarray(outcome.searched, bool)] = True
        came = np.where(np.arange(nodes) < reports.count[:, None], reports.node, nodes)
        reported[rows, came], value[rows, came] = True, reports.value
        cut = slice(0, nodes)
        periods.append((awake[:, cut], reported[:, cut], value[:, cut], outcome.target_m.copy()))
    awake, reported, value, target = (np.stack(each, axis=1) for each in zip(*periods, strict=True))
    played = Played(network.positions.copy(), began[0], awake | reported, reported, value, target)
    return played, own, reference.episode_m() ** 2


@numba.njit(fastmath=True)
def probability(law, d2, h):
    """Of detection, at a squared distance [m^2] and its mean level [dB]."""
    if law.thresholded:
        return 0.5 * math.erfc((law.threshold - h) / law.noise * 0.7071067811865476)
    ceiling, inner, outer, l1, b1, b2 = law.curve
    d = math.sqrt(d2)
    if d <= inner:
        return ceiling
    if d >= outer:
        return 0.0
    return ceiling * math.exp(-l1 * (d - inner) ** b1 / (outer - d) ** b2)


@numba.njit(fastmath=True, nogil=True)
def spread_copies(x):
    """Part copies by a normal kernel that keeps the cloud's mean and covariance (Liu & West, 2001)."""
    axes, particles = x.shape
    mean, cov = np.zeros(axes), np.zeros((axes, axes))
    for i in range(axes):
        mean[i] = x[i].sum() / particles
    for i in range(axes):
        for j in range(i + 1):
            cov[i, j] = ((x[i] - mean[i]) * (x[j] - mean[j])).sum() / particles
            cov[j, i] = cov[i, j]
        cov[i, i] += 1e-12
    kept, factor = math.sqrt(1.0 - KERNEL**2), KERNEL * np.linalg.cholesky(cov)
    for n in range(particles):
        for i in range(axes):
            x[i, n] = mean[i] + kept * (x[i, n] - mean[i])
        for j in range(axes):
            noise = np.random.normal()
            for i in range(j, axes):
                x[i, n] += factor[i, j] * noise


@numba.njit(fastmath=True, nogil=True)
def track(law, episode, particles, seed):
    """Mean square error of a bootstrap filter's mean over an episode [m^2]."""
    positions, start, awake, reported, value, target = episode
    periods, nodes = awake.shape
    square = 0.0
    np.random.seed(seed)
    x, moved = np.empty((4, particles)), np.empty((4, particles))
    weight = np.full(particles, 1.0 / particles)
    for axis in range(4):
        mean, sd = start[axis], law.start_sds[axis % 2]
        own = law.prior[2 + axis % 2]
        if own > 0.0:
            centre = law.prior[axis // 2] if axis % 2 == 0 else 0.0
            precision = 1.0 / sd**2 + 1.0 / own**2
            mean, sd = (mean / sd**2 + centre / own**2) / precision, precision**-0.5
        for i in range(particles):
            x[axis, i] = mean + sd * np.random.normal()
    t = law.period_s
    for k in range(periods):
        for i in range(particles):
            for axis in (0, 2):
                a = law.q * np.random.normal()
                x[axis, i] += t * x[axis + 1, i] + 0.5 * t * t * a
                x[axis + 1, i] += t * a
        logs = np.zeros(particles)
        if law.room[0] > 0.0:
            for i in range(particles):
                if x[0, i] < 0.0 or x[0, i] > law.room[0] or x[2, i] < 0.0 or x[2, i] > law.room[1]:
                    logs[i] = -1e3
        for n in range(nodes):
            if not awake[k, n]:
                continue
            px, py, z0, z1 = positions[n, 0], positions[n, 1], value[k, n, 0], value[k, n, 1]
            for i in range(particles):
                dx, dy = x[0, i] - px, x[2, i] - py
                d2, h = dx * dx + dy * dy, 0.0
                if law.strengths:
                    near = max(d2, law.level[3] ** 2)
                    h = law.level[0] - law.level[1] * math.log(near) - law.level[2] * math.sqrt(near)
                if not reported[k, n]:
                    logs[i] += math.log(max(1.0 - probability(law, d2, h), 1e-12))
                    continue
                if not law.thresholded:
                    logs[i] += math.log(max(probability(law, d2, h), 1e-12))
                if law.strengths:
                    logs[i] -= 0.5 * ((z0 - h) / law.noise) ** 2
                else:
                    logs[i] -= 0.5 * ((z0 - x[0, i]) ** 2 + (z1 - x[2, i]) ** 2) / law.noise**2
        highest, total = logs.max(), 0.0
        for i in range(particles):
            weight[i] *= math.exp(logs[i] - highest)
            total += weight[i]
        mx, my, squared = 0.0, 0.0, 0.0
        for i in range(particles):
            weight[i] /= total
            squared += weight[i] ** 2
            mx += weight[i] * x[0, i]
            my += weight[i] * x[2, i]
        square += ((mx - target[k, 0]) ** 2 + (my - target[k, 1]) ** 2) / periods
        if squared * particles > 2.0:  # fewer than half effective: systematic resampling
            sum_, j, first = weight[0], 0, np.random.random()
            for i in range(particles):
                while sum_ < (i + first) / particles and j < particles - 1:
                    j += 1
                    sum_ += weight[j]
                moved[:, i] = x[:, j]
            x, moved = moved, x
            weight[:] = 1.0 / particles
            spread_copies(x)
    return square


def track_all(law: Law, played: Played, particles: int, first_seed: int) -> np.ndarray:
    """(B,) mean square error of each episode, by threads."""
    work = [(law, Played(*(array[b] for array in played)), particles, first_seed + b) for b in range(len(played.start))]
    with ThreadPoolExecutor() as pool:
        return np.array(list(pool.map(lambda one: track(*one), work)))


class Compared(NamedTuple):
    """Mean squares by episode [m^2] of the policy's own tracker, the strong filter and the reference; the bound [m]."""

    own: np.ndarray
    strong: np.ndarray
    reference: np.ndarray
    bound: Measured | None

    def over_bound(self) -> Measured | None:
        """The strong filter's root mean square error over the bound."""
        if self.bound is None:
            return None
        strong, ratio = Measured.root_mean(self.strong), Measured.root_mean(self.strong).value / self.bound.value
        return Measured(ratio, ratio * math.hypot(strong.stderr / strong.value, self.bound.stderr / self.bound.value))


def compare(policy: str, scenario: Scenario, study: Study, progress: Progress) -> Compared:
    """Play and track once more."""
    bound = None if why_no_bound(scenario) else Bound(scenario)
    seeds, law, parts = evaluation_seeds(study.seed, study.episodes), law_of(scenario), []
    block = max(2, min(BLOCK, study.episodes // 10))  # the bound's standard error is between blocks
    for start in range(0, len(seeds), block):
        played, own, reference = play(policy, scenario, seeds[start : start + block], bound)
        parts.append((own, track_all(law, played, study.particles, start), reference))
        progress(min(start + block, len(seeds)), len(seeds), f"{scenario.name}, {policy}")
    least = None if bound is None else Measured(bound.rms_m(), bound.stderr_m())
    return Compared(*map(np.concatenate, zip(*parts, strict=True)), least)


def row_of(scenario: Scenario, policy: str, found: Compared) -> list[str]:
    """Of the table."""
    own, strong = Measured.root_mean(found.own), Measured.root_mean(found.strong)
    ratios = found.over_bound() or "-", Measured.root_ratio(found.strong, found.reference)
    motion = type(scenario.motion).__name__.lower()
    return [f"{scenario.name}, {motion}, {policy}", *map(str, (own, strong, *ratios))]


def main(arguments: list[str] | None = None) -> int:
    """Run, print, write bound.md."""
    default = Study(list(FREE), list(POLICIES))
    study = tyro.cli(Study, args=arguments, default=default, description=__doc__)
    rows = []
    for name in study.scenarios:
        for settings in (FREE[name] + " search=False", ""):
            scenario = make_scenario(name, [*settings.split(), ONE_MOTION], [])
            for policy in study.policies:
                whole = not why_no_bound(scenario) and policy == study.policies[0]
                asked = study if whole else replace(study, episodes=max(study.episodes // 4, 2))
                with progress_bar() as report:
                    found = compare(policy, scenario, asked, report)
                rows.append(row_of(scenario, policy, found))
                print(" | ".join(rows[-1]), flush=True)
    columns = ("world, motion, policy", "own tracker m", "strong filter m", "over the bound", "over the reference")
    text = markdown_table(columns, rows)
    study.out.mkdir(parents=True, exist_ok=True)
    with replacing(study.out / "bound.md") as path:
        path.write_text(text, encoding="utf-8")
    print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
