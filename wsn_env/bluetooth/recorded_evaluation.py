"""Comparison on recorded tracks: each is replayed, with a calibration made without it.

An episode is a track with the draws of one seed, which are those of the filter (and of random policies): the packets
are always the recorded ones. Means are taken over the tracks first, so that a long track counts no more than a short
one; their spread over seeds says how much the filter's random numbers matter, not how another track would turn out.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wsn_env.bluetooth.fitting import calibrate, leave_one_out
from wsn_env.evaluation.comparison import COLUMNS, Evaluation, evaluate, stem_of
from wsn_env.evaluation.files import replacing
from wsn_env.evaluation.kept_blocks import remove_kept_blocks
from wsn_env.evaluation.policies import named_policies
from wsn_env.evaluation.progress import Progress
from wsn_env.evaluation.rollout import Engine
from wsn_env.evaluation.versions import versions
from wsn_env.models.arguments import checked, checked_but
from wsn_env.models.quantity import ScenarioError, whole_number
from wsn_env.models.recordings.dataset import read_dataset, track_files, track_name
from wsn_env.models.recordings.files import DatasetError
from wsn_env.scenario import Scenario


@dataclass(frozen=True)
class RecordedEvaluation:
    """Evaluations by track, of the same policies, lams and seeds."""

    by_track: dict[str, Evaluation]
    notes: tuple[str, ...] = ()  # what must be said of the files, see `Track.note`

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

    @property
    def description(self) -> str:
        """How many tracks there are, and how often each was replayed."""
        return f"{len(self.by_track)} recorded tracks, {self.first.episodes} filter seeds each"

    def family(self, stem: str, lam: float) -> list[str]:
        """The members of a numbered family, the most frugal first."""
        members = [policy for policy in self.first.policies if policy != stem and stem_of(policy) == stem]
        return sorted(members, key=lambda policy: self.mean(policy, lam, "energy_mj"))

    def rms_at_energy_m(self, stem: str, lam: float, energy_mj: float) -> float | None:
        """RMS of a family at an energy, on straight lines between its members [m]; None: beyond them."""
        members = self.family(stem, lam)
        energies = [self.mean(policy, lam, "energy_mj") for policy in members]
        if len(members) < 2 or not energies[0] <= energy_mj <= energies[-1]:
            return None
        return float(np.interp(energy_mj, energies, [self.mean(policy, lam, "rms_m") for policy in members]))

    def save(self, out: str | Path) -> None:
        """Write tracks.csv and tracks.json into a folder, each whole or not at all."""
        out = Path(out)
        out.mkdir(parents=True, exist_ok=True)
        with replacing(out / "tracks.csv") as path, open(path, "w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, ["track", *COLUMNS], lineterminator="\n")
            writer.writeheader()
            for name, each in self.by_track.items():
                writer.writerows({"track": name} | row for row in each.rows)
        settings = {name: each.settings() for name, each in self.by_track.items()}
        with replacing(out / "tracks.json") as path:
            path.write_text(json.dumps({"tracks": settings, "versions": versions()}, indent=1), encoding="utf-8")


@checked_but("policies", "lams", "seeds", "seed")
def evaluate_recorded(  # noqa: PLR0913
    policies: str | Sequence[str],
    scenario: Scenario,
    folder: str | Path,
    lams: float | Sequence[float] | None = None,
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
        scenario: one with a beacon's receivers; {track} in its residual_map stands for the track's name, too.
        folder: of the published format: tetam.dev and *.mbd.
        lams: the trade-offs [m/mJ]; None: the scenario's.
        seeds: of the filter, for each track.
        seed: as for `evaluate`.
        keep, progress, engine: as for `evaluate`.
        calibrated: the scenario's own calibration serves all tracks; else each is calibrated on all others.

    Raises:
        ValueError: another scenario, nothing to read, or too few tracks to leave one out.
    """
    _check_receivers(scenario)
    seeds = whole_number("seeds", seeds, 1)
    paths = {track_name(path): path for path in track_files(folder)}
    scenarios = {name: scenario for name in paths}
    if not calibrated:
        if len(paths) < 2:
            raise ValueError(
                f"{folder}: holds one track: leaving it out leaves none to calibrate on (give calibration=)"
            )
    tracks = read_dataset(folder)
    if not calibrated:
        for track, without in zip(tracks, leave_one_out(tracks)):
            scenarios[track.name] = scenario.override(**without.quantities)
    scenarios = {name: _replay_track(scenarios[name], name, path) for name, path in paths.items()}
    named = {name: named_policies(insert_track_name(policies, name), scenarios[name]) for name in paths}
    evaluations = {}
    for number, name in enumerate(paths):
        evaluations[name] = evaluate(
            named[name],
            scenarios[name],
            lams,
            seeds,
            seed,
            keep=None if keep is None else Path(keep) / "tracks" / name,
            progress=progress and _progress_of_track(progress, number, len(paths), name),
            engine=engine,
        )
    return RecordedEvaluation(evaluations, tuple(track.note for track in tracks if track.note))


def insert_track_name(policies: Any, track: str) -> Any:
    """Names of policies, with the track's for {track}."""
    policies = [policies] if isinstance(policies, str) else policies
    if not isinstance(policies, Sequence):
        return policies  # policies by label, or what `named_policies` refuses
    return [policy.replace("{track}", track) if isinstance(policy, str) else policy for policy in policies]


@checked
def replay_scenario(scenario: Scenario, path: str | Path, calibrated: bool = False) -> Scenario:
    """The replay of one track, calibrated on the others of its folder if there are any.

    Args:
        scenario: one with a beacon's receivers.
        path: of the track.
        calibrated: the scenario has its own calibration.

    Raises:
        ValueError: another scenario, or no such track.
    """
    _check_receivers(scenario)
    path = Path(path)
    if not path.is_file():
        raise DatasetError(f"{path}: is no file; a recorded track is a *.mbd file")
    if not calibrated and len(track_files(path.parent)) > 1:
        others = [track for track in read_dataset(path.parent) if track.name != track_name(path)]
        scenario = scenario.override(**calibrate(others).quantities)
    return _replay_track(scenario, track_name(path), path)


def _check_receivers(scenario: Scenario) -> None:
    """Raise ScenarioError unless errors last, as those of received levels do: what a calibration is made for."""
    if not scenario.measurement.lasting_errors:
        raise ScenarioError(
            f"scenario = {scenario.name!r}: has no receivers that hear a beacon; recorded tracks are for Ble-v0"
        )


def _replay_track(scenario: Scenario, name: str, path: Path) -> Scenario:
    residual_map = getattr(scenario.measurement, "residual_map", None)
    maps = {} if residual_map is None else {"residual_map": residual_map.replace("{track}", name)}
    return scenario.override(motion="replay", recording=str(path), **maps)


def _progress_of_track(progress: Progress, number: int, of: int, name: str) -> Progress:
    return lambda done, total, what: progress(number * total + done, of * total, f"{name}: {what}")


def remove_recorded_blocks(out: str | Path) -> None:
    """Remove the kept blocks of a finished run, with those of tracks that are there no more; other files stay."""
    tracks = Path(out) / "tracks"
    for folder in [path for path in tracks.iterdir() if path.is_dir() and not path.is_symlink()]:
        remove_kept_blocks(folder)
        _remove_if_empty(folder)
    _remove_if_empty(tracks)


def _remove_if_empty(folder: Path) -> None:
    if not any(folder.iterdir()):
        folder.rmdir()
