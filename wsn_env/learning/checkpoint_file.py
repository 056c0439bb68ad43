"""Checkpoints as files: arrays and facts in one safetensors file. Nothing in it is executed."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from wsn_env.evaluation.files import replacing

HEAD = "checkpoint"  # of the file's metadata, with the facts


def write_checkpoint(path: Path, arrays: dict[str, np.ndarray], facts: dict[str, Any]) -> None:
    """Whole or not at all; the same arrays and facts give the same bytes.

    Args:
        facts: JSON values.
    """
    head = json.dumps(facts | {"sha256": _digest(arrays, facts)}, sort_keys=True)
    with replacing(path) as temporary:
        temporary.write_bytes(save(arrays, {HEAD: head}))


def read_checkpoint(path: Path, wanted: dict[str, dict[str, Any]]) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Arrays and facts of a checkpoint.

    Args:
        wanted: facts that it must share, by kind and name.

    Raises:
        ValueError: the file is damaged or none of these, or a fact differs.
    """
    arrays, facts = {}, {}
    try:
        if not path.is_file():
            raise OSError("not a file")
        with safe_open(path, framework="numpy") as file:
            facts = json.loads(file.metadata()[HEAD])
            arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118  # no dict
        if facts.pop("sha256") != _digest(arrays, facts):
            raise ValueError("its checksum is another")
    except (OSError, SafetensorError, ValueError, LookupError, TypeError, AttributeError, RecursionError) as problem:
        reason = str(problem).partition("\n")[0][:100]
        raise ValueError(f"{path} is damaged or no checkpoint: remove it to begin anew ({reason})") from None
    for kind, values in json.loads(json.dumps(wanted)).items():
        old = facts[kind] if isinstance(facts.get(kind), dict) else {}
        for name in sorted(values.keys() | old.keys()):
            if old.get(name) != values.get(name):
                was, now = (str(one.get(name))[:60] for one in (old, values))
                raise ValueError(
                    f"{path} was written with {kind} {name} = {was}, and now it is {now}: go back to that, or begin"
                    " another run with --name"
                )
    return arrays, facts


def refuse_executable(old: Path, new: Path) -> None:
    """Say what to do about a checkpoint of old, where there is none of today."""
    if old.exists() and not new.exists():
        raise ValueError(
            f"{old}: checkpoints of this kind can execute anything and are not read any more: remove it to begin anew,"
            " or begin another run with --name"
        )


def unsuitable(path: Path, problem: Exception) -> ValueError:
    """That a whole checkpoint is none of this training."""
    reason = str(problem).partition("\n")[0][:100]
    return ValueError(f"{path} does not suit this training: remove it to begin anew ({reason})")


def pack(tree: Any) -> tuple[dict[str, np.ndarray], Any]:
    """Arrays by number, and JSON values that `unpack` makes the same tree of.

    Args:
        tree: of dicts, lists, tuples, arrays and plain values.
    """
    arrays: dict[str, np.ndarray] = {}

    def plain(one: Any) -> Any:
        if isinstance(one, dict):
            return {"dict": [[plain(key), plain(value)] for key, value in one.items()]}
        if isinstance(one, (list, tuple)):
            return {"tuple" if isinstance(one, tuple) else "list": [plain(value) for value in one]}
        if isinstance(one, np.ndarray):
            arrays[str(len(arrays))] = one
            return {"array": str(len(arrays) - 1)}
        if isinstance(one, np.generic):
            return one.item()
        if one is None or isinstance(one, (bool, int, float, str)):
            return one
        raise TypeError(f"{type(one).__name__}: a checkpoint has only plain values and arrays")

    return arrays, plain(tree)


def unpack(arrays: dict[str, np.ndarray], plain: Any) -> Any:
    """What `pack` was given."""
    if not isinstance(plain, dict):
        return plain
    ((kind, value),) = plain.items()
    if kind == "array":
        return arrays[value]
    if kind == "dict":
        return {unpack(arrays, key): unpack(arrays, one) for key, one in value}
    return {"tuple": tuple, "list": list}[kind](unpack(arrays, one) for one in value)


def _digest(arrays: dict[str, np.ndarray], facts: dict[str, Any]) -> str:
    """Of all names, types, shapes and bytes."""
    found = hashlib.sha256(json.dumps(facts, sort_keys=True).encode())
    for name in sorted(arrays):
        found.update(f"{name} {arrays[name].dtype} {arrays[name].shape}".encode())
        found.update(arrays[name].tobytes())
    return found.hexdigest()
