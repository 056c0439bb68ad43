"""Finished blocks beside a result, so that a run that was stopped continues from them."""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from wsn_env.evaluation.files import replacing
from wsn_env.evaluation.policies import Policy
from wsn_env.evaluation.rollout import Block
from wsn_env.evaluation.versions import sources_digest, versions

BLOCKS_FILE = "evaluation.blocks.jsonl"


class KeptBlocks:
    """Finished blocks in a JSON-lines file; one of other settings or policies is not read but begun anew.

    A policy is known by its repr, which for a dataclass shows its parameters, and by the file of its class.
    """

    def __init__(self, folder: str | Path | None, settings: dict[str, Any], policies: Sequence[Policy]) -> None:
        self._blocks: dict[tuple, list[dict[str, Any]]] = {}
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

    def get(self, name: str, lam: float | None, number: int) -> list[dict[str, Any]]:
        return self._blocks[name, lam, number]

    def put(self, block: Block, measured: list[dict[str, Any]]) -> None:
        self._blocks[block[:3]] = measured
        if self._path is not None:
            with open(self._path, "a") as file:
                file.write(json.dumps([*block[:3], measured]) + "\n")


def remove_kept_blocks(folder: str | Path) -> None:
    """Remove the kept blocks of a finished run."""
    (Path(folder) / BLOCKS_FILE).unlink(missing_ok=True)


def _digest(settings: dict[str, Any], policies: Sequence[Policy]) -> str:
    """Of all that decides the rows: settings, policies, recorded tracks, versions and the package's own kernels."""
    sources = [getattr(sys.modules.get(type(policy).__module__), "__file__", None) for policy in policies]
    files = [*settings["scenario"]["motion"].get("tracks", ()), *filter(None, sources)]
    contents = [hashlib.sha256(Path(file).read_bytes()).hexdigest() for file in files]
    inputs = [settings, versions(), sources_digest(), list(map(repr, policies)), contents]
    return hashlib.sha256(json.dumps(inputs, sort_keys=True).encode()).hexdigest()
