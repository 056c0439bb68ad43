"""Policies by name, from every installed package's entry points in the group `wsn_env.policies`, and from files.

A package of one's own adds `my_rule = "my_package.rules:MyRule"` there: a callable that takes the Scenario and returns
an object with `act(view) -> Cluster`.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from importlib.metadata import EntryPoint, entry_points
from inspect import signature
from pathlib import Path
from typing import Any, Protocol

from wsn_env.models.arguments import check_parameters, checked
from wsn_env.models.own import class_in, own_error, own_place
from wsn_env.models.quantity import is_line, parse_overrides, plain, short, suggest
from wsn_env.models.state import Cluster
from wsn_env.scenario import Scenario
from wsn_env.simulation.view import View

GROUP = "wsn_env.policies"


class Policy(Protocol):
    """Chooses clusters, batch-first; it must not keep anything between calls (the view holds what has to be known)."""

    def act(self, view: View) -> Cluster:
        """The clusters of the next period."""


def policy_names() -> list[str]:
    """Every policy that can be made by name."""
    return sorted({point.name for point in entry_points(group=GROUP)})


@checked
def make_policy(name: str, scenario: Scenario | str, **parameters: Any) -> Policy:
    """A policy by name, one of your own from a file, or a learned one from the policy.json that train.py saved.

    Args:
        name: an entry point's name, one that ends in a number ("nearest3": n = 3), or "FILE.py:Class", with parameters
            after a colon if any ("pre_dc:theta=0.8,phi0_m=3", "mine.py:TwoBest:sharp_m=2"); or a path to a policy.json
            (or its folder).
        scenario: what it will act in, or a preset's name.
        parameters: of the policy, for example `make_policy("pre_dc", scenario, theta=0.8)`.

    Raises:
        ValueError: for an unknown name, class or parameter.
    """
    if not isinstance(name, str) or not name:
        raise ValueError(f"policy {short(repr(name))}: must be a name, FILE.py:CLASS, or the path of a policy.json")
    scenario = Scenario.of(scenario)
    file, own, rest = name.partition(".py:")
    plain, colon, text = (rest if own else name).partition(":")
    if own:
        try:
            maker = class_in(Path(f"{file}.py"), plain)
        except ValueError as problem:
            raise ValueError(f"policy {problem}") from problem.__cause__
        return _create_policy(name, maker, scenario, parameters | _parse_parameters(colon, text))
    point, number = _find_entry_point(plain)
    if point is not None:
        try:
            maker = point.load()
        except (ImportError, AttributeError) as problem:
            raise ValueError(f"policy {name!r}: its entry point {point.value!r} fails: {problem}") from None
        return _create_policy(name, maker, scenario, parameters | number | _parse_parameters(colon, text))
    path = Path(name)
    path = path / "policy.json" if path.is_dir() and path.name != "policy.json" else path
    if path.suffix == ".py":
        raise ValueError(f"policy {name!r}: which class of it? {name}:CLASS")
    if path.suffix == ".json" or len(path.parts) > 1:
        return load_learned(path, scenario)
    ways = "(or FILE.py:CLASS, or the path of a policy.json)"
    raise ValueError(f"policy {name!r} is unknown: {suggest(name, policy_names())} {ways}")


def named_policies(texts: str | Iterable[str] | Mapping[str, Policy], scenario: Scenario) -> dict[str, Policy]:
    """Policies by label.

    Args:
        texts: names, paths of saved policies, "FILE.py:Class", or "label=" and any of these, one or several; or a dict
            of policies by label. One that has `for_scenario` is asked for the policy.
        scenario: what they will act in.

    Raises:
        ValueError: for an unknown policy, two with one label, a label that is not one line of text, or none at all.
    """
    if isinstance(texts, Mapping):
        named = {
            label: given.for_scenario(scenario) if hasattr(given, "for_scenario") else given
            for label, given in dict[str, Any](texts).items()
        }
        for label, policy in named.items():
            if isinstance(policy, type) or not callable(getattr(policy, "act", None)):
                raise ValueError(f"policies[{label!r}] = {short(repr(policy))}: must be a policy, with act(view)")
    else:
        named, texts = {}, plain(texts)
        if not isinstance(texts, str) and not isinstance(texts, Iterable):
            raise ValueError(f"policies: {_NO_NAME.format(type(texts).__name__)}")
        for text in dict.fromkeys([texts] if isinstance(texts, str) else texts):
            if not isinstance(text, str):
                raise ValueError(f"policies: {_NO_NAME.format(type(text).__name__)}")
            label, source = _label_and_source(text)
            policy = make_policy(source, scenario)
            if label in named:
                raise ValueError(f"policies: {label!r} is there twice: labels must differ")
            named[label] = policy
    if not named:
        raise ValueError("policies: must name at least one")
    for label in named:
        if not is_line(label):
            raise ValueError(f"policies: label {label!r}: must be one line of text, without control characters")
    return named


_NO_NAME = "{} is no name: give policies of your own as {{name: policy}}"


def _label_and_source(text: str) -> tuple[str, str]:
    """("ppo", "runs/mine/policy.json") from "ppo=runs/mine/policy.json"; a name or a path alone is its own label."""
    label, equals, source = text.partition("=")
    labelled = equals and ":" not in label  # else parameters: quadrants:n=2
    if labelled and not label:
        raise ValueError(f"policies: {text!r} has no label before the =")
    return (label, source) if labelled else (text, text)


def _find_entry_point(name: str) -> tuple[EntryPoint | None, dict[str, int]]:
    """The entry point of a name, and the n of one that ends in a number: "nearest3" is `nearest` with n = 3."""
    points = {point.name: point for point in entry_points(group=GROUP)}
    if name in points:
        return points[name], {}
    stem = name.rstrip("0123456789")
    return points.get(stem), {"n": int(name[len(stem) :])} if stem in points else {}


def _parse_parameters(colon: str, text: str) -> dict:
    return parse_overrides(text.split(",")) if colon else {}


def _create_policy(name: str, maker, scenario: Scenario, parameters: dict) -> Policy:
    wrong = None
    kind = getattr(maker, "func", maker)  # of a partial
    if getattr(kind, "__module__", "").startswith("wsn_env."):  # in files of one's own annotations may be anything
        try:
            parameters = check_parameters(kind, parameters)
        except ValueError as problem:  # said where the class itself does not say more
            wrong = ValueError(f"policy {name!r}: {problem}")
    try:
        policy = maker(scenario=scenario, **parameters)
    except Exception as problem:
        if isinstance(problem, ValueError):
            raise
        if wrong:
            raise wrong from None
        if isinstance(problem, TypeError):
            said = re.sub(r"\. Did you mean '\w+'\?$", "", str(problem))  # since Python 3.13; ours knows more names
            told = f"cannot be made with a scenario and its parameters: {said}{_suggest_parameter(maker, parameters)}"
            raise ValueError(f"policy {name!r}: {own_place(problem)}{told}") from problem
        if not own_place(problem):
            raise
        raise ValueError(f"policy {name!r}: {own_error(problem)}") from problem
    if wrong:
        raise wrong
    if not callable(getattr(policy, "act", None)):
        raise ValueError(f"policy {name!r}: has no act(view)")
    return policy


def _suggest_parameter(maker: Any, parameters: dict) -> str:
    """ ": did you mean theta?", if one of the parameters is not the policy's."""
    try:
        own = [name for name in signature(maker).parameters if name != "scenario"]
    except (TypeError, ValueError):  # a class without a signature
        return ""
    strange = [name for name in parameters if name not in own]
    return f": {suggest(strange[0], own)}" if strange and own else ""


def read_saved(path: Path, *keys: str, optional: tuple[str, ...] = ()) -> list[Any]:
    """What a policy.json says under these keys; None under those optional ones that it lacks.

    Raises:
        ValueError: the file is missing, damaged or another; names it.
    """
    if not path.is_file():
        raise ValueError(f"{path} is not a saved policy: there is no such file")
    try:
        said = json.loads(path.read_text(encoding="utf-8"))
        return [*(said[key] for key in keys), *(said.get(key) for key in optional)]
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as problem:
        raise ValueError(f"{path} is not a saved policy: {problem!r}") from None


def load_learned(path: Path, scenario: Scenario) -> Policy:
    """A saved policy: its policy.json names the entry point of the kind that can read it."""
    if not path.exists():
        raise ValueError(f"policy {str(path)!r} does not exist")
    (kind,) = read_saved(path, "kind")
    if kind not in policy_names():
        raise ValueError(f"{path} is not a saved policy: its kind is {kind!r}, known are {', '.join(policy_names())}")
    try:
        return make_policy(kind, scenario, path=str(path))
    except ValueError as problem:
        if isinstance(problem.__cause__, TypeError):
            raise ValueError(f"{path} is not a saved policy: its kind {kind!r} is not learned") from None
        raise
