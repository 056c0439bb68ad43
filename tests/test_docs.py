"""Links and code samples of the documents."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").glob("*.md"))]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    links = re.findall(r"\]\(([^)#]+)\)", page.read_text())
    assert not [link for link in links if "://" not in link and not (page.parent / link).exists()]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_python_samples_run_in_order(page):
    names = {}
    for sample in re.findall(r"```python\n(.*?)```", page.read_text(), flags=re.S):
        exec(compile(sample.replace("episodes=100", "episodes=3"), page.name, "exec"), names)


def test_the_readme_is_short():
    assert len((ROOT / "README.md").read_text().splitlines()) < 120
