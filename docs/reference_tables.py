"""The tables of reference.md, from what the package itself says: observations, and every quantity of every kind.

python docs/reference_tables.py --out FOLDER
"""

from __future__ import annotations

import argparse
import inspect
from collections.abc import Iterator, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from wsn_env import Scenario
from wsn_env.envs.feature import Feature
from wsn_env.envs.features import BELIEF_FEATURES, CANDIDATE_FEATURES, MOTION_FEATURES
from wsn_env.envs.others import ENTRY_FEATURES as ACTION_OTHERS
from wsn_env.envs.others import OTHER_FEATURES
from wsn_env.envs.prospects import ENERGY_FEATURES as ACTION_ENERGY
from wsn_env.envs.prospects import ENTRY_FEATURES
from wsn_env.envs.scarcity import ENERGY_FEATURES
from wsn_env.models.field import Field
from wsn_env.models.kinds import Registry
from wsn_env.models.library import ASSOCIATIONS, DETECTIONS, FAULTS, MEASUREMENTS, MOTIONS, RADIOS
from wsn_env.reports.markdown import escape_markdown, markdown_table
from wsn_env.scenario.tracking import Tracking

OBSERVED: dict[str, dict[str, Feature]] = {
    "belief": BELIEF_FEATURES | MOTION_FEATURES,
    "candidate": CANDIDATE_FEATURES,
    "action": ENTRY_FEATURES,
    "belief_energy": ENERGY_FEATURES,
    "action_energy": ACTION_ENERGY,
    "belief_others": OTHER_FEATURES,
    "action_others": ACTION_OTHERS,
}
SECTIONS = {"scenario": Scenario, "field": Field, "tracking": Tracking}
ROLES: dict[str, Registry] = {
    "measurement": MEASUREMENTS,
    "detection": DETECTIONS,
    "motion": MOTIONS,
    "radio": RADIOS,
    "association": ASSOCIATIONS,
    "fault": FAULTS,
}
PARTS = "field", "motion", "detection", "measurement", "radio", "association", "tracking"  # with tables of their own


def observed(features: Mapping[str, Feature]) -> str:
    """A column of an observation in each line."""
    lines = [
        (str(place), f"`{name}`", f"{feature.low:g} to {feature.high:g}", feature.unit, feature.meaning)
        for place, (name, feature) in enumerate(features.items())
    ]
    return markdown_table(("", "name", "range", "unit", "meaning"), lines, left=(1, 2, 3, 4))


def quantities(section: Any) -> Iterator[tuple[str, str, str]]:
    """Name, default and meaning of each."""
    for item in fields(section):
        if item.name not in PARTS:
            yield f"`{item.name}`", f"`{item.default!r}`", escape_markdown(item.metadata.get("meaning", ""))


def kinds(registry: Registry) -> str:
    """A line for each kind, with those of its quantities under it."""
    lines = []
    for name, kind in registry.kinds.items():
        about = " ".join((inspect.getdoc(kind) or "").partition("\n\n")[0].split())
        lines.append((f"**`{name}`**", "", escape_markdown(about)))
        lines += quantities(kind)
    return markdown_table(("kind, quantity", "default", "meaning"), lines, left=(0, 1, 2))


def main() -> None:
    """Write NAME.md of every table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    out = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    for name, text in tables().items():
        (out / f"{name}.md").write_text(text, encoding="utf-8")


def tables() -> dict[str, str]:
    """All of them by name."""
    return (
        {name: observed(features) for name, features in OBSERVED.items()}
        | {
            name: markdown_table(("quantity", "default", "meaning"), quantities(section), left=(0, 1, 2))
            for name, section in SECTIONS.items()
        }
        | {name: kinds(registry) for name, registry in ROLES.items()}
    )


if __name__ == "__main__":
    main()
