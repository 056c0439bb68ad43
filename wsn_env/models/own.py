"""Classes from a user's own file: "FILE.py:CLASS", in Python and on the command line.

The folder of such a file is a package under a name of its own, so that two folders never mix: `import helper` in a file
there means the helper.py beside it if there is one, and means it for nobody else.
"""

from __future__ import annotations

import builtins
import os
import re
import sys
import traceback
from collections.abc import Sequence
from hashlib import sha256
from importlib.machinery import (
    EXTENSION_SUFFIXES,
    SOURCE_SUFFIXES,
    ExtensionFileLoader,
    FileFinder,
    ModuleSpec,
    SourceFileLoader,
)
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

from numba.core.errors import NumbaError

from wsn_env.compiled.store import store_folder
from wsn_env.models.kinds import Kind, Registry, chosen_codes
from wsn_env.models.own_files import OF_FILES, file_digest, note_file, watch
from wsn_env.models.quantity import ScenarioError, parse_overrides, suggest

_digests: dict[str, str] = {}  # by path: of the source as it was read


def class_in(path: Path, name: str) -> Any:
    """A class of a Python file, which is read again when it or a file beside it that it imports has changed.

    Raises:
        ValueError: there is no such file or class, or the file cannot be run: names its line.
    """
    what = f"{f'{path}:{name}'!r}"
    if not path.is_file():
        raise ValueError(f"{what}: there is no file {path}")
    try:
        module = _load(path.resolve())
    except (Exception, SystemExit) as problem:
        raise ValueError(f"{what}: {own_error(problem)}") from problem
    if not hasattr(module, name):
        known = [each for each, value in vars(module).items() if getattr(value, "__module__", None) == module.__name__]
        raise ValueError(f"{what}: the file has no such class: {suggest(name, known)}")
    return getattr(module, name)


def _load(file: Path) -> ModuleType:
    package = OF_FILES + sha256(str(file.parent).encode()).hexdigest()[:8]
    name = f"{package}.{file.stem if file.stem.isidentifier() else sha256(file.name.encode()).hexdigest()[:8]}"
    if any(file_digest(path) != digest for path, digest in files_behind(name).items()):
        _forget(package)
    if name not in sys.modules:
        if package not in sys.modules:
            spec = ModuleSpec(package, None, is_package=True)
            spec.submodule_search_locations = [str(file.parent)]
            sys.modules[package] = module_from_spec(spec)
            watch(package)
        found = spec_from_file_location(name, file, loader=_Loader(name, str(file)))
        assert found is not None and found.loader is not None  # a loader is given
        sys.modules[name] = module_from_spec(found)
        try:
            found.loader.exec_module(sys.modules[name])
        except BaseException:
            _forget(package)
            raise
    return sys.modules[name]


def own_modules(package: str = OF_FILES) -> list[ModuleType]:
    """The modules that come from files given by path, and from those beside them."""
    return [module for name, module in list(sys.modules.items()) if name.startswith(package)]


def files_behind(module: str) -> dict[str, str]:
    """Digests by path of all source files that were read for a module of such a file; of another module: none."""
    package = module.partition(".")[0]
    own = own_modules(package) if package.startswith(OF_FILES) else []
    paths = [str(getattr(each, "__file__", None)) for each in own]
    return {path: _digests[path] for path in paths if path in _digests}


def _forget(package: str) -> None:
    for module in own_modules(package):
        del sys.modules[module.__name__]


class _Loader(SourceFileLoader):
    """Reads the source itself: Python's kept bytecode may be of another version of the same size and second."""

    def path_stats(self, path: Any) -> Any:
        """None: bytecode is neither read nor written."""
        raise OSError

    def get_data(self, path: Any) -> bytes:
        """The source."""
        data = super().get_data(path)
        _digests[str(path)] = sha256(data).hexdigest()
        note_file(self.name, path)
        return data

    def exec_module(self, module: ModuleType) -> None:
        """Run it; what it imports is looked for beside it first."""
        vars(module)["__builtins__"] = vars(builtins) | {"__import__": _import_beside}
        super().exec_module(module)


def _import_beside(
    name: str, globals: Any = None, locals: Any = None, fromlist: Sequence[str] | None = (), level: int = 0
) -> ModuleType:
    package, first = (globals or {}).get("__name__", "").partition(".")[0], name.partition(".")[0]
    if level == 0 and first != "wsn_env" and _is_beside(package, first):
        module = __import__(f"{package}.{name}", globals, locals, fromlist or ())
        return module if fromlist else sys.modules[f"{package}.{first}"]
    return __import__(name, globals, locals, fromlist or (), level)


def _is_beside(package: str, name: str) -> bool:
    whole = f"{package}.{name}"
    if whole in sys.modules or package not in sys.modules:
        return whole in sys.modules
    spec = _Finder.find_spec(whole, sys.modules[package].__path__)
    return spec is not None and spec.loader is not None  # a folder without __init__.py may be anything


class _Finder:
    """Finds the files beside a file given by path."""

    @staticmethod
    def find_spec(name: str, path: Sequence[str] | None = None, target: Any = None) -> ModuleSpec | None:
        """For modules of these packages alone."""
        if path is None or not name.startswith(OF_FILES):
            return None
        kinds: Any = (ExtensionFileLoader, EXTENSION_SUFFIXES), (_Loader, SOURCE_SUFFIXES)
        return FileFinder(list(path)[0], *kinds).find_spec(name)


finder: Any = _Finder
sys.meta_path.insert(0, finder)


def own_error(problem: BaseException) -> str:
    """An error of own code in one line: "mine.py:12: KeyError: 'x'"."""
    told = problem.msg if isinstance(problem, SyntaxError) else str(problem)
    if isinstance(problem, NumbaError):  # a page, with the cause in its midst
        told = ([*CAUSE.findall(told)] or [told])[-1]
    lines = [line.strip() for line in told.splitlines() if line.strip()] or [""]
    return f"{own_place(problem)}{type(problem).__name__}: {lines[0]}".removesuffix(": ")


CAUSE = re.compile(r"^ *((?!TypingError: Failed)\w+Error: .*|No implementation of function .*)$", re.MULTILINE)
LINE = re.compile(r" at (.*\.py) \((\d+)\)")


def own_place(problem: BaseException) -> str:
    """Where an error arose, if that is in a file of the user's own: "mine.py:12: "; else nothing."""
    frames = [(frame.filename, frame.lineno) for frame in traceback.extract_tb(problem.__traceback__)]
    if isinstance(problem, SyntaxError):
        frames.append((problem.filename or "", problem.lineno))
    if any("numba" in Path(file).parts for file, _ in frames):  # compiling: no frame is of what is compiled
        frames += [(code.co_filename, code.co_firstlineno) for code in chosen_codes()]
        frames += [(file, int(line)) for file, line in LINE.findall(str(problem))]
    own = [f"{file}:{line}: " for file, line in frames if _is_own(file)]
    return own[-1] if own else next((note for note in getattr(problem, "__notes__", ()) if note.endswith(": ")), "")


def _is_own(file: str) -> bool:
    path, root = Path(file), Path(__file__).parents[2]
    ours = [
        root / "wsn_env",
        root / "agents",
        root / "train.py",
        store_folder(),
        Path(sys.prefix),
        Path(sys.base_prefix),
    ]
    installed = {"site-packages", "dist-packages"} & set(path.parts)
    return os.path.isfile(path) and not installed and not any(path.is_relative_to(other) for other in ours)


def kind_text(kind: type) -> str:
    """What tells a class: its name; of one from a user's file "FILE.py:CLASS"."""
    file = getattr(sys.modules.get(kind.__module__), "__file__", None)
    return f"{file}:{kind.__name__}" if file and kind.__module__.startswith(OF_FILES) else kind.__name__


def kind_and_settings(registry: Registry, role: str, text: str) -> tuple[type[Kind], dict[str, Any]]:
    """The kind that a text names, and its settings: "rssi", "rssi,noise_db=2", "mine.py:MyBearing,sd_deg=3"."""
    name, comma, rest = text.partition(",")
    settings = parse_overrides(each.strip() for each in rest.split(",")) if comma else {}
    file, own, class_name = name.partition(".py:")
    if own:
        kind = class_in(Path(f"{file}.py"), class_name)
        if not (isinstance(kind, type) and issubclass(kind, registry.role)):
            raise ScenarioError(f"Scenario.{role} = {text!r}: {class_name} must be a {registry.role.__name__}")
        return kind, settings
    if name not in registry.kinds:
        raise ScenarioError(f"Scenario.{role} = {name!r}: {suggest(name, registry.kinds)}")
    return registry.kinds[name], settings
