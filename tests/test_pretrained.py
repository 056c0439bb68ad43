"""The policies that come with the package give what the pages say."""

import json
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest
import tyro

from tests.figures import found_blocks
from wsn_env import Scenario, make_policy
from wsn_env.agents.ppo import PRETRAINED
from wsn_env.evaluation.comparison import evaluate
from wsn_env.training import trainer as train

DOCS = Path(__file__).parents[1] / "docs"
STEPS = dict.fromkeys(("PreDC-v0", "Rssi-v0"), 12_000_000)
STEPS |= {"Binary-v0": 4_000_000, "Anchors-v0": 2_000_000, "Underwater-v0": 3_000_000}
STEPS |= {"Ble-v0": 2_000_000, "Lifetime-v0": 6_000_000}
PAGES = {"Ble-v0": "real_data.md"} | dict.fromkeys(("PreDC-v0", "Rssi-v0"), "learning.md")  # the others': results.md
EPISODES = 150  # the first of the documented thousand
SHIPPED = sorted(path.parent.name for path in PRETRAINED.glob("*/policy.json"))


def documented(name: str, lam: float) -> float:
    """The return in the table of the shipped policy: a column for each lam."""
    page = DOCS / PAGES.get(name, "results.md")
    head, _, row, *_ = dict((block, text) for _, block, text in found_blocks(page.read_text()))[
        f"tables/shipped_{name}"
    ].splitlines()
    columns = [cell.strip() for cell in head.split("|")]
    return float(row.split("|")[columns.index(f"{lam:g}")].split()[0])


def test_there_are_some():
    assert SHIPPED == sorted(STEPS)


@pytest.mark.parametrize("name", SHIPPED)
def test_files_are_small_and_tell_how_they_were_made(name):
    for file in (PRETRAINED / name).iterdir():
        assert file.stat().st_size < 300_000
    saved = json.loads((PRETRAINED / name / "policy.json").read_text())
    assert saved["training"]["seed"] == 0 and saved["training"]["scenario"] == name
    assert saved["training"]["steps"] == STEPS[name]


@pytest.mark.skipif(shutil.which("make") is None, reason="needs make")
@pytest.mark.parametrize("name", SHIPPED)
def test_make_trains_them_with_the_settings_that_they_had(name):
    told = subprocess.run(["make", "-n", f"pretrained-{name}"], cwd=DOCS.parent, capture_output=True, text=True).stdout
    (line,) = (line for line in told.replace("\\\n", " ").splitlines() if " train.py " in line)
    settings = tyro.cli(train.Training, args=shlex.split(line.partition(" train.py ")[2]))
    train.complete_settings(settings)
    now, then = train.settings_as_json(settings), json.loads((PRETRAINED / name / "policy.json").read_text())
    assert {setting: now[setting] for setting in then["training"]} == then["training"]


@pytest.mark.parametrize(
    "name,lam",
    [(name, lam) for name in SHIPPED if name != "Lifetime-v0" for lam in Scenario.named(name).lam_octaves[1::2]],
)
def test_returns_are_the_documented_ones(name, lam):
    scenario = Scenario.named(name)
    evaluation = evaluate({"ppo": make_policy("ppo", scenario)}, scenario, [lam], EPISODES)
    values = evaluation.values("ppo", lam, "return")
    se = values.std() / EPISODES**0.5
    assert abs(values.mean() - documented(name, lam)) < 3 * se


@pytest.mark.parametrize("battery_mj", [0.5, 2.0])
def test_errors_over_whole_lives_are_the_documented_ones(battery_mj):
    blocks = {block: text for _, block, text in found_blocks((DOCS / "lifetime.md").read_text())}
    head, *_, last = blocks["lifetime/batteries"].strip().splitlines()
    cells = dict(zip((cell.strip() for cell in head.split("|")), (cell.strip() for cell in last.split("|"))))
    assert cells["capped error m"] == "ppo"
    scenario = Scenario.named("Lifetime-v0", battery_j=battery_mj / 1e3)
    errors = evaluate({"ppo": make_policy("ppo", scenario)}, scenario, [0.0], 16).values("ppo", 0.0, "error_m")
    assert abs(errors.mean() - float(cells[f"{battery_mj:g} mJ"].split()[0])) < 3 * errors.std() / 16**0.5
