"""Policies by name, from every installed package's entry points in the group `wsn_env.policies`.

A package of one's own adds `my_rule = "my_package.rules:MyRule"` there: a callable that takes the Scenario and returns
an object with `act(view) -> Cluster`.
"""

from __future__ import annotations

import json
from importlib.metadata import entry_points
from pathlib import Path
from typing import Protocol

from wsn_env.quantity import parse_overrides, suggest
from wsn_env.scenario import Scenario
from wsn_env.types import Cluster
from wsn_env.view import View

GROUP = "wsn_env.policies"


class Policy(Protocol):
    """Chooses clusters, batch-first; it must not keep anything between calls (the view holds what has to be known)."""

    def act(self, view: View) -> Cluster:
        """The clusters of the next period."""


def policy_names() -> list[str]:
    """Every policy that can be made by name."""
    return sorted({point.name for point in entry_points(group=GROUP)})


def make_policy(name: str, scenario: Scenario, **parameters) -> Policy:
    """A policy by name, or a learned one from the policy.json that train.py saved.

    Args:
        name: an entry point's name, with parameters after a colon if any ("pre_dc:theta=0.8,phi0_m=3"), or a path to a
            policy.json (or its folder).
        scenario: what it will act in.
        parameters: of the policy, for example `make_policy("pre_dc", scenario, theta=0.8)`.

    Raises:
        ValueError: for an unknown name or parameter.
    """
    plain, colon, text = name.partition(":")
    for point in entry_points(group=GROUP):
        if point.name == plain:
            given = parse_overrides(text.split(",")) if colon else {}
            try:
                return point.load()(scenario=scenario, **parameters | given)
            except TypeError as problem:
                if not given:
                    raise
                raise ValueError(f"policy {name!r}: {problem}") from None
    path = Path(name)
    path = path / "policy.json" if path.is_dir() else path
    if path.suffix == ".json":
        return load_learned(path, scenario)
    raise ValueError(f"policy {name!r} is unknown: {suggest(name, policy_names())} (or the path of a policy.json)")


def load_learned(path: Path, scenario: Scenario) -> Policy:
    """A saved policy: its policy.json names the entry point of the kind that can read it."""
    try:
        kind = json.loads(path.read_text())["kind"]
    except FileNotFoundError:
        raise ValueError(f"policy {str(path)!r} does not exist") from None
    except (ValueError, KeyError, TypeError, UnicodeDecodeError) as problem:
        raise ValueError(f"{path} is not a saved policy: {problem!r}") from None
    if kind not in policy_names():
        raise ValueError(f"{path} is not a saved policy: its kind is {kind!r}, known are {', '.join(policy_names())}")
    try:
        return make_policy(kind, scenario, path=str(path))
    except TypeError:
        raise ValueError(f"{path} is not a saved policy: its kind {kind!r} is not learned") from None
