"""The house: a file imports only from its own floor or lower ones."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
FLOORS = {
    "wsn_env": 0,  # the lazy front door; see the test below
    "wsn_env.compiling": 0,
    "wsn_env.types": 0,
    "wsn_env.registration": 0,
    "wsn_env.progress": 0,
    "wsn_env.files": 0,
    "wsn_env.pictures": 0,
    "wsn_env.colours": 0,
    "wsn_env.versions": 0,
    "wsn_env.intervals": 0,
    "wsn_env.quantity": 0,
    "wsn_env.sections": 1,
    "wsn_env.scenario": 1,
    "wsn_env.numerics": 1,
    "wsn_env.draws": 1,
    "wsn_env.physics": 2,
    "wsn_env.physics.acoustics": 0,  # formulas that sections need
    "wsn_env.trackers": 3,
    "wsn_env.view": 3,
    "wsn_env.episode": 3,
    "wsn_env.period": 3,
    "wsn_env.search": 3,
    "wsn_env.world": 4,
    "wsn_env.policies": 4,
    "wsn_env.interface": 5,
    "wsn_env.rendering": 5,
    "wsn_env.bounds": 5,
    "agents": 5,
    "wsn_env.env": 6,
    "wsn_env.vector_env": 6,
    "agents.planner": 7,  # it rehearses and compares
    "agents.rllib": 7,  # joins a cluster
    "agents.sb3": 7,  # adapts the vector environment
    "wsn_env.rollout": 6,
    "wsn_env.kept_blocks": 6,
    "wsn_env.evaluation": 7,
    "wsn_env.scoring": 7,
    "wsn_env.pages": 8,
    "wsn_env.recorded_evaluation": 8,
    "wsn_env.ray_engine": 7,
    "wsn_env.reports": 7,
    "wsn_env.front": 7,
    "wsn_env.front_report": 7,
    "wsn_env.bluetooth": 1,
    "wsn_env.bluetooth.calibration": 7,
    "wsn_env.bluetooth.residual_map": 7,
    "wsn_env.bluetooth.calibration_report": 8,
    "agents.tuning": 8,  # it compares policies
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
