"""Kinds by name, with their settings: what `Scenario.override` makes of words."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any

from wsn_env.models.fault.base import Fault
from wsn_env.models.kinds import Kind, Registry
from wsn_env.models.library import FAULTS
from wsn_env.models.own import kind_and_settings
from wsn_env.models.quantity import ScenarioError, UnknownQuantity, suggest

JOINED = re.compile(r"\+(?![0-9])")  # not 1e+3


def kind_named(registry: Registry, role: str, text: str, changes: dict[str, Any]) -> Any:
    """The kind that a text names ("rssi,noise_db=2", "mine.py:MyBearing").

    Args:
        changes: further settings by name; those that the kind has are taken out.

    Raises:
        ScenarioError: there is no such kind, or it has no such setting.
    """
    kind, settings = kind_and_settings(registry, role, text)
    return _make(kind, _take(kind, changes) | settings)


def faults_named(faults: Any, changes: dict[str, Any]) -> Any:
    """Faults by texts ("stuck,share=0.3+late"), as they are, as `as_dict` tells them, or a list of these; anything else
    as it is.

    Args:
        changes: further settings by name, of all faults that have them; those are taken out.
    """
    given = [] if faults is None else [faults] if isinstance(faults, (str, Fault)) else faults
    if not isinstance(given, (list, tuple)):
        return faults  # no faults at all, as the scenario will say
    made: list[Any] = []
    taken: set[str] = set()
    for each in given:
        for text in JOINED.split(each) if isinstance(each, str) else ():
            kind, settings = kind_and_settings(FAULTS, "faults", text.strip())
            further = _take(kind, dict(changes))
            made.append(_make(kind, further | settings))
            taken |= further.keys()
        if isinstance(each, Fault):
            further = _take(type(each), dict(changes))
            made.append(replace(each, **further))
            taken |= further.keys()
        elif isinstance(each, Mapping):
            made.append(section_told("faults", Fault, FAULTS, each))
        elif not isinstance(each, str):
            made.append(each)
    for name in taken:
        del changes[name]
    return tuple(made)


def section_told(role: str, part: type, registry: Registry | None, told: Mapping[str, Any]) -> Any:
    """A section as `Scenario.as_dict` tells it: its kind, and its quantities by name.

    Args:
        part: what it must be.
        registry: of its kinds; None: there is only one.

    Raises:
        ScenarioError: there is no such kind, or it has no such quantity.
    """
    quantities = {name: _as_tuples(value) for name, value in told.items() if name != "kind"}
    name = told.get("kind")
    if registry is not None and isinstance(name, str) and ".py:" in name:
        return _make(kind_and_settings(registry, role, name)[0], quantities)
    kinds = {kind.__name__: kind for kind in ([part] if registry is None else registry.kinds.values())}
    if registry is None and name is None:
        name = part.__name__
    if name not in kinds:
        hint = suggest(name, kinds) if isinstance(name, str) else f"known are {', '.join(sorted(kinds))}"
        raise ScenarioError(f"Scenario.{role}: kind {name!r} is unknown: {hint}, or FILE.py:CLASS of your own")
    return _make(kinds[name], quantities)


def _as_tuples(value: Any) -> Any:
    """JSON's lists as the tuples that they were."""
    return tuple(map(_as_tuples, value)) if isinstance(value, (list, tuple)) else value


def _take(kind: type[Kind], changes: dict[str, Any]) -> dict[str, Any]:
    own = {item.name for item in fields(kind)}
    return {name: changes.pop(name) for name in own & changes.keys()}


def _make(kind: type[Any], given: dict[str, Any]) -> Any:
    own = {item.name for item in fields(kind)}
    try:
        return kind(**given)
    except TypeError:
        strange = next((name for name in given if name not in own), None)
        if strange is None:  # the kind's own mistake
            raise
        raise UnknownQuantity(kind.__name__, strange, own) from None
