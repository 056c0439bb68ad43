"""Finished blocks beside a result, so that a run that was stopped continues from them."""

from __future__ import annotations

import hashlib
import io
import json
import pickle
import sys
from collections.abc import Iterator, Sequence
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wsn_env.evaluation.files import check_replaceable, naming, replacing
from wsn_env.evaluation.policies import Policy
from wsn_env.evaluation.rollout import Block
from wsn_env.evaluation.versions import sources_digest, versions
from wsn_env.models.own_files import file_digest, note_modules, noted_files, sources_of, watch
from wsn_env.models.recordings.receivers import DEVICES, PARAMETERS
from wsn_env.scenario import Scenario

BLOCKS_FILE = "evaluation.blocks.jsonl"


class KeptBlocks:
    """Finished blocks in a file of JSON lines, each of which says by what it was made.

    A line is `[checksum, [run, files, policy, lam, number, measured]]`: the checksum is of the rest; `run` is a digest
    of settings, policies, versions and sources; `files` are digests of what the user's own code has read. A block is
    taken again where all of it is as it was. Lines that are damaged or that other commands, files or versions made are
    removed, which is said on stderr.
    """

    def __init__(
        self, folder: str | Path | None, scenario: Scenario, settings: dict[str, Any], policies: Sequence[Policy]
    ) -> None:
        self._blocks: dict[tuple, list[dict[str, Any]]] = {}
        self._path = None if folder is None else Path(folder) / BLOCKS_FILE
        if self._path is None:
            return
        of_classes = {type(each).__module__ for each in (*policies, *scenario.kinds)}
        self._modules = sorted(name for name in of_classes if name.partition(".")[0] not in ("builtins", "wsn_env"))
        for name in self._modules:
            watch(name)
        note_modules()
        self._run = _digest(settings, policies, self._modules)
        self._path.parent.mkdir(parents=True, exist_ok=True)
        check_replaceable(self._path)
        self._take_again(self._path)

    def _take_again(self, path: Path) -> None:
        whole, _, _cut_short = path.read_bytes().rpartition(b"\n") if path.exists() else (b"", b"", b"")
        digests: dict[str, str | None] = {}
        kept, damaged, others = [], 0, 0
        for line in filter(None, whole.split(b"\n")):
            content = _content(line)
            if content is None:
                damaged += 1
                continue
            run, files, name, lam, number, measured = content
            digests |= {file: file_digest(file) for file in files.keys() - digests.keys()}
            if run != self._run or any(digests[file] != digest for file, digest in files.items()):
                others += 1
                continue
            self._blocks[name, lam, number] = measured
            kept.append(line + b"\n")
        for count, why in ((damaged, "damaged"), (others, "of another command, other files or another version")):
            if count:
                lines = "line is" if count == 1 else "lines are"
                print(f"wsn_env: {path}: {count} {lines} {why}: played again where needed", file=sys.stderr)
        with replacing(path) as temporary:
            temporary.write_bytes(b"".join(kept))

    def has(self, block: Block) -> bool:
        return len(self._blocks.get(block[:3], ())) == len(block.seeds)

    def get(self, name: str, lam: float | None, number: int) -> list[dict[str, Any]]:
        return self._blocks[name, lam, number]

    def put(self, block: Block, measured: list[dict[str, Any]]) -> None:
        self._blocks[block[:3]] = measured
        if self._path is not None:
            note_modules()
            body = json.dumps([self._run, noted_files(self._modules), *block[:3], measured])
            with naming(self._path), open(self._path, "a", encoding="ascii") as file:
                file.write(f'["{_checksum(body.encode())}", {body}]\n')


def remove_kept_blocks(folder: str | Path) -> None:
    """Remove the kept blocks of a finished run."""
    (Path(folder) / BLOCKS_FILE).unlink(missing_ok=True)


def _checksum(body: bytes) -> str:
    return hashlib.sha256(body).hexdigest()


def _content(line: bytes) -> list[Any] | None:
    """What a line of `put` says; None: it is damaged."""
    body = line[69:-1]  # behind '["', 64 digits and '", '
    return json.loads(body) if line == b'["%b", %b]' % (_checksum(body).encode(), body) else None


def _digest(settings: dict[str, Any], policies: Sequence[Policy], modules: Sequence[str]) -> str:
    """Of all that decides the rows but for what own code reads: settings and policies with the files that they name,
    versions, and the sources of this package and of the packages that own classes are from."""
    with np.printoptions(threshold=sys.maxsize, floatmode="unique"):
        described = [_describe(policy) for policy in policies]
    named = sorted(set(_strings([settings["scenario"], [_values(policy) for policy in policies]])))
    files = [*named, *_beside(settings["scenario"])]
    contents = [file_digest(file) for file in files]
    sources = [(file, file_digest(file)) for name in modules for file in sources_of(name)]
    inputs = [settings, versions(), sources_digest(), described, files, contents, modules, sources]
    return _checksum(json.dumps(inputs, sort_keys=True, default=_plain).encode())


def _describe(policy: Policy) -> list[str]:
    """A policy's class and parameters: a dataclass's fields, else its repr, if it has one, and its state."""
    kind = type(policy)
    if is_dataclass(policy):
        values = [f"{item.name}={getattr(policy, item.name)!r}" for item in fields(policy)]
        return [kind.__qualname__, repr(policy), *values]
    return [kind.__qualname__, "" if kind.__repr__ is object.__repr__ else repr(policy), _state(policy)]


class _StatePickler(pickle.Pickler):
    """Takes dataclasses by their fields alone: what they keep of what they have computed does not count."""

    def reducer_override(self, obj: Any) -> Any:
        if not is_dataclass(obj) or isinstance(obj, type):
            return NotImplemented
        values = [getattr(obj, item.name) for item in fields(obj)]
        return list, ([type(obj).__module__, type(obj).__qualname__, *values],)


def _state(policy: Policy) -> str:
    stream = io.BytesIO()
    try:
        _StatePickler(stream).dump(policy)
        return _checksum(stream.getvalue())
    except Exception:  # what an object of one's own raises can be anything
        return f"{policy!r} {_values(policy)!r}"


def _values(policy: Policy) -> dict[str, Any]:
    return getattr(policy, "__dict__", {})


def _strings(value: Any) -> Iterator[str]:
    """All texts and paths in nested plain values that name regular files."""
    if isinstance(value, (str, Path)):
        if 0 < len(str(value)) < 4096 and "\0" not in str(value) and file_digest(value) is not None:
            yield str(value)
    elif isinstance(value, dict):
        yield from _strings(list(value.values()))
    elif isinstance(value, (list, tuple, set, frozenset)):
        for each in value:
            yield from _strings(each)


def _beside(scenario: dict[str, Any]) -> list[str]:
    """What says where the receivers of a recording stand, if it has one."""
    recording = scenario["motion"].get("recording")
    return [str(Path(recording).with_name(name)) for name in (DEVICES, PARAMETERS)] if recording else []


def _plain(value: Any) -> Any:
    """For JSON: arrays and NumPy's numbers as Python's; else how a value shows itself."""
    return value.tolist() if hasattr(value, "tolist") else repr(value)
