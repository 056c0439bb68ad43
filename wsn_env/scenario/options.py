"""A scenario from the options of a command line."""

from __future__ import annotations

from pathlib import Path

from wsn_env.models.quantity import parse_overrides
from wsn_env.scenario.scenario import Scenario


def make_scenario(name: str, pairs: list[str], tracks: list[Path], **further: object) -> Scenario:
    """A scenario from the options --scenario, --set and --tracks; `further` quantities win."""
    recorded = {"motion": "recorded", "tracks": tuple(map(str, tracks))} if tracks else {}
    return Scenario.named(name, **parse_overrides(pairs) | recorded | further)
