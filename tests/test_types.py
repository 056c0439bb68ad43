"""What editors and type checkers are told: quantities and modes by name, and the types of the front door."""

import subprocess
import sys
from dataclasses import fields
from importlib.util import find_spec
from pathlib import Path
from typing import Literal, Union, get_args, get_origin, get_type_hints

import pytest

import wsn_env
from wsn_env.envs.actions import ACTIONS, ActionName
from wsn_env.envs.merit import ORDERS
from wsn_env.envs.observations import OBSERVATIONS, ObservationName
from wsn_env.envs.rendering.camera import RENDER_MODES, RenderMode
from wsn_env.envs.rewards import REWARDS, RewardName
from wsn_env.models.fault.base import Fault
from wsn_env.models.kinds import Kind
from wsn_env.models.library import FAULTS
from wsn_env.models.measurement.base import Order
from wsn_env.scenario.quantities import Quantities
from wsn_env.scenario.scenario import BY_NAME, Scenario
from wsn_env.scenario.tracking import Tracking

ROOT = Path(__file__).parents[1]
KINDS = [kind for registry in (*BY_NAME.values(), FAULTS) for kind in registry.kinds.values()]
SECTIONS = [type(Scenario().field), Tracking, *KINDS]

PROGRAM = """\
from wsn_env import ClusterEnv, ClusterVectorEnv, Scenario, evaluate

reveal_type(ClusterEnv("PreDC-v0", nodes=400).scenario)
reveal_type(evaluate(["nearest3"], Scenario.named("PreDC-v0")))
ClusterVectorEnv(4, "Ble-v0", action="subset", lam=(0.3, 30.0), autoreset_mode="SameStep")
Scenario.named("Rssi-v0", tracker="ekf", measurement="rssi", noise_db=2)
ClusterEnv(nodse=400)
ClusterEnv(action="menus")
Scenario.named("Binary-v0", reports="change")
Scenario().override(nodes="many")
"""
REVEALED = {3: "wsn_env.scenario.scenario.Scenario", 4: "wsn_env.evaluation.comparison.Evaluation"}
REFUSED = {7: "nodse", 8: '"action"', 9: '"reports"', 10: '"nodes"'}


def alternatives(hint) -> set:
    """The types that a hint allows; of a Literal, its values."""
    parts = set(get_args(hint)) if get_origin(hint) in (Union, type(int | str)) else {hint}
    return {value for part in parts for value in (get_args(part) if get_origin(part) is Literal else (part,))}


def hints_of(owner: type) -> dict:
    """The types of a section's quantities."""
    hints = get_type_hints(owner)
    return {item.name: hints[item.name] for item in fields(owner)}


def test_quantities_are_those_that_override_takes():
    names = {name for owner in (Scenario, *SECTIONS) for name in hints_of(owner)}
    assert set(Quantities.__annotations__) == names | {"calibration"}


def test_quantities_have_the_types_of_their_fields():
    known = get_type_hints(Quantities)
    expected: dict[str, set] = {"calibration": {str, Path}}
    for owner in (Scenario, *SECTIONS):
        for name, hint in hints_of(owner).items():
            expected.setdefault(name, set()).update(alternatives(hint))
    for name in BY_NAME:
        expected[name].add(str)
    expected["faults"] |= {list[Fault | str], Fault, str, type(None)}
    assert {name: alternatives(hint) for name, hint in known.items()} == expected


@pytest.mark.parametrize("owner", [Scenario, *SECTIONS], ids=lambda owner: owner.__name__)
def test_a_quantity_with_choices_is_a_literal_of_them(owner):
    """But for trackers, a table that grows."""
    for item in fields(owner):
        choices = item.metadata.get("allowed", {}).get("choices")
        if choices is not None and item.name != "tracker":
            hint = hints_of(owner)[item.name]
            assert (set(choices) == {True, False}) if hint is bool else (get_args(hint) == choices), item.name


@pytest.mark.parametrize(
    ("mode", "allowed"),
    [
        (ActionName, ACTIONS),
        (ObservationName, OBSERVATIONS),
        (RewardName, REWARDS),
        (Order, ORDERS),
        (RenderMode, RENDER_MODES),
    ],
)
def test_a_mode_is_a_literal_of_what_is_allowed(mode, allowed):
    assert get_args(mode) == tuple(allowed)


def test_every_kind_has_an_order_that_there_is():
    assert all(kind.order in ORDERS for kind in KINDS if issubclass(kind, Kind) and kind.role == "measurement")


def test_the_front_door_names_its_types():
    """For type checkers each public name is imported where it is loaded from when it is first used."""
    source = Path(wsn_env.__file__).read_text()
    for name, home in wsn_env._HOMES.items():
        assert f"from {home} import {name}" in source


@pytest.mark.slow
@pytest.mark.skipif(find_spec("mypy") is None, reason="mypy is not installed")
def test_mypy_follows_what_a_user_writes(tmp_path):
    (tmp_path / "wsn_env").mkdir()
    for path in [*(ROOT / "wsn_env").iterdir(), ROOT / "agents"]:  # as an installation has it
        (tmp_path / "wsn_env" / path.name).symlink_to(path)
    (tmp_path / "program.py").write_text(PROGRAM)
    options = ("--config-file", str(ROOT / "pyproject.toml"), "--follow-imports", "silent", "program.py")
    command = [sys.executable, "-m", "mypy", "--no-error-summary", *options]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    said = dict.fromkeys(range(1, PROGRAM.count("\n") + 1), "")
    for line in done.stdout.splitlines():
        file, number, text = line.split(":", 2)
        assert file == "program.py", done.stdout
        said[int(number)] += text
    for number, text in said.items():
        if number in REVEALED:
            assert "error" not in text and f'"{REVEALED[number]}"' in text, text
        elif number in REFUSED:
            assert "error" in text and REFUSED[number] in text, text
        else:
            assert text == ""
