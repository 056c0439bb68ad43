"""Links and code samples of the documents."""

import importlib
import re
from pathlib import Path
from pkgutil import resolve_name

import pytest

from tests.figures import cells, found_blocks, table_lines
from wsn_env.cli import main
from wsn_env.envs.registration import IDS
from wsn_env.evaluation.policies import policy_names
from wsn_env.papers.claim import HOLDS, NOT_REPRODUCED, UNDER_READING

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").rglob("*.md"))]
FOLDERS = "wsn_env|agents|benchmarks|docs|examples|studies|tests"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    links = re.findall(r"\]\(([^)#]+)\)", page.read_text())
    made = "_generated/"  # by the site's build
    assert not [link for link in links if "://" not in link and made not in link and not (page.parent / link).exists()]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_files_and_names_are_there(page):
    """`wsn_env/cli.py`, `wsn_env.evaluate`, `python -m studies.seeds`."""
    text = page.read_text()
    files = re.findall(rf"`((?:{FOLDERS})/[\w./]*)`", text)
    assert not [file for file in files if not (ROOT / file).exists()]
    for name in set(re.findall(r'(?<!["\w])(?:wsn_env|studies|benchmarks)(?:\.\w+)+', text)):  # not "wsn_env.policies"
        resolve_name(name)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_python_samples_run_in_order(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = {}
    for sample in re.findall(r"```python\n(.*?)```", page.read_text(), flags=re.S):
        exec(compile(sample.replace("episodes=100", "episodes=3"), page.name, "exec"), names)


def test_the_tutorials_policy_joins_a_comparison(tmp_path, monkeypatch, capsys):
    """As it says: the first block in mine.py, then the commands."""
    text = (ROOT / "docs" / "tutorials.md").read_text()
    monkeypatch.chdir(tmp_path)
    Path("mine.py").write_text(re.search(r"```python\n(.*?)```", text, flags=re.S)[1])
    commands = re.findall(r"python -m wsn_env (.*mine.py.*)", text)
    for command in commands:
        assert main([*command.split(), *(["--episodes", "2"] if command.startswith("evaluate") else [])]) == 0
    assert len(commands) == 2 and Path("replay.html").exists()
    rows = Path("out/mine/evaluation.csv").read_text()
    assert all(f"\n{label}," in rows for label in ("mine.py:Cautious", "cautious", "pre_dc"))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_no_block_is_empty(page):
    empty = {name for _, name, content in found_blocks(page.read_text()) if not content.strip()}
    assert empty <= {"further"}  # of performance.md: claims without a place of their own


def test_the_verdicts_of_the_papers_are_counted_from_their_tables():
    text, total = (ROOT / "docs" / "reproduction.md").read_text(), [0, 0, 0, 0]
    for paper in ("pre_dc", "binary", "grnn", "underwater"):
        page = (ROOT / "docs" / "reproduction" / f"{paper}.md").read_text()
        claims = next(block for _, name, block in found_blocks(page) if name == f"reproduce/{paper}/claims")
        verdicts = [cells(line)[-1] for line in table_lines(claims)[2:]]
        counts = [len(verdicts), *map(verdicts.count, (HOLDS, UNDER_READING, NOT_REPRODUCED))]
        shown = next(line for line in table_lines(text) if f"(reproduction/{paper}.md)" in line)
        assert cells(shown)[1:] == [str(count) for count in counts], paper
        total = [old + new for old, new in zip(total, counts)]
    assert cells(table_lines(text)[-1]) == ["all", *map(str, total)]
    assert f"Of their {total[0]} claims {total[1]} hold, {total[2]} hold under a stated reading and {total[3]}" in text


def test_the_readme_is_short():
    assert len((ROOT / "README.md").read_text().splitlines()) < 100


def test_every_scenario_and_policy_has_its_page(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    importlib.import_module("scenarios").write_pages(tmp_path)
    pages = {path.stem: path.read_text() for path in tmp_path.glob("*.md")}
    assert set(pages) == set(IDS)
    for name, page in pages.items():
        assert page.startswith(f"# {name}\n") and "What matters:" in page and f".. quantities:: {name}\n" in page
    text = (ROOT / "docs" / "policies.md").read_text()
    families = {name.rstrip("0123456789") for name in policy_names()}
    entry = r"\n## {0}\d?\n((?!\n## ).)*_generated/policy_{0}\d?\.png"
    assert not [name for name in families if not re.search(entry.format(name), text, re.S)]
