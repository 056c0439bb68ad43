"""What a training's critic sees beyond the observation, and the worlds that a training meets."""

import numpy as np
import pytest

from wsn_env import ClusterVectorEnv, Scenario, World
from wsn_env.envs.prospects import ENTRY_FEATURES
from wsn_env.envs.registration import IDS
from wsn_env.learning.held_out import HeldOut
from wsn_env.learning.network import EntryNetwork
from wsn_env.learning.privileged import TRUTH_FEATURES, PrivilegedVectorEnv
from wsn_env.learning.worlds import default_worlds, world_of
from wsn_env.models import ScenarioError
from wsn_env.training import trainer as train

SMALL = dict(particles=50, nodes=60, side_m=50, crossing_m=20, periods=12)


def make_rows(rows: int = 6, **changes) -> ClusterVectorEnv:
    settings = dict(observation="menu", autoreset_mode="Disabled") | SMALL | changes
    return ClusterVectorEnv(rows, **settings)


def test_the_truth_stands_behind_the_observation():
    """From it and the belief alone the target's next place and velocity can be found again."""
    envs = make_rows()
    told = PrivilegedVectorEnv(envs, 1, 3)
    observation, _ = told.reset(seed=5)
    for period in range(12):
        assert observation.shape == told.observation_space.shape and told.single_observation_space.contains(
            observation[0]
        )
        n = envs.single_observation_space.shape[0]
        ahead, left, faster, leftward, played = observation[:, n : n + len(TRUTH_FEATURES)].T.astype(float)
        np.testing.assert_array_equal(observation[:, -3:], np.tile([0, 1, 0], (6, 1)))
        np.testing.assert_allclose(played, period / 12, atol=1e-6)
        state = envs.state
        predicted = state.belief.row["predicted_mean"]
        heading = predicted[:, 1::2] / np.hypot(predicted[:, 1], predicted[:, 3])[:, None]
        across = np.stack([-heading[:, 1], heading[:, 0]], axis=1)
        places = predicted[:, ::2] + envs.scenario.radius_m * (ahead[:, None] * heading + left[:, None] * across)
        speeds = predicted[:, 1::2] + envs.scenario.radius_m * (faster[:, None] * heading + leftward[:, None] * across)
        within = abs(observation[:, n : n + 4]).max(axis=1) < 10
        truth = state.track[:, period + 1]
        np.testing.assert_allclose(places[within], truth[within][:, ::2], atol=1e-3)
        np.testing.assert_allclose(speeds[within], truth[within][:, 1::2], atol=1e-3)
        observation, *_ = told.step(np.full(6, 12))


def test_what_it_adds_changes_neither_worlds_nor_rewards():
    plain, told = make_rows(), PrivilegedVectorEnv(make_rows())
    first, n = plain.reset(seed=3)[0], plain.single_observation_space.shape[0]
    np.testing.assert_array_equal(told.reset(seed=3)[0][:, :n], first)
    for period in range(12):
        ours, theirs = plain.step(np.full(6, period)), told.step(np.full(6, period))
        np.testing.assert_array_equal(theirs[0][:, :n], ours[0])
        np.testing.assert_array_equal(theirs[1], ours[1])


def test_it_needs_a_flat_observation():
    with pytest.raises(ValueError, match="must be a Box"):
        PrivilegedVectorEnv(make_rows(observation="dict"))


@pytest.mark.parametrize("name", IDS)
def test_every_default_world_is_one(name):
    scenario = Scenario.named(name)
    worlds = default_worlds(scenario)
    made = [scenario.override(**world_of(world)) for world in worlds]
    assert len({repr(one) for one in (scenario, *made)}) == 1 + len(made)
    assert all(one.tracking.particles <= 1000 for one in made)


def test_worlds_that_do_not_fit_are_left_out():
    """A circle of 30 m in a field of 50 m."""
    scenario = Scenario.named("PreDC-v0", side_m=50.0, crossing_m=20.0)
    with pytest.raises(ScenarioError, match="Circle.circle_m"):
        World(scenario.override(motion="circle"))
    worlds = default_worlds(scenario)
    assert "particles=1000,motion=turns,speed_ms=1" in worlds and "circle" not in "".join(worlds)
    assert "nodes=80" in default_worlds(scenario.override(nodes=40, particles=50))


def constant_network(scenario: Scenario, interface: train.Settings, entry_weight: float) -> EntryNetwork:
    """Scores entries by their number of members, and by how probably the head detects."""
    envs = ClusterVectorEnv(1, scenario, observation="menu", order=interface.order)
    belief, width = envs.interface.observation.belief, envs.interface.observation.shape[1]
    entry = np.zeros((width, 2))
    entry[list(ENTRY_FEATURES).index("members"), 0] = entry_weight
    entry[list(ENTRY_FEATURES).index("head_detection"), 0] = 1.0
    arrays = {
        "belief.weight": np.zeros((belief, 2)),
        "belief.bias": np.full(2, 5.0),
        "entry.weight": entry,
        "hidden.weight": np.eye(2),
        "hidden.bias": np.zeros(2),
        "score.weight": np.array([[1.0], [0.0]]),
        "score.bias": np.zeros(1),
    }
    return EntryNetwork(arrays)


def test_the_lead_is_over_the_best_rule_on_the_same_episodes():
    """Who always takes most members is ahead at lam = 0 and far behind where energy is dear."""
    scenario = Scenario.named("PreDC-v0", **SMALL)
    interface = train.Settings("menu", "menu", "belief", "nearest")
    rules = {name: train.make_policy(name, scenario) for name in ("nearest0", "nearest2")}
    held_out = HeldOut(scenario, interface, rules, [0.0, 20.0], episodes=40)
    most, none = (held_out(constant_network(scenario, interface, weight)) for weight in (1.0, -1.0))
    assert most[0.0].mean > 3 * most[0.0].error and most[20.0].mean < -50
    assert none[0.0].mean < 0 and abs(none[20.0].mean) < 15 and none[20.0].error > 0
    assert held_out(constant_network(scenario, interface, 1.0)) == most
