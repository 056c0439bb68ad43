"""The examples of other toolkits: three that need nothing else are run, the others by `make examples`."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

from examples.__main__ import CLOSING, EXAMPLES, Training, needs, summarize, without_dependencies

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
    assert "seed" in [argument.arg for argument in main.args.args]


def test_the_closing_line_is_read():
    line = (
        "skrl PPO: return -135.3 after 20,480 time steps in 4.6 s (4,485 a second); random actions -163.9,"
        " better by 28.6 [25.1, 31.9] over 200 held-out episodes"
    )
    assert CLOSING.match(line).groups() == ("skrl PPO", "-135.3", "4,485", "-163.9")


def test_the_row_of_an_example_is_the_mean_and_the_range_of_its_seeds():
    trainings = [
        Training(-130.0, 4000.0, -163.0, True),
        Training(-124.0, 5000.0, -163.0, True),
        Training(-127.0, 4500.0, -163.0, False),
    ]
    cells = summarize(sys.executable, EXAMPLES["sb3_ppo"], trainings)
    assert cells[2:] == ["4,500", "-127.0 (-130.0 to -124.0)", "-163.0", "2 of 3 seeds"]


def test_toolkits_with_too_narrow_pins_are_installed_without_dependencies():
    assert without_dependencies(EXAMPLES["d3rlpy_cql"]) == ["d3rlpy==2.8.1"] == needs(EXAMPLES["d3rlpy_cql"])[-1:]
    assert without_dependencies(EXAMPLES["sb3_ppo"]) == []
