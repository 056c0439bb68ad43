"""Classes from a user's own file: "FILE.py:CLASS", in Python and on the command line."""

from __future__ import annotations

import sys
from hashlib import sha256
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

from wsn_env.models.kinds import Kind, Registry
from wsn_env.models.own_files import OF_FILES, watch
from wsn_env.models.quantity import ScenarioError, parse_overrides, suggest


def class_in(path: Path, name: str) -> Any:
    """A class of a Python file, which is read once, and again when it has changed.

    Raises:
        ValueError: there is no such file or class.
    """
    if not path.is_file():
        raise ValueError(f"{f'{path}:{name}'!r}: there is no file {path}")
    file = str(path.resolve())
    module_name = f"{OF_FILES}{path.stem}_{sha256(file.encode() + path.read_bytes()).hexdigest()[:8]}"
    module = sys.modules.get(module_name)
    if module is None:
        spec = spec_from_file_location(module_name, file)
        if spec is None or spec.loader is None:
            raise ValueError(f"{f'{path}:{name}'!r}: {path} is no Python file")
        module = sys.modules[module_name] = module_from_spec(spec)
        watch(module_name)
        try:
            spec.loader.exec_module(module)
        except BaseException:
            del sys.modules[module_name]
            raise
    if not hasattr(module, name):
        known = [each for each, value in vars(module).items() if getattr(value, "__module__", None) == module_name]
        raise ValueError(f"{f'{path}:{name}'!r}: the file has no such class: {suggest(name, known)}")
    return getattr(module, name)


def kind_and_settings(registry: Registry, role: str, text: str) -> tuple[type[Kind], dict[str, Any]]:
    """The kind that a text names, and its settings: "rssi", "rssi,noise_db=2", "mine.py:MyBearing,sd_deg=3"."""
    name, comma, rest = text.partition(",")
    settings = parse_overrides(rest.split(",")) if comma else {}
    file, own, class_name = name.partition(".py:")
    if own:
        kind = class_in(Path(f"{file}.py"), class_name)
        if not (isinstance(kind, type) and issubclass(kind, registry.role)):
            raise ScenarioError(f"Scenario.{role} = {text!r}: {class_name} must be a {registry.role.__name__}")
        return kind, settings
    if name not in registry.kinds:
        raise ScenarioError(f"Scenario.{role} = {name!r}: {suggest(name, registry.kinds)}")
    return registry.kinds[name], settings
