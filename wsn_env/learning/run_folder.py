"""The folder of a training: its settings, what a checkpoint in it must share with a training that goes on, its logs."""

from __future__ import annotations

import json
from pathlib import Path
from shutil import rmtree
from typing import Any

from wsn_env.evaluation.files import replacing
from wsn_env.evaluation.versions import sources_digest, versions
from wsn_env.models.own_files import file_digest, sources_of
from wsn_env.scenario import Scenario

CONFIG = "config.json"
FREE = ("runs", "episodes", "evaluation_seed", "checkpoint_steps", "address")  # settings that may change on the way
BEGUN = ("checkpoint.safetensors", "checkpoint.zip", "ray.safetensors", "ray", "policy.json")  # any shows a run


def open_folder(folder: Path, settings: dict[str, Any], resume: bool) -> None:
    """Make it, with config.json; an existing run is only touched to resume it, with the same settings.

    Args:
        settings: JSON values.

    Raises:
        ValueError: there is a run, or one of other settings.
    """
    path = folder / CONFIG
    if any((folder / name).exists() for name in BEGUN):
        if not resume:
            raise ValueError(f"{folder} exists: --resume continues it, --name begins another, or remove it")
        old = _read_config(path)
        for name, value in settings.items():
            if name not in FREE and old.get(name) != value:
                raise ValueError(f"{folder} was begun with {name} = {old.get(name)!r}: cannot resume it with {value!r}")
    folder.mkdir(parents=True, exist_ok=True)
    with replacing(path) as temporary:
        temporary.write_text(json.dumps(settings, indent=1), encoding="utf-8")


def _read_config(path: Path) -> dict[str, Any]:
    try:
        old = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else None
    except (ValueError, RecursionError):
        old = None
    if not isinstance(old, dict):
        state = "is damaged" if path.exists() else "is missing"
        raise ValueError(f"{path} {state}: nobody knows the run's settings; --name begins another, or remove the run")
    return old


def facts_of(settings: dict[str, Any], scenario: Scenario) -> dict[str, dict[str, Any]]:
    """What a training must share with the checkpoint that it goes on from.

    Args:
        settings: JSON values, with the files of recorded motion under "tracks".
    """
    decisive = {name: value for name, value in settings.items() if name not in (*FREE, "name")}
    kinds = {type(kind).__module__ for kind in scenario.kinds}
    own = [file for kind in kinds if not kind.startswith("wsn_env.") for file in sources_of(kind)]
    contents = {file: file_digest(file) for file in (*own, *settings["tracks"])}
    sources = versions() | {"sources of wsn_env": sources_digest()}
    quantities: dict[str, Any] = {}
    for part, value in json.loads(json.dumps(scenario.as_dict(), default=str)).items():
        inner = {f"{part}.{name}": one for name, one in value.items()} if isinstance(value, dict) else {part: value}
        quantities |= inner
    return {"setting": decisive, "quantity": quantities, "file": contents, "version": sources}


def open_progress(folder: Path, periods: int) -> Path:
    """Where to log from so many periods on; what was logged there and beyond by one that was stopped is removed."""
    for path in folder.glob("progress-*"):
        begin = path.name.removeprefix("progress-")
        if begin.isdecimal() and int(begin) >= periods:
            rmtree(path)
    return folder / f"progress-{periods}"
