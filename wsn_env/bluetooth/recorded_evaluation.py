"""Comparison on recorded tracks: each is replayed, with a calibration that has not seen it.

An episode is a track with the draws of one seed, which are those of the filter (and of policies that throw dice): the
packets are always the recorded ones. Means are taken over the tracks first, so that a long track counts no more than a
short one; their spread over seeds says how far the filter's luck goes, not how another track would turn out.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wsn_env.bluetooth.calibration import calibrate, leave_one_out
from wsn_env.envs.rendering.colours import BLUE, DARK, GREEN, ORANGE, PURPLE, SKY, VERMILION, YELLOW
from wsn_env.evaluation.comparison import COLUMNS, Evaluation, evaluate, stem_of
from wsn_env.evaluation.files import replacing
from wsn_env.evaluation.kept_blocks import forget_blocks
from wsn_env.evaluation.progress import Progress
from wsn_env.evaluation.rollout import Engine
from wsn_env.evaluation.versions import versions
from wsn_env.models.quantity import ScenarioError
from wsn_env.models.recordings.dataset import DatasetError, read_dataset, track_files, track_name
from wsn_env.reports.pictures import can_draw, plain, write_picture
from wsn_env.reports.tables import wide_console
from wsn_env.scenario import Scenario

REFERENCE = "all"
FAMILIES = (BLUE, ORANGE, GREEN, PURPLE, SKY, YELLOW)


@dataclass(frozen=True)
class RecordedEvaluation:
    """Evaluations by track, of the same policies, lams and seeds."""

    by_track: dict[str, Evaluation]

    @property
    def first(self) -> Evaluation:
        """What is alike for all tracks can be asked of any."""
        return next(iter(self.by_track.values()))

    def values(self, policy: str, lam: float, column: str) -> np.ndarray:
        """(tracks, seeds)."""
        return np.stack([each.values(policy, lam, column) for each in self.by_track.values()])

    def mean(self, policy: str, lam: float, column: str) -> float:
        """Over seeds and tracks."""
        return float(self.values(policy, lam, column).mean())

    def spread(self, policy: str, lam: float, column: str) -> float:
        """sd over seeds of the mean over tracks."""
        means = self.values(policy, lam, column).mean(axis=0)
        return float(means.std(ddof=1)) if len(means) > 1 else 0.0

    def family(self, stem: str, lam: float) -> list[str]:
        """The members of a numbered family, the most frugal first."""
        members = [policy for policy in self.first.policies if policy != stem and stem_of(policy) == stem]
        return sorted(members, key=lambda policy: self.mean(policy, lam, "energy_mj"))

    def at_energy(self, stem: str, lam: float, energy_mj: float) -> float | None:
        """RMS of a family at an energy, on straight lines between its members [m]; None: beyond them."""
        members = self.family(stem, lam)
        energies = [self.mean(policy, lam, "energy_mj") for policy in members]
        if len(members) < 2 or not energies[0] <= energy_mj <= energies[-1]:
            return None
        return float(np.interp(energy_mj, energies, [self.mean(policy, lam, "rms_m") for policy in members]))


def evaluate_recorded(
    policies: Sequence[str],
    scenario: Scenario,
    folder: str | Path,
    lams: Sequence[float] | None = None,
    seeds: int = 10,
    seed: int = 0,
    keep: str | Path | None = None,
    progress: Progress | None = None,
    engine: Engine | None = None,
    calibrated: bool = False,
) -> RecordedEvaluation:
    """Replay every track of a folder under every policy.

    Args:
        policies: as for `evaluate`; {track} in a name or path stands for the track's name, for policies that were
            trained without it.
        scenario: a Beacon scenario; {track} in its residual_map stands for the track's name, too.
        folder: of the published format: tetam.dev and *.mbd.
        lams: the trade-offs [m/mJ]; None: the scenario's.
        seeds: of the filter, for each track.
        seed: as for `evaluate`.
        keep, progress, engine: as for `evaluate`.
        calibrated: the scenario's own calibration serves all tracks; else each is calibrated on all others.

    Raises:
        ValueError: another scenario, nothing to read, or too few tracks to leave one out.
    """
    _check_hears(scenario)
    paths = {track_name(path): path for path in track_files(folder)}
    known = {name: scenario for name in paths}
    if not calibrated:
        if len(paths) < 2:
            raise ValueError(
                f"{folder}: holds one track: leaving it out leaves none to calibrate on (give calibration=)"
            )
        for each in leave_one_out(read_dataset(folder)):
            known[each.left_out] = scenario.override(**each.quantities)
    evaluations = {}
    for number, (name, path) in enumerate(paths.items()):
        evaluations[name] = evaluate(
            of_track(policies, name),
            _replay(known[name], name, path),
            lams,
            seeds,
            seed,
            keep=None if keep is None else Path(keep) / "tracks" / name,
            progress=progress and _shifted(progress, number, len(paths), name),
            engine=engine,
        )
    return RecordedEvaluation(evaluations)


def of_track(policies: Sequence[str], track: str) -> list[str]:
    """Names of policies, with the track's for {track}."""
    return [policy.replace("{track}", track) for policy in policies]


def replay_scenario(scenario: Scenario, path: str | Path, calibrated: bool = False) -> Scenario:
    """The replay of one track, calibrated on the others of its folder if there are any.

    Args:
        scenario: a Beacon scenario.
        path: of the track.
        calibrated: the scenario has its own calibration.

    Raises:
        ValueError: another scenario, or no such track.
    """
    _check_hears(scenario)
    path = Path(path)
    if not path.is_file():
        raise DatasetError(f"{path}: is no file; a recorded track is a *.mbd file")
    if not calibrated and len(track_files(path.parent)) > 1:
        others = [track for track in read_dataset(path.parent) if track.name != track_name(path)]
        scenario = scenario.override(**calibrate(others).quantities)
    return _replay(scenario, track_name(path), path)


def _check_hears(scenario: Scenario) -> None:
    if not scenario.measurement.lasting_errors:
        raise ScenarioError(
            f"scenario = {scenario.name!r}: has no receivers that hear a beacon; recorded tracks are for Ble-v0"
        )


def _replay(scenario: Scenario, name: str, path: Path) -> Scenario:
    maps = scenario.measurement.residual_map
    maps = maps and maps.replace("{track}", name)
    return scenario.override(motion="replay", recording=str(path), residual_map=maps)


def _shifted(progress: Progress, number: int, of: int, name: str) -> Progress:
    return lambda done, total, what: progress(number * total + done, of * total, f"{name}: {what}")


def table(evaluation: RecordedEvaluation, lam: float) -> tuple[list[str], list[list[str]]]:
    """Header and rows: the mean RMS over the tracks, its ratio to that of all receivers, consistency, energy, and each
    track's RMS."""
    first = evaluation.first
    reference = evaluation.mean(REFERENCE, lam, "rms_m") if REFERENCE in first.policies else None
    header = ["policy", "RMS m", "sd over seeds", "/ all", "e²/trace", "energy mJ/period", "listening"]
    rows = []
    for policy in first.policies:
        rms = evaluation.mean(policy, lam, "rms_m")
        rows.append(
            [
                policy,
                f"{rms:.2f}",
                f"{evaluation.spread(policy, lam, 'rms_m'):.2f}",
                "" if reference is None else f"{rms / reference:.2f}",
                f"{evaluation.mean(policy, lam, 'anees'):.2f}",
                f"{evaluation.mean(policy, lam, 'energy_mj'):.1f}",
                f"{evaluation.mean(policy, lam, 'members'):.1f}",
                *(f"{value:.2f}" for value in evaluation.values(policy, lam, "rms_m").mean(axis=1)),
            ]
        )
    return header + list(evaluation.by_track), rows


def remarks(evaluation: RecordedEvaluation, lam: float) -> list[str]:
    """How each single policy stands to each family at its energy."""
    lines, policies = [], evaluation.first.policies
    stems = evaluation.first.families()
    for policy in policies:
        if stem_of(policy) in stems:
            continue
        energy, rms = evaluation.mean(policy, lam, "energy_mj"), evaluation.mean(policy, lam, "rms_m")
        for stem in stems:
            there = evaluation.at_energy(stem, lam, energy)
            if there is not None:
                lines.append(
                    f"{policy}: {rms:.2f} m at {energy:.1f} mJ; {stem} at that energy, interpolated: {there:.2f} m"
                )
    return lines


def print_recorded(evaluation: RecordedEvaluation) -> None:
    """A table for each lam."""
    from rich.table import Table

    console = wide_console()
    for lam in evaluation.first.lams:
        header, rows = table(evaluation, lam)
        title = f"{evaluation.first.scenario.name}, {about_the_tracks(evaluation)}, lam = {lam:g} m/mJ"
        drawn = Table(title=title, caption="\n".join(remarks(evaluation, lam)))
        for name in header:
            drawn.add_column(name, justify="left" if name == "policy" else "right")
        for row in rows:
            drawn.add_row(*row)
        console.print(drawn)


def about_the_tracks(evaluation: RecordedEvaluation) -> str:
    """How many there are, and how often each was replayed."""
    return f"{len(evaluation.by_track)} recorded tracks, {evaluation.first.episodes} filter seeds each"


def markdown(evaluation: RecordedEvaluation) -> str:
    """The same as Markdown."""
    parts = []
    for lam in evaluation.first.lams:
        header, rows = table(evaluation, lam)
        lines = [f"## {about_the_tracks(evaluation)}, lam = {lam:g} m/mJ", ""]
        lines += ["| " + " | ".join(header) + " |", "|---" + "|--:" * (len(header) - 1) + "|"]
        lines += ["| " + " | ".join(row) + " |" for row in rows]
        parts.append("\n".join([*lines, "", *(f"- {line}" for line in remarks(evaluation, lam))]))
    return "\n\n".join(parts) + "\n"


def save_recorded(evaluation: RecordedEvaluation, out: str | Path) -> list[str]:
    """Write tracks.csv, .json, .md and, with matplotlib, .png into a folder, each whole or not at all; returns their
    names."""
    out = Path(out)
    out.mkdir(parents=True, exist_ok=True)
    with replacing(out / "tracks.csv") as path, open(path, "w", newline="") as file:
        writer = csv.DictWriter(file, ["track", *COLUMNS], lineterminator="\n")
        writer.writeheader()
        for name, each in evaluation.by_track.items():
            writer.writerows({"track": name} | row for row in each.rows)
    settings = {name: each.settings() for name, each in evaluation.by_track.items()}
    with replacing(out / "tracks.json") as path:
        path.write_text(json.dumps({"tracks": settings, "versions": versions()}, indent=1))
    with replacing(out / "tracks.md") as path:
        path.write_text(markdown(evaluation))
    names = ["tracks.csv", "tracks.json", "tracks.md"]
    if can_draw():
        names.append("tracks.png")
        write_picture(out / "tracks.png", draw_recorded(evaluation))
    return names


def forget_recorded_blocks(evaluation: RecordedEvaluation, out: str | Path) -> None:
    """Remove the kept blocks of a finished run."""
    out = Path(out)
    for name in evaluation.by_track:
        forget_blocks(out / "tracks" / name)
        (out / "tracks" / name).rmdir()
    (out / "tracks").rmdir()


def draw_recorded(evaluation: RecordedEvaluation):
    """Figure of RMS against energy: families as lines, single policies as points, one for each lam that they see."""
    from matplotlib.figure import Figure

    lams, policies = evaluation.first.lams, evaluation.first.policies
    lam = lams[0]
    stems = evaluation.first.families()
    figure = Figure(figsize=(8, 5.2), layout="constrained")
    axes = figure.subplots()
    colours = iter(FAMILIES)
    for stem in stems:
        members = evaluation.family(stem, lam)
        xs = [evaluation.mean(policy, lam, "energy_mj") for policy in members]
        ys = [evaluation.mean(policy, lam, "rms_m") for policy in members]
        axes.errorbar(
            xs,
            ys,
            yerr=[evaluation.spread(policy, lam, "rms_m") for policy in members],
            marker="o",
            markersize=4,
            linewidth=1.2,
            color=next(colours, DARK),
            label=plain(stem.rstrip(":=n")),
        )
    for k, policy in enumerate(policies):
        if stem_of(policy) not in stems:
            points = [[evaluation.mean(policy, each, name) for name in ("energy_mj", "rms_m")] for each in lams]
            points = sorted(dict.fromkeys(map(tuple, points)))  # one, if it does not look at lam
            learned = policy.startswith("ppo")
            style = dict(marker="*", markersize=13, color=VERMILION) if learned else dict(marker="s", color=DARK)
            axes.plot(*zip(*points), linewidth=1.2, zorder=4 if learned else 3, **style)
            side = (6, 8) if k % 2 else (6, -13)
            axes.annotate(plain(policy), points[-1], xytext=side, textcoords="offset points", fontsize=9)
    axes.set_xlabel("energy [mJ per period]")
    axes.set_ylabel("RMS error, mean over the tracks [m]")
    axes.set_title(plain(f"{evaluation.first.scenario.name}: {about_the_tracks(evaluation)}"))
    axes.grid(alpha=0.3)
    if stems:
        axes.legend(frameon=False)
    return figure
