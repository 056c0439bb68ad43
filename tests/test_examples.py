"""The examples of other toolkits: three that need nothing else are run, the others by `make examples`."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

from examples.__main__ import CLOSING, EXAMPLES, needs

ROOT = Path(__file__).parents[1]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["sb3_ppo", "cleanrl_ppo", "mo_gymnasium_ppo"])
def test_it_learns_something(name):
    """Exit status 0 says that the 95 % interval of what it is ahead of random actions lies above 0."""
    command = [sys.executable, EXAMPLES[name], "--steps", "8000"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, timeout=180)
    assert done.returncode == 0, done.stdout + done.stderr
    assert CLOSING.match(done.stdout.splitlines()[-1])


@pytest.mark.parametrize("name", EXAMPLES)
def test_every_toolkit_has_its_line_on_the_page_and_its_version(name):
    path = EXAMPLES[name]
    assert f"../examples/{path.name}" in (ROOT / "docs" / "toolkits.md").read_text()
    assert any("==" in need for need in needs(path)) or needs(path) == ["wsn_env[train]"]
    text = path.read_text()
    assert len(text.splitlines()) < 120, "a page of code"
    (main,) = (part for part in ast.parse(text).body if getattr(part, "name", "") == "main")
    assert main.args.args[0].arg == "steps" and main.args.defaults[0].value == 20_000
