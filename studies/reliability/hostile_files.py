"""Files of every kind that are given to this package, damaged at random: each is read, or refused in one line."""

from __future__ import annotations

import contextlib
import io
import shutil
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from wsn_env import Scenario, evaluate, make_policy
from wsn_env.agents.ppo import PRETRAINED
from wsn_env.bluetooth.calibration import Calibration
from wsn_env.bluetooth.fitting import calibrate
from wsn_env.bluetooth.residual_map import residual_map, save_map
from wsn_env.bluetooth.synthetic import write_dataset
from wsn_env.evaluation.kept_blocks import BLOCKS_FILE
from wsn_env.evaluation.progress import Progress
from wsn_env.learning.checkpoint_file import read_checkpoint, write_checkpoint
from wsn_env.learning.run_folder import open_folder
from wsn_env.models.recordings.dataset import read_dataset, read_track
from wsn_env.models.recordings.receivers import read_receivers
from wsn_env.models.recordings.replay import load_map
from wsn_env.models.recordings.tracks import read_track as read_csv_track
from wsn_env.reports.pages.learning_curves import read_progress

SMALL = Scenario.named("PreDC-v0", particles=50, nodes=40, side_m=50, crossing_m=20, periods=5)
EPISODES = 200  # two blocks
TOKENS = (  # what stands where a field or a part of one should
    *(b"", b"nan", b"-inf", b"1e308", b"-1e308", b"1e-320", b"-0", b"0x10", b"1_0", b"1,5", b"\xef\xbc\x91", b"None"),
    *(
        b"9" * 400,
        b'"',
        b"'",
        b"[",
        b"{",
        b"[" * 5000,
        b"\0",
        b"\xff\xfe",
        b"\xef\xbb\xbf",
        b"\r",
        b"\n\n",
        b"\x1b[31m",
    ),
    *(b"null", b"true", b"[]", b"{}", b"-1", b"1e9", b"../../x", b"%s", b"2026-01-01T00:00:00Z", b"\xf0\x9f\x98\x80"),
)


def damage(content: bytes, rng: np.random.Generator) -> bytes:
    """One to three changes: bits, bytes, fields, lines, lengths, order."""
    for _ in range(rng.integers(1, 4)):
        content = DAMAGES[rng.integers(len(DAMAGES))](content, rng)
    return content


def _flip(content: bytes, rng: np.random.Generator) -> bytes:
    changed = bytearray(content)
    for place in rng.integers(len(content), size=rng.integers(1, 9)) if content else ():
        changed[place] ^= 1 << int(rng.integers(8))
    return bytes(changed)


def _replace(content: bytes, rng: np.random.Generator) -> bytes:
    start, length = int(rng.integers(len(content) + 1)), int(rng.integers(1, 20))
    return content[:start] + TOKENS[rng.integers(len(TOKENS))] + content[start + length :]


def _field(content: bytes, rng: np.random.Generator) -> bytes:
    fields = content.split(b",")
    fields[rng.integers(len(fields))] = TOKENS[rng.integers(len(TOKENS))]
    return b",".join(fields)


def _lines(content: bytes, rng: np.random.Generator) -> bytes:
    lines = content.split(b"\n")
    return b"\n".join(lines[k] for k in rng.integers(len(lines), size=len(lines)))


def _cut(content: bytes, rng: np.random.Generator) -> bytes:
    return content[: int(rng.integers(len(content) + 1))]


def _repeat(content: bytes, rng: np.random.Generator) -> bytes:
    return content * int(rng.integers(2, 4))


DAMAGES = (_flip, _replace, _replace, _field, _field, _lines, _cut, _repeat)


def _finite(*values: Any) -> None:
    """Whoever reads a file without a word reads numbers.

    Raises:
        ArithmeticError: they are not.
    """
    if not all(np.isfinite(value).all() for value in values):
        raise ArithmeticError("read, and not finite")


class Kinds:
    """A sound file of each kind, and who reads it.

    Args:
        folder: for them.
    """

    def __init__(self, folder: Path) -> None:
        self._walks = write_dataset(folder / "walks", tracks=2, seconds=15)
        tracks = read_dataset(self._walks)
        self._receivers = read_receivers(self._walks)
        calibration = calibrate(tracks)
        self._room = 12.0, 12.0
        self._calibration, self._map = folder / "calibration.json", folder / "map.npz"
        calibration.save(self._calibration)
        save_map(residual_map(tracks, calibration), self._map)
        self._csv = folder / "walk.csv"
        self._csv.write_text("t,x,y\n" + "".join(f"{k},{10 + k},{20 + k / 2}\n" for k in range(20)), encoding="utf-8")
        self._policy = folder / "policy"
        shutil.copytree(PRETRAINED / "PreDC-v0", self._policy)
        self._run = folder / "run"
        open_folder(self._run, {"steps": 3, "lam": [1.0, 4.0]}, resume=False)
        write_checkpoint(self._run / "checkpoint.safetensors", {"a": np.arange(9.0)}, {"quantity": {"nodes": 40}})
        progress = progress_file(self._run)
        progress.parent.mkdir()
        progress.write_text("time/total_timesteps,a\n" + "".join(f"{k},{k / 3}\n" for k in range(20)), encoding="utf-8")
        self._kept = folder / "kept"
        self._rows = evaluate(["nearest0"], SMALL, episodes=EPISODES).rows
        _stop_in_midst(self._kept)

    def readers(self) -> dict[str, tuple[Path, Callable[[Path], Any]]]:
        """By kind: the sound file, and what reads it again after it was damaged."""
        track = next(self._walks.glob("*.mbd"))
        return {
            "recorded track, CSV": (self._csv, lambda path: _finite(read_csv_track(str(path), None, SMALL))),
            "Bluetooth recording, *.mbd": (track, self._read_recording),
            "receivers, tetam.dev": (self._walks / "tetam.dev", self._read_receivers),
            "calibration.json": (self._calibration, self._read_calibration),
            "residual map, *.npz": (self._map, self._read_map),
            "policy.json": (self._policy / "policy.json", _read_policy),
            "policy.safetensors": (self._policy / "policy.safetensors", _read_policy),
            "kept blocks of an evaluation": (self._kept / BLOCKS_FILE, self._continue_evaluation),
            "checkpoint.safetensors": (self._run / "checkpoint.safetensors", _read_checkpoint),
            "config.json of a training": (self._run / "config.json", _resume),
            "progress.csv of a training": (progress_file(self._run), lambda path: read_progress(path.parents[1])),
        }

    def _read_recording(self, path: Path) -> None:
        track = read_track(path, self._receivers)
        _finite(track.time_s, track.position_m, track.level_db)

    def _read_receivers(self, path: Path) -> None:
        _finite(read_receivers(path.parent).positions_m)

    def _read_calibration(self, path: Path) -> None:
        Calibration.load(path)
        Scenario.named("Ble-v0", calibration=str(path))

    def _read_map(self, path: Path) -> None:
        _finite(load_map(path, len(self._receivers.names), self._room))

    def _continue_evaluation(self, path: Path) -> None:
        """Whatever is in the file, the rows are those of a run that was never stopped."""
        with contextlib.redirect_stderr(io.StringIO()):
            rows = evaluate(["nearest0"], SMALL, episodes=EPISODES, keep=path.parent).rows
        if rows != self._rows:
            raise ArithmeticError("other rows than those of a run that was never stopped")


def progress_file(run: Path) -> Path:
    """Of a training's first part."""
    return run / "progress-0" / "progress.csv"


def _stop_in_midst(folder: Path) -> None:
    def stop(done: int, total: int, what: str) -> None:
        if done == total - 1:
            raise KeyboardInterrupt

    with contextlib.suppress(KeyboardInterrupt):
        evaluate(["nearest0"], SMALL, episodes=EPISODES, keep=folder, progress=stop)


def _read_policy(path: Path) -> None:
    make_policy(str(path.with_name("policy.json")), SMALL)


def _read_checkpoint(path: Path) -> None:
    _finite(*read_checkpoint(path, {"quantity": {"nodes": 40}})[0].values())


def _resume(path: Path) -> None:
    open_folder(path.parent, {"steps": 3, "lam": [1.0, 4.0]}, resume=True)


def try_files(folder: Path, each: int, seed: int, progress: Progress) -> Iterator[tuple[str, int, int, list[str]]]:
    """Damage files of each kind.

    Args:
        each: files of a kind.

    Yields: kind, how many were read, how many were refused in one line, and what else happened.
    """
    kinds = Kinds(folder).readers()
    for number, (kind, (path, read)) in enumerate(kinds.items()):
        whole, taken, refused, failed = path.read_bytes(), 0, 0, []
        for k in range(each):
            path.write_bytes(damage(whole, np.random.default_rng([seed, number, k])))
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    read(path)
                taken += 1
            except (ValueError, OSError) as problem:
                refused += 1
                if len(str(problem).splitlines()) != 1:
                    failed.append(f"file {k}: {problem}")
            except Exception as problem:
                failed.append(f"file {k}: {problem!r:.200}")
            progress(number * each + k + 1, each * len(kinds), kind)
        path.write_bytes(whole)
        yield kind, taken, refused, failed
