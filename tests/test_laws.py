"""The six laws of the world, on random scenarios with random choices."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.worlds import (
    HAND_WRITTEN,
    KEYS,
    assert_finite,
    assert_same,
    choices,
    keys_of,
    leaves,
    living_entries,
    play,
    scenarios,
)
from wsn_env import Cluster, Scenario, View, World, make_policy
from wsn_env.envs.interface import Interface, Settings
from wsn_env.scenario.tracking import BOUNDARY_TRACKERS

HEADS_TELL = ("bursts", "failures", "regional_failure")  # one that dies is no longer heard, its own is never lost
SEEDS = st.integers(0, 2**32 - 1)


def law(examples):
    """Settings of a property test: derandomised, so that a failure is everybody's."""
    return settings(max_examples=examples, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))


# --- 1: one world ---------------------------------------------------------------------------------------------


@law(180)
@given(scenarios(), KEYS, SEEDS, st.integers(0, 11))
def test_a_row_of_a_batch_is_a_batch_of_one(scenario, key, seed, row):
    keys = keys_of(seed, 12)
    keys[row] = key
    batch = play(scenario, keys, seed)
    alone = play(scenario, keys[row : row + 1], seed, pick=[row])
    for (_, _, state, outcome), (_, _, single, own) in zip(batch, alone, strict=True):
        assert_same(living_entries(state), living_entries(single), slice(row, row + 1))
        assert_same(outcome, own, slice(row, row + 1))


@law(90)
@given(scenarios(), SEEDS)
def test_rows_may_stand_in_any_order(scenario, seed):
    keys = keys_of(seed, 10)
    order = np.random.default_rng(seed).permutation(10)
    for (_, _, state, outcome), (_, _, shuffled, theirs) in zip(
        play(scenario, keys, seed), play(scenario, keys[order], seed, pick=order), strict=True
    ):
        assert_same(living_entries(state), living_entries(shuffled), order)
        assert_same(outcome, theirs, order)


@law(90)
@given(scenarios(), SEEDS, st.integers(9, 25))
def test_threads_change_no_bit(scenario, seed, rows):
    keys = keys_of(seed, rows)
    for (_, _, one, outcome), (_, _, two, theirs) in zip(
        play(scenario, keys, seed, threads=1), play(scenario, keys, seed, threads=2), strict=True
    ):
        assert_same(one, two)
        assert_same(outcome, theirs)


@law(60)
@given(scenarios(), SEEDS)
def test_a_restarted_row_is_a_fresh_one(scenario, seed):
    keys, again = keys_of(seed, 5), keys_of(seed + 1, 5)
    *_, (_, _, used, _) = play(scenario, keys, seed)
    world, rows = World(scenario, threads=1), np.array([True, False, True, True, False])
    restarted, _ = world.restart(used, rows, again)
    assert_same(living_entries(restarted), living_entries(world.reset(again)), rows, rows)
    assert_same(replace(restarted, ledger=used.ledger), used, ~rows, ~rows)
    choice = choices(seed, 0, 5, scenario.field.nodes)
    assert_same(
        living_entries(world.step(restarted, choice)[0]),
        living_entries(world.step(world.reset(again), choice)[0]),
        rows,
        rows,
    )


# --- 2: randomness by key -------------------------------------------------------------------------------------


def told(state, row):
    """{node: measurement} of the head's reports."""
    n = state.reports.count[row]
    values = state.reports.value[row, :n].copy()
    if state.sensed.size:
        values[:, 1] = 0.0  # whether a state has changed depends on when the node was awake before
    return {int(i): v.tobytes() for i, v in zip(state.reports.node[row, :n], values, strict=True)}


@law(180)
@given(
    scenarios(
        modem_hops_m=(250.0,),
        packet_success=1.0,
        battery_j=1.0,
        search=False,
        start="known",
        no_faults=["late", *HEADS_TELL],
    ),
    SEEDS,
)
def test_what_happens_does_not_depend_on_the_choice(scenario, seed):
    """Whatever the cluster, those of it report that would have reported had everybody been awake, and the same."""
    keys, nodes = keys_of(seed, 4), scenario.field.nodes
    world = World(scenario, threads=1)
    everybody = world.reset(keys)
    awake = Cluster(np.zeros(4, int), np.tile(np.arange(nodes), (4, 1)))
    for _, _, state, outcome in play(scenario, keys, seed):
        everybody, whole = world.step(everybody, awake)
        np.testing.assert_array_equal(state.track, everybody.track)
        np.testing.assert_array_equal(outcome.target_m, whole.target_m)
        np.testing.assert_array_equal(state.row["random_bits"], everybody.row["random_bits"])
        np.testing.assert_array_equal(state.row["lam"], everybody.row["lam"])
        np.testing.assert_array_equal(state.network.positions, everybody.network.positions)
        for row in range(4):
            member = set(state.network.members[row, : state.network.n_members[row]].tolist())
            member.add(int(state.network.head[row]))
            if scenario.measurement.reports_state:  # what a node senses; reports depend on when it was awake before
                awake_now = sorted(member - {-1})  # no head: nobody is awake
                np.testing.assert_array_equal(state.sensed[row, awake_now], everybody.sensed[row, awake_now])
                assert told(state, row).keys() <= member
                continue
            expected = {node: value for node, value in told(everybody, row).items() if node in member}
            assert told(state, row) == expected


@law(90)
@given(scenarios(battery_j=1.0, no_faults=["late"]), SEEDS)
def test_two_policies_measure_the_same_where_both_do(scenario, seed):
    keys = keys_of(seed, 3)
    for (_, _, one, _), (_, _, other, _) in zip(
        play(scenario, keys, seed), play(scenario, keys, seed + 1), strict=True
    ):
        for row in range(3):
            a, b = told(one, row), told(other, row)
            assert all(a[node] == b[node] for node in a.keys() & b.keys())


# --- 3: no leak -----------------------------------------------------------------------------------------------


@law(120)
@given(scenarios(), SEEDS)
def test_the_truth_does_not_show(scenario, seed):
    interfaces = [
        Interface(scenario, Settings(action=action, observation=observation, order=order))
        for action, observation, order in [
            ("menu", "candidates", "nearest"),
            ("menu", "dict", "information"),
            ("menu", "menu", "nearest"),
            ("menu", "menu", "value"),
            ("subset", "view", "nearest"),
            ("nodes", "view", "nearest"),
        ]
    ]
    policies = [make_policy(name, scenario) for name in HAND_WRITTEN]
    rng = np.random.default_rng(seed)
    for _, _, state, _ in play(scenario, keys_of(seed, 3), seed):
        hidden = {"track": rng.normal(0, 1e3, state.track.shape), "residual_j": rng.random(state.residual_j.shape)}
        hidden["condition"] = np.ones_like(state.condition)
        false = replace(state.copy(), key=keys_of(seed + 2, 3), **hidden)
        false.row["last_search"] += 1
        for interface in interfaces:
            mine, theirs = View.of(state), View.of(false)
            assert_same(mine.as_arrays(), theirs.as_arrays())
            assert_same(
                dict(leaves({"o": interface.observation.encode(mine)})),
                dict(leaves({"o": interface.observation.encode(theirs)})),
            )
            assert_same({"m": interface.action.masks(mine)}, {"m": interface.action.masks(theirs)})
        for policy in policies:
            assert_same(policy.act(View.of(state)), policy.act(View.of(false)))


# --- 4: a pure step -------------------------------------------------------------------------------------------


@law(120)
@given(scenarios(), SEEDS)
def test_a_step_leaves_the_given_state_alone_and_donation_changes_no_bit(scenario, seed):
    keys = keys_of(seed, 3)
    donated = play(scenario, keys, seed, donate=True)
    world = World(scenario, threads=1)
    state = world.reset(keys)
    for period, (_, cluster, reused, theirs) in enumerate(donated):
        kept, asked = state.copy(), Cluster(cluster.head.copy(), cluster.members.copy())
        after, outcome = world.step(state, cluster)
        assert_same(state, kept)
        assert_same(cluster, asked)
        assert not any(
            np.shares_memory(a, b) for (_, a), (_, b) in zip(leaves(state), leaves(after), strict=True) if a.size
        )
        assert_same(after, reused)
        assert_same(outcome, theirs)
        assert_same(world.step(kept, cluster)[0], after)  # again: the same
        assert (after.row["period"] == period + 1).all()
        state = after


def test_a_reset_gives_the_same_world_twice():
    world = World(Scenario.named("PreDC-v0", particles=20, start="search"), threads=1)
    assert_same(world.reset([1, 2]), world.reset([1, 2]))


# --- 5: energy balances ---------------------------------------------------------------------------------------


def rounding(scenario):
    """Of a battery of 1 J, or as much as it has, by some hundred payments of a period [J]."""
    return 1e-14 * max(1.0, scenario.radio.most_battery_j)


@law(240)
@given(scenarios(), SEEDS)
def test_batteries_lose_what_the_outcome_reports(scenario, seed):
    for before, _, state, outcome in play(scenario, keys_of(seed, 4), seed):
        lost = before.residual_j - state.residual_j
        if state.condition.shape[1] > 0:  # what a node that fails has left is lost
            fails = state.condition["fails_at"] == state.row["period"][:, None]
            assert not state.residual_j[fails].any() and (outcome.spent_j <= before.residual_j)[fails].all()
            lost = np.where(fails, outcome.spent_j, lost)
        np.testing.assert_allclose(lost, outcome.spent_j, rtol=0, atol=rounding(scenario))
        np.testing.assert_allclose(outcome.energy_j.sum(axis=1), outcome.spent_j.sum(axis=1), rtol=1e-12, atol=1e-18)
        np.testing.assert_allclose(outcome.energy_mj, 1e3 * outcome.energy_j.sum(axis=1), rtol=1e-12)
        assert (outcome.energy_j >= 0).all() and (outcome.spent_j >= 0).all()
        assert (state.residual_j >= 0).all()

        # The dead stay dead, spend nothing, lead nobody and report nothing.
        dead = before.residual_j == 0
        assert (state.residual_j[dead] == 0).all() and (outcome.spent_j[dead] == 0).all()
        living = state.residual_j > 0
        # The network may take a node for better off than it is, never for worse.
        slack = rounding(scenario)
        assert (state.network.battery >= state.residual_j - slack).all()
        np.testing.assert_array_equal(state.network.alive, (state.network.battery > 0).sum(axis=1))
        np.testing.assert_array_equal(outcome.alive, living.sum(axis=1))
        for row in range(4):
            head = state.network.head[row]
            members = state.network.members[row, : state.network.n_members[row]]
            assert head == -1 or living[row, head]
            assert living[row, members].all()
            assert head not in members and (np.diff(members) > 0).all()
            assert head >= 0 or len(members) == 0
            reporters = state.reports.node[row, : state.reports.count[row]]
            assert not dead[row, reporters].any()
            assert (np.diff(reporters) > 0).all()


@law(90)
@given(scenarios(start="search"), SEEDS)
def test_the_first_search_is_charged(scenario, seed):
    world, keys = World(scenario, threads=1), keys_of(seed, 4)
    state, outcome = world.restart(world.reset(keys), np.ones(4, bool), keys)
    spent = state.full_j[:, None] - state.residual_j
    np.testing.assert_allclose(spent, outcome.spent_j, rtol=0, atol=rounding(scenario))
    np.testing.assert_allclose(outcome.energy_j.sum(axis=1), outcome.spent_j.sum(axis=1), rtol=1e-12, atol=1e-18)
    np.testing.assert_array_equal(state.network.alive, (state.network.battery > 0).sum(axis=1))


# --- 6: nothing is silently wrong -----------------------------------------------------------------------------


@pytest.mark.parametrize("tracker", ["particle", "ekf", "snapshot", *BOUNDARY_TRACKERS])
def test_a_dead_network_goes_on_predicting(tracker):
    measurement = "binary" if tracker in BOUNDARY_TRACKERS else "position"
    poor = dict(particles=50, battery_j=1e-9, sensing_nj=2.0, nodes=3)
    scenario = Scenario.named("PreDC-v0", tracker=tracker, measurement=measurement, **poor)
    world = World(scenario, threads=1)
    state = world.reset([1])
    everybody = Cluster(np.zeros(1, int), np.array([[0, 1, 2]]))
    for _ in range(100):
        state, outcome = world.step(state, everybody)
        assert_finite(state, outcome)
    assert outcome.alive[0] == 0 and state.network.head[0] == -1
    assert (outcome.energy_mj, outcome.members, outcome.dropped) == (0, 0, 4)
    assert View.of(state).nearest(5)[0].tolist() == [[-1] * 5]
    assert View.of(state).nearest_living().tolist() == [-1]


def test_one_node_alone():
    scenario = Scenario.named("PreDC-v0", nodes=1, particles=50)
    for policy in HAND_WRITTEN:
        world, state = World(scenario, threads=1), None
        state = world.reset([1])
        for _ in range(100):
            state, outcome = world.step(state, make_policy(policy, scenario).act(View.of(state)))
            assert_finite(state, outcome)
            assert outcome.members[0] <= 1


def test_time_beyond_the_horizon_stands_still():
    scenario = Scenario.named("PreDC-v0", nodes=20, particles=50, periods=3)
    *_, (_, cluster, state, outcome) = play(scenario, keys_of(0, 2), 0)
    after, later = World(scenario, threads=1).step(state, cluster)
    np.testing.assert_array_equal(later.target_m, outcome.target_m)
    assert_finite(after, later)


@law(60)
@given(scenarios(), SEEDS)
def test_a_view_survives_its_arrays(scenario, seed):
    """Observation "view" holds all that a policy can see."""
    policies = [make_policy(name, scenario) for name in HAND_WRITTEN]
    for _, _, state, _ in play(scenario, keys_of(seed, 2), seed):
        view = View.of(state)
        again = View.from_arrays(view.as_arrays())
        assert_same(view.as_arrays(), again.as_arrays())
        for policy in policies:
            assert_same(policy.act(view), policy.act(again))
