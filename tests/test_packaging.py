"""What an installation and a source archive hold, and what an installation leaves alone."""

import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import NamedTuple

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

import wsn_env

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
FOR_USERS = "train plot front render ray multi".split()  # extras
COMPANIONS = {"pyparsing"}  # in constraints-lowest.txt for the sake of another
LEFT_OUT = (".*", "build", "dist", "out", "runs", "results", "_generated", "__pycache__", "*.egg-info")
BUILD = "import sys; from setuptools import build_meta; getattr(build_meta, 'build_' + sys.argv[1])(sys.argv[2])"


class Built(NamedTuple):
    """Names of files."""

    source: set[str]  # of the source archive, unpacked
    wheel: Path
    installed: set[str]  # of the wheel


def build(kind: str, source: Path, out: Path) -> Path:
    """What pip does without build isolation, which would want a network."""
    command = [sys.executable, "-c", BUILD, kind, str(out)]
    done = subprocess.run(command, cwd=source, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    return next(out.iterdir())


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> Built:
    """The source archive of the files as they are, and a wheel made from nothing but it."""
    try:
        enough = int(version("setuptools").split(".")[0]) >= 77
    except PackageNotFoundError:
        enough = False
    if not enough:
        pytest.skip("building wants setuptools >= 77, as pyproject.toml says")
    tmp = tmp_path_factory.mktemp("build")
    shutil.copytree(ROOT, tmp / "copy", ignore=shutil.ignore_patterns(*LEFT_OUT))
    with tarfile.open(build("sdist", tmp / "copy", tmp / "sdist")) as archive:
        archive.extractall(tmp / "unpacked", filter="data")
    source = next((tmp / "unpacked").iterdir())
    files = {path.relative_to(source).as_posix() for path in source.rglob("*") if path.is_file()}
    wheel = build("wheel", source, tmp / "wheel")
    with zipfile.ZipFile(wheel) as archive:
        return Built(files, wheel, set(archive.namelist()))


def files_under(*folders: str, but: tuple[str, ...] = ("__pycache__", "_generated", "results")) -> set[str]:
    """The repository's files in some folders."""
    paths = [path for folder in folders for path in (ROOT / folder).rglob("*") if path.is_file()]
    return {path.relative_to(ROOT).as_posix() for path in paths if not set(but) & set(path.parts)}


def test_the_list_of_packages_equals_the_folders():
    folders = {path.parent.relative_to(ROOT).as_posix() for path in (ROOT / "wsn_env").rglob("__init__.py")}
    packages = {folder.replace("/", ".") for folder in folders}
    assert sorted({*packages, "wsn_env.agents"}) == sorted(PROJECT["tool"]["setuptools"]["packages"])


def test_every_folder_of_python_files_is_a_package():
    folders = {path.parent for path in (ROOT / "wsn_env").rglob("*.py")} | {ROOT / "agents"}
    assert not [folder for folder in folders if not (folder / "__init__.py").exists()]


def test_entry_points_name_what_there_is():
    files = {"agents": ROOT / "agents", "cli": ROOT / "wsn_env"}
    points = PROJECT["project"]["entry-points"]["wsn_env.policies"] | PROJECT["project"]["scripts"]
    for module in (point.partition(":")[0].split(".") for point in points.values()):
        assert module[0] == "wsn_env" and (files[module[1]] / f"{module[-1]}.py").exists()


def test_the_lowest_versions_declared_are_those_tried():
    """But torch's, for which stable-baselines3 has a bound."""
    lines = (ROOT / "constraints-lowest.txt").read_text(encoding="utf-8").splitlines()
    pins = [Requirement(line.partition("#")[0]) for line in lines if line.partition("#")[0]]
    tried = {canonicalize_name(pin.name): str(pin.specifier).removeprefix("==") for pin in pins}
    extras = PROJECT["project"]["optional-dependencies"]
    texts = [*PROJECT["project"]["dependencies"], *(text for name in FOR_USERS for text in extras[name])]
    declared = {}
    for requirement in (Requirement(text) for text in texts if text != "torch"):
        low = [bound.version for bound in requirement.specifier if bound.operator == ">="]
        assert len(low) == 1, f"{requirement}: no lower bound"
        declared.setdefault(canonicalize_name(requirement.name), set()).add(Version(low[0]))
    assert declared == {name: {Version(version)} for name, version in tried.items() if name not in COMPANIONS}


def test_an_installation_claims_one_name(built):
    """A top-level `agents` would overwrite another project's (openai-agents has one), and `tests` anybody's."""
    tops = {name.split("/")[0] for name in built.installed}
    assert {top for top in tops if not top.endswith(".dist-info")} == {"wsn_env"}


def test_an_installation_holds_every_module_and_its_data(built):
    wanted = files_under("wsn_env") | {f"wsn_env/{name}" for name in files_under("agents")}
    assert "wsn_env/py.typed" in wanted and "wsn_env/agents/tuned.json" in wanted
    assert {f"wsn_env/agents/pretrained/PreDC-v0/policy.{kind}" for kind in ("json", "safetensors")} <= wanted
    assert any(name.startswith("wsn_env/reports/pages/templates/") for name in wanted)
    assert not wanted - built.installed


def test_the_source_archive_holds_what_tests_and_documents_need(built):
    wanted = files_under("wsn_env", "agents", "benchmarks", "studies", "examples", "docs", "tests")
    wanted |= {path.name for path in ROOT.iterdir() if path.suffix in (".md", ".py", ".toml", ".txt", ".in")}
    assert {"train.py", "tests/__init__.py", "tests/golden/frame.png", "docs/api.md", "MANIFEST.in"} <= wanted
    assert not wanted - built.source


def test_the_source_archive_holds_every_file_of_the_repository(built):
    """Those of the folders and on top; but for what only git and the continuous integration read."""
    if not (ROOT / ".git").exists():
        pytest.skip("no git checkout")
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True).stdout
    wanted = {name for name in listed.decode().split("\0") if name and not name.startswith(".")}
    assert len(wanted) > 300 and not {name for name in wanted if (ROOT / name).exists()} - built.source


@pytest.mark.parametrize("own", ["agents/__init__.py", "agents.py"])
def test_a_working_folder_may_hold_agents_of_its_own(own, built, tmp_path):
    """The wheel before everything else on the path, and then the working folder, as in `python -m`."""
    with zipfile.ZipFile(built.wheel) as archive:
        archive.extractall(tmp_path / "site")
    (tmp_path / "work" / own).parent.mkdir(parents=True)
    (tmp_path / "work" / own).write_text("raise RuntimeError('another agents')")
    code = "\n".join(
        [
            "from importlib.metadata import distribution",
            "for point in distribution('wsn_env').entry_points:",
            "    point.load()",
            "import wsn_env, wsn_env.agents.ppo as ppo; print(wsn_env.__file__, ppo.__file__, sep='\\n')",
            "import sys; assert not {'torch', 'stable_baselines3', 'agents'} & set(sys.modules)",
        ]
    )
    environment = os.environ | {"PYTHONPATH": str(tmp_path / "site")}
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path / "work", env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert all(Path(line).is_relative_to(tmp_path / "site") for line in done.stdout.splitlines())


def test_every_page_names_the_same_version():
    wanted = PROJECT["project"]["version"]
    assert wanted == wsn_env.__version__
    assert f"\nversion: {wanted}\n" in (ROOT / "CITATION.cff").read_text()
    assert f"version = {{{wanted}}}" in (ROOT / "docs" / "citing.md").read_text()


def test_the_forge_runs_the_make_targets_and_hooks_of_the_same_version():
    targets = re.search(r"^\.PHONY: (.*)$", (ROOT / "Makefile").read_text(), re.M)[1].split()
    workflow = (ROOT / ".github" / "workflows" / "ci.yml").read_text()
    asked = {name for line in re.findall(r"run: make (.*)", workflow) for name in line.split()}
    assert {"lint", "test", "docs", "package"} == asked <= set(targets)
    ruff = re.search(r"^ruff==(.*)$", (ROOT / "constraints.txt").read_text(), re.M)[1]
    assert f"rev: v{ruff}\n" in (ROOT / ".pre-commit-config.yaml").read_text()
