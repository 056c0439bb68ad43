"""The house: a file imports only from its own floor or lower ones."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
FLOORS = {
    "wsn_env": 0,  # the lazy front door; see the test below
    "wsn_env.compiled.kernels": 0,
    "wsn_env.models.state": 0,
    "wsn_env.envs.registration": 0,
    "wsn_env.evaluation.progress": 0,
    "wsn_env.evaluation.files": 0,
    "wsn_env.reports.pictures": 0,
    "wsn_env.envs.rendering.colours": 0,
    "wsn_env.evaluation.versions": 0,
    "wsn_env.evaluation.intervals": 0,
    "wsn_env.models.quantity": 0,
    "wsn_env.models.sections": 1,
    "wsn_env.scenario": 1,
    "wsn_env.compiled.elementary": 1,
    "wsn_env.compiled.draws": 1,
    "wsn_env.models.physics": 2,
    "wsn_env.models.physics.acoustics": 0,  # formulas that sections need
    "wsn_env.filters": 3,
    "wsn_env.simulation.view": 3,
    "wsn_env.simulation.episode": 3,
    "wsn_env.simulation.period": 3,
    "wsn_env.simulation.search": 3,
    "wsn_env.simulation.world": 4,
    "wsn_env.evaluation.policies": 4,
    "wsn_env.envs.interface": 5,
    "wsn_env.envs.rendering": 5,
    "wsn_env.simulation.bound": 5,
    "agents": 5,
    "wsn_env.envs.env": 6,
    "wsn_env.envs.vector_env": 6,
    "wsn_env.agents.planner": 7,  # it rehearses and compares
    "wsn_env.learning.rllib": 7,  # joins a cluster
    "wsn_env.learning.sb3": 7,  # adapts the vector environment
    "wsn_env.evaluation.rollout": 6,
    "wsn_env.evaluation.kept_blocks": 6,
    "wsn_env.evaluation.comparison": 7,
    "wsn_env.evaluation.scoring": 7,
    "wsn_env.reports.pages": 8,
    "wsn_env.bluetooth.recorded_evaluation": 7,
    "wsn_env.evaluation.ray_engine": 7,
    "wsn_env.reports.tables": 7,
    "wsn_env.evaluation.front": 7,
    "wsn_env.reports": 8,
    "wsn_env.bluetooth": 7,
    "wsn_env.papers": 8,
    "benchmarks": 8,
    "benchmarks.training": 10,  # it times train.py
    "wsn_env.cli": 9,
    "wsn_env.__main__": 9,
    "train": 9,
    "studies": 10,
}
FILES = [p for folder in ("wsn_env", "agents", "benchmarks", "studies") for p in sorted((ROOT / folder).rglob("*.py"))]
FILES.append(ROOT / "train.py")


def module_of(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def floor_of(module: str) -> int | None:
    """The floor of the module, or of the nearest wing that it stands in."""
    while module:
        if module in FLOORS:
            return FLOORS[module]
        module = module.rpartition(".")[0]
    return None


def imports_of(path: Path) -> set[str]:
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: imports are absolute"
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return {name for name in names if name.partition(".")[0] in ("wsn_env", "agents", "benchmarks", "studies", "train")}


@pytest.mark.parametrize("path", FILES, ids=module_of)
def test_imports_go_down(path):
    own = floor_of(module_of(path))
    assert own is not None, "give the file a floor"
    above = {name: floor_of(name) for name in imports_of(path) if floor_of(name) > own}
    assert not above


def test_every_file_has_a_place():
    modules = {module_of(path) for path in FILES}
    assert all(any(m == name or m.startswith(f"{name}.") for m in modules) for name in FLOORS)


@pytest.mark.parametrize(
    "path", [p for p in FILES if "physics" in p.parts or p.stem in ("world", "view", "types")], ids=module_of
)
def test_nobody_below_the_interface_knows_gymnasium_or_sb3(path):
    text = path.read_text()
    assert "import gymnasium" not in text and "stable_baselines3" not in text


def test_papers_and_policies_never_import_agents():
    for path in FILES:
        if module_of(path).startswith("wsn_env"):
            assert not any(name.startswith("agents") for name in imports_of(path)), path
