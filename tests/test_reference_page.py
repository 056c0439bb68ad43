"""docs/reference.md against the package: names, shapes and ranges of observations, every quantity."""

import importlib
import re
from dataclasses import fields
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

import wsn_env
from tests.figures import found_blocks
from wsn_env.envs.actions import ACTIONS
from wsn_env.envs.observations import OBSERVATIONS
from wsn_env.envs.registration import IDS

DOCS = Path(__file__).parents[1] / "docs"
TEXT = (DOCS / "reference.md").read_text()
ROLES = "measurement", "detection", "motion", "radio", "fault"


@pytest.fixture
def made(monkeypatch):
    monkeypatch.syspath_prepend(str(DOCS))
    return importlib.import_module("reference_tables")


def section(begin, end):
    return TEXT[TEXT.index(begin) : TEXT.index(end)]


def first_cells(text):
    return {
        name
        for line in text.splitlines()
        if line.startswith("| `")
        for name in re.findall(r"`\"?(\w+)\"?`", line.split("|")[1])
    }


def test_its_tables_are_those_of_the_package(made):
    tables = {f"reference/{name}": text for name, text in made.tables().items()}
    assert {name: content for _, name, content in found_blocks(TEXT)} == tables


def test_every_quantity_has_a_meaning(made):
    sections = [*made.SECTIONS.values(), *(kind for role in made.ROLES.values() for kind in role.kinds.values())]
    named = [(each, item) for each in sections for item in fields(each) if item.name not in made.PARTS]
    assert len(named) > 150
    assert not [f"{each.__name__}.{item.name}" for each, item in named if not item.metadata.get("meaning")]


def test_actions_and_observations_are_all_there():
    assert first_cells(section("## Actions", "## Observations")) == set(ACTIONS)
    assert set(re.findall(r"^\*\*`\"(\w+)\"`\*\*", TEXT, re.M)) == set(OBSERVATIONS)
    told = first_cells(section("| `period` | int", "## Info"))
    spaces = [wsn_env.ClusterEnv(name, observation="view").observation_space.spaces for name in ("Binary-v0", "Ble-v0")]
    spaces.append(wsn_env.MultiEnv(observation="view").observation_space.spaces)
    assert told == set().union(*spaces)


@pytest.mark.parametrize("observation", ["candidates", "menu"])
@pytest.mark.parametrize("name", IDS)
def test_columns_are_within_their_ranges(name, observation):
    """A dozen environments, a lam from the whole span, random choices."""
    more = dict(observation=observation, particles=200, lam=(0.3, 30.0))
    envs = gym.make_vec(f"wsn_env/{name}", 12, vectorization_mode="vector_entry_point", **more)
    features = list(envs.unwrapped.interface.observation.features.values())
    assert envs.single_observation_space.shape == (len(features),)
    envs.action_space.seed(0)
    seen = [envs.reset(seed=0)[0]]
    seen += [envs.step(envs.action_space.sample())[0] for _ in range(25)]
    low, high = (np.array([getattr(feature, end) for feature in features]) for end in ("low", "high"))
    columns = np.concatenate(seen)
    assert (columns >= low - 1e-6).all() and (columns <= high + 1e-6).all()
    shapes = {"candidates": "(157,)", "menu": "(473,)"}
    if not envs.unwrapped.scenario.scarce_energy:
        assert shapes[observation] == str(envs.single_observation_space.shape)
        assert f'**`"{observation}"`**: shape {shapes[observation]}' in TEXT
