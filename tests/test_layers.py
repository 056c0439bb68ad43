"""The layers: a file imports only from its own package or from lower ones, in the order that stands here once."""

import ast
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGES = (  # of wsn_env, from the bottom up
    *("compiled", "models", "scenario", "filters", "simulation", "envs", "evaluation", "learning", "agents"),
    *("bluetooth", "reports", "papers", "training", "cli"),
)
ON_TOP = ("train", "benchmarks", "studies", "examples")  # beside wsn_env, in the same order
FROM_ENVS_UP = {"gymnasium", "stable_baselines3", "torch"}
TOP_LEVEL_ENTRIES = 16

ROOT = Path(__file__).parents[1]
LAYERS = {name: height for height, name in enumerate((*PACKAGES, *ON_TOP))}
FOLDERS = ("wsn_env", "agents", "benchmarks", "studies", "examples")
FILES = [ROOT / "train.py", *(path for folder in FOLDERS for path in sorted((ROOT / folder).rglob("*.py")))]


def layer_of_file(path: Path) -> str:
    """The package of wsn_env that a file stands in, or what stands beside it; "wsn_env" for the front door."""
    first, *rest = path.relative_to(ROOT).with_suffix("").parts
    if first != "wsn_env":
        return first
    return {"__init__": "wsn_env", "__main__": "cli"}.get(rest[0], rest[0])


def layer_of_import(name: str) -> str | None:
    """The same of a module, or of a name in one; None for other projects."""
    first, *rest = name.split(".")
    if first == "wsn_env":
        return rest[0] if rest and rest[0] in PACKAGES else "wsn_env"
    return first if first in ON_TOP else None


def run_nodes(tree: ast.AST) -> Iterator[ast.AST]:
    """The nodes of a syntax tree but those for type checkers alone."""
    yield tree
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            for other in node.orelse:
                yield from run_nodes(other)
        else:
            yield from run_nodes(node)


def imports_of(path: Path) -> list[str]:
    """Every module that a file imports, wherever in it, with the names that it takes: "wsn_env.scenario.Scenario".

    What stands under `if TYPE_CHECKING:` is never run, and does not count.
    """
    names = []
    for node in run_nodes(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}, line {node.lineno}: imports are absolute"
            names += [f"{node.module}.{alias.name}" for alias in node.names]
    return names


def offending(wrong, layers=LAYERS) -> list[str]:
    """The imports that are wrong, of the files of some layers."""
    found = [(path, name) for path in FILES if layer_of_file(path) in layers for name in imports_of(path)]
    return [f"{path.relative_to(ROOT)}: {name}" for path, name in found if wrong(name)]


@pytest.mark.parametrize("layer", LAYERS)
def test_imports_go_down(layer):
    assert not offending(lambda name: LAYERS.get(layer_of_import(name), 0) > LAYERS[layer], [layer])


def test_the_package_does_not_use_its_own_front_door():
    """`from wsn_env import Scenario` is for users; inside it would hide where a name stands."""
    assert not offending(lambda name: layer_of_import(name) == "wsn_env", PACKAGES)


def test_nobody_imports_a_top_level_agents():
    """It may be another project's; ours is wsn_env.agents."""
    assert not offending(lambda name: name.split(".")[0] == "agents")


def test_nobody_below_the_environments_imports_gymnasium_or_a_learner():
    below = PACKAGES[: PACKAGES.index("envs")]
    assert not offending(lambda name: name.split(".")[0] in FROM_ENVS_UP, below)


def test_every_package_has_its_place_in_the_order():
    children = {path.stem for path in (ROOT / "wsn_env").glob("*.py") if not path.stem.startswith("__")}
    children |= {path.parent.name for path in (ROOT / "wsn_env").glob("*/__init__.py")}
    assert "agents" not in children, "it stands at the top of the repository"
    assert sorted(children | {"agents"}) == sorted(PACKAGES)


def test_the_top_level_of_the_package_is_a_short_list():
    if not (ROOT / ".git").exists():
        pytest.skip("no git checkout")
    listed = subprocess.run(["git", "ls-files", "wsn_env"], cwd=ROOT, capture_output=True, text=True, check=True)
    entries = {name.split("/")[1] for name in listed.stdout.splitlines()}
    assert 0 < len(entries) <= TOP_LEVEL_ENTRIES, sorted(entries)


@pytest.mark.parametrize("layer", [name for name in PACKAGES if name != "cli"])
def test_init_files_hand_names_on_and_hold_no_logic(layer):
    """A docstring, imports, `__all__`. The front door alone does more: it loads names when they are first used."""
    paths = [path for path in FILES if path.name == "__init__.py" and layer_of_file(path) == layer]
    assert paths
    for path in paths:
        docstring, *rest = ast.parse(path.read_text()).body
        assert isinstance(docstring, ast.Expr), f"{path}: begins with a docstring"
        others = [ast.unparse(node) for node in rest if not isinstance(node, (ast.Import, ast.ImportFrom))]
        assert all(text.startswith("__all__ = ") for text in others), path
