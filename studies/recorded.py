"""Schedulers trained in simulation, on recorded radio: the table and the pictures of docs/real_data.md.

    python -m studies.recorded --tracks FOLDER --out out/recorded

For every track a policy is trained in the simulated form of Ble-v0, calibrated on all other tracks; then all policies
replay all tracks. A study that was stopped continues.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import tyro

from wsn_env.bluetooth.fitting import leave_one_out
from wsn_env.bluetooth.recorded_evaluation import (
    RecordedEvaluation,
    evaluate_recorded,
    remove_recorded_blocks,
)
from wsn_env.envs.rendering.colours import BLUE, DARK, SKY, VERMILION
from wsn_env.evaluation.files import replacing
from wsn_env.evaluation.policies import make_policy
from wsn_env.evaluation.progress import progress_bar
from wsn_env.evaluation.rollout import episodes
from wsn_env.models.recordings.dataset import read_dataset
from wsn_env.reports.recorded_tables import print_recorded_tables, save_recorded
from wsn_env.scenario import Scenario
from wsn_env.simulation.world import World
from wsn_env.training.settings import Training
from wsn_env.training.trainer import train

MEMBERS = (1, 2, 3, 5)  # further ones: 2, 3, 4 and 6 of the receivers listen
RULES = (
    *(f"informed{n}" for n in range(9)),
    *(f"{rule}:n={n}" for rule in ("quadrants", "random", "strongest") for n in MEMBERS),
    *(f"nearest{n}" for n in MEMBERS),
    *(f"every:n={n}" for n in (6, 4, 3, 2)),
    *("pre_dc", "centroid", "static_cluster", "greedy"),
)
LAMS = (0.001, 0.002, 0.004, 0.008, 0.016)


@dataclass
class Study:
    """Train without each track in simulation, replay all."""

    tracks: Path
    """Folder of the published format: tetam.dev and *.mbd."""
    steps: int = 1_000_000
    """Periods of each training; 0: none."""
    particles: int = 400
    """Of the trainings."""
    seeds: int = 10
    """Of the filter, for each track."""
    lam: list[float] = field(default_factory=lambda: list(LAMS))
    """Trade-offs [m/mJ]."""
    rules: list[str] = field(default_factory=lambda: list(RULES))
    """Hand-written policies beside `all`."""
    show: str = "straight_05"
    """The track of the replay picture."""
    out: Path = Path("out/recorded")
    """Folder for calibrations, runs, tables and pictures."""


def main() -> int:
    """Run."""
    asked = tyro.cli(Study, description=__doc__)
    tracks = read_dataset(asked.tracks)
    (asked.out / "calibrations").mkdir(parents=True, exist_ok=True)
    for calibration in leave_one_out(tracks):
        path = asked.out / "calibrations" / f"without_{calibration.left_out}.json"
        calibration.save(path)
        if asked.steps:
            train(training_without(asked, calibration.left_out, path))
    learned = [f"ppo={asked.out}/runs/without_{{track}}/policy.json"] if asked.steps else []
    with progress_bar() as report:
        evaluation = evaluate_recorded(
            ["all", *learned, *asked.rules],
            Scenario.named("Ble-v0"),
            asked.tracks,
            asked.lam,
            asked.seeds,
            keep=asked.out,
            progress=report,
        )
    names = save_recorded(evaluation, asked.out)
    remove_recorded_blocks(asked.out)
    print_recorded_tables(evaluation)
    draw_replay(evaluation, asked, asked.out / "replay.png")
    print(f"written: {', '.join(str(asked.out / name) for name in (*names, 'replay.png'))}")
    return 0


def training_without(asked: Study, left_out: str, calibration: Path) -> Training:
    """Of the policy that has not seen a track, nor a calibration that has."""
    return Training(
        scenario="Ble-v0",
        set=[f"particles={asked.particles}", f"calibration={calibration}"],
        steps=asked.steps,
        episodes=0,
        runs=asked.out / "runs",
        name=f"without_{left_out}",
        resume=True,
    )


def draw_replay(evaluation: RecordedEvaluation, asked: Study, path: Path) -> None:
    """Picture of one track under one policy: where it was taken to be, who listened, the error and the energy."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    name = asked.show if asked.show in evaluation.by_track else next(iter(evaluation.by_track))
    scenario = evaluation.by_track[name].scenario.override(lam=asked.lam[len(asked.lam) // 2])
    policy = f"{asked.out}/runs/without_{name}/policy.json" if asked.steps else "informed3"
    positions, listened, errors, sds, awake = [], np.zeros(scenario.field.nodes), [], [], []
    for state, outcome in episodes(make_policy(policy, scenario), World(scenario), [evaluation.first.rows[0]["seed"]]):
        positions.append((*outcome.target_m[0], *outcome.estimate_m[0]))
        errors.append(outcome.error_m[0])
        sds.append(outcome.posterior_rms_m[0])
        awake.append(outcome.members[0])
        if state.network.head[0] >= 0:
            listened[state.network.head[0]] += 1
            listened[state.network.members[0, : state.network.n_members[0]]] += 1
    positions, time = np.array(positions), np.arange(1, len(positions) + 1) * scenario.period_s
    figure, axes = plt.subplot_mosaic([["room", "error"], ["room", "load"]], figsize=(11, 5.6), layout="constrained")
    room, error, load = axes["room"], axes["error"], axes["load"]
    width, depth = scenario.field.room_m
    room.add_patch(plt.Rectangle((0, 0), width, depth, fill=False, color=DARK))
    places = np.array(scenario.field.positions)
    area = 30 + 500 * listened / len(positions)
    room.scatter(*places.T, s=area, color=SKY, label="receiver; area: how often it listened")
    room.plot(*positions[:, :2].T, color=DARK, linewidth=2.5, label="recorded way")
    room.plot(*positions[:, 2:].T, color=VERMILION, linewidth=1.2, marker=".", markersize=4, label="estimate")
    room.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", title=f"{name}, lam = {scenario.lam:g} m/mJ")
    room.set_ylim(-4.5, depth + 1)
    room.legend(loc="lower center", frameon=False, ncols=2, fontsize=9, markerscale=0.4)
    error.plot(time, errors, color=VERMILION, label="error")
    error.plot(time, sds, color=BLUE, linewidth=1, linestyle="--", label="what the belief expects")
    error.set(ylabel="m", ylim=(0, None))
    error.legend(frameon=False, fontsize=9)
    load.step(time, awake, where="mid", color=DARK)
    load.set(xlabel="time [s]", ylabel="listening receivers", ylim=(0, len(places)))
    for chart in (error, load):
        chart.grid(alpha=0.3)
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=140, format="png")
    plt.close(figure)


if __name__ == "__main__":
    sys.exit(main())
