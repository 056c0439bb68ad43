"""Networks that have to last: drawn batteries, capped errors, lifetimes, what observations tell of energy and time."""

import json
import shutil
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from wsn_env import ClusterEnv, ClusterVectorEnv, Scenario, View, World, evaluate, make_policy, score
from wsn_env.agents import ppo
from wsn_env.agents.budget import PRICES, STEERINGS, Budget, find_price
from wsn_env.agents.tuned import tuned
from wsn_env.compiled import draws
from wsn_env.envs.actions import GROUP, MENU_ENTRIES, make_action
from wsn_env.envs.features import BELIEF_FEATURES, MOTION_FEATURES
from wsn_env.envs.observations import make_observation
from wsn_env.envs.prospects import ENTRY_FEATURES
from wsn_env.envs.scarcity import ENERGY_FEATURES, FAR_AHEAD, LEAST_SUPPLY
from wsn_env.evaluation.rollout import evaluation_seeds, rollout
from wsn_env.learning.priced_vector_env import PricedVectorEnv
from wsn_env.learning.replayable import ReplayableRows
from wsn_env.learning.sb3 import SB3VecEnv
from wsn_env.models.quantity import ScenarioError, parse_overrides
from wsn_env.reports.tables import LIFETIME, table_header
from wsn_env.scenario.tracks import CELLS, STATES, Tracks, neighbourhood_m, presence
from wsn_env.simulation.lifetime import METRICS, lifetimes

SMALL = dict(nodes=30, side_m=50.0, particles=60, periods=120)
POOR = Scenario.named("Lifetime-v0", **SMALL, filter_q=0.2, battery_j=(1e-5, 4e-4))


def test_batteries_are_drawn_for_each_episode_log_uniformly_and_by_its_key():
    world, keys = World(Scenario.named("Lifetime-v0", **SMALL | dict(nodes=2), battery_j=(0.0005, 0.004))), range(4000)
    state = world.reset(keys)
    assert ((state.residual_j == state.full_j[:, None]) & (View.of(state).battery == state.full_j[:, None])).all()
    share = np.log(state.full_j / 0.0005) / np.log(8.0)
    assert share.min() >= 0 and share.max() < 1
    assert abs(share.mean() - 0.5) < 4 * share.std() / len(keys) ** 0.5
    assert abs(share.std() - 12**-0.5) < 0.01
    assert (world.reset([7]).full_j == state.full_j[7]).all()
    fixed = World(Scenario.named("Lifetime-v0", **SMALL)).reset([7])
    assert (fixed.full_j == 0.002).all() and (fixed.track == World(POOR).reset([7]).track).all()


@pytest.mark.parametrize("battery_j", [(0.004, 0.0005), (0.0, 1.0), (1.0,), (1.0, 2.0, 3.0), ("a", 1), (0.1, np.nan)])
def test_a_pair_is_two_numbers_in_order(battery_j):
    with pytest.raises(ScenarioError, match=r"Radio.battery_j = .*: must be "):
        Scenario.named("PreDC-v0", battery_j=battery_j)


def test_a_pair_may_be_a_list_or_an_array_and_is_written_with_two_dots():
    pairs = [(1, 2), [1, 2], np.array([1, 2]), parse_overrides(["battery_j=1..2"])["battery_j"]]
    assert {Scenario.named("PreDC-v0", battery_j=pair).radio.battery_j for pair in pairs} == {(1.0, 2.0)}
    assert Scenario.named("PreDC-v0", battery_j=(1, 2)).radio.most_battery_j == 2.0
    assert parse_overrides(["lam=0.3..30", "name=a..b"]) == {"lam": (0.3, 30.0), "name": "a..b"}


def test_errors_count_as_at_most_the_cap():
    """In every reward and in returns; rms_m is of the errors as they are."""
    dead = Scenario.named("Lifetime-v0", **SMALL, battery_j=1e-9, error_cap_m=3.0, lam=2.0, search=False)
    policy, told = make_policy("nearest0", dead), {}
    for reward in ("error", "belief", "vector"):
        env = ClusterEnv(dead, reward=reward, action="cluster")
        env.reset(seed=evaluation_seeds(0, 1)[0])
        told[reward] = [env.step(as_action(env, policy.act(env.view), 0)) for _ in range(dead.periods)]
    infos = [step[-1] for step in told["error"]]
    errors = np.array([info["error_m"] for info in infos])
    counted = np.minimum(errors, 3.0)
    assert errors.max() > 10
    for step, vector, error in zip(told["error"], told["vector"], counted, strict=True):
        assert step[-1]["reward_error"] == pytest.approx(-error)
        assert step[1] == pytest.approx(-error - 2.0 * step[-1]["energy_mj"])
        assert vector[-1]["reward_error"] == -error and vector[1][0] == np.float32(-error)
    assert min(step[-1]["reward_error"] for step in told["belief"]) == pytest.approx(-3.0)
    (row,) = evaluate(["nearest0"], dead, [2.0], episodes=1).rows
    assert row["error_m"] == pytest.approx(counted.mean())
    assert row["rms_m"] == pytest.approx(np.sqrt((errors**2).mean())) == pytest.approx(infos[-1]["episode_rms_m"])
    keeps = [0] * dead.periods
    envs, menu = ClusterVectorEnv(1, dead), ClusterEnv(dead)
    menu.reset(seed=evaluation_seeds(0, 1)[0])
    assert score(lambda _: np.zeros(1, int), envs)[0] == pytest.approx(sum(menu.step(entry)[1] for entry in keeps))


def test_lifetimes_are_those_of_plain_numpy():
    world, policy = World(POOR), make_policy("nearest3", POOR)
    state = world.reset(range(12))
    errors, living = [], []
    for _ in range(POOR.periods):
        state, outcome = world.step(state, policy.act(View.of(state)), donate=True)
        errors.append(outcome.error_m.copy())
        living.append(outcome.alive.copy())
    errors, living = np.minimum(errors, 20.0), np.array(living)
    means = np.stack([errors[k - 50 : k].mean(axis=0) for k in range(50, 121)])
    expected = {
        "first_death": first(living < 30, 1),
        "half_dead": first(2 * living <= 30, 1),
        "functional": first(means > POOR.radius_m, 50),
        "tracked": (errors <= POOR.radius_m).mean(axis=0),
        "stranded_mj": 1e3 * state.residual_j.sum(axis=1),
        "stranded_sd": (state.residual_j / state.full_j[:, None]).std(axis=1),
    }
    found = lifetimes(state, POOR.periods)
    assert tuple(found) == METRICS
    for name, values in expected.items():
        np.testing.assert_allclose(found[name], values, rtol=1e-12, err_msg=name)
    assert (expected["first_death"] < 120).any() and (expected["functional"] < 120).any()
    assert (expected["functional"] == 120).any()


def first(happened, from_period):
    """Period in which it happens for the first time, else the horizon."""
    return np.where(happened.any(axis=0), happened.argmax(axis=0) + from_period, POOR.periods)


def test_infos_of_single_and_batch_and_rows_of_evaluations_agree():
    seeds = evaluation_seeds(0, 3)
    rows = evaluate(["nearest2"], POOR, episodes=3).rows
    policy = make_policy("nearest2", POOR)
    single = ClusterEnv(POOR, action="cluster")
    single.reset(seed=seeds[1])
    envs = ClusterVectorEnv(3, POOR, action="cluster")
    envs.reset(seed=seeds)
    for _ in range(POOR.periods):
        info = single.step(as_action(single, policy.act(single.view), 0))[-1]
        cluster = policy.act(envs.view)
        infos = envs.step([as_action(single, cluster, i) for i in range(3)])[-1]
    for name in METRICS:
        assert [row[name] for row in rows] == infos[name].tolist()
        assert info[name] == rows[1][name]


def as_action(env, cluster, row):
    chosen = np.zeros(env.scenario.field.nodes, np.int8)
    chosen[cluster.members[row][cluster.members[row] >= 0]] = 1
    return {"head": max(int(cluster.head[row]), 0), "members": chosen}  # -1: nobody is alive


@pytest.fixture(scope="module")
def halfway():
    world, policy = World(POOR), make_policy("nearest3", POOR)
    state = world.reset(range(20))
    for _ in range(40):
        state, _ = world.step(state, policy.act(View.of(state)), donate=True)
    return View.of(state)


def test_what_observations_tell_of_energy_is_what_plain_numpy_finds(halfway):
    view, first = halfway, len(BELIEF_FEATURES | MOTION_FEATURES)
    for name in ("menu", "candidates"):
        told = make_observation(name, POOR, "nearest", 12).encode(view)[:, first : first + len(ENERGY_FEATURES)]
        told = dict(zip(ENERGY_FEATURES, told.T))
        left, full = view.battery.sum(axis=1), view.full_j
        np.testing.assert_allclose(told["time_left"], 80 / 120, rtol=1e-6)
        supply = np.maximum(1e3 * left / (POOR.typical_energy_mj * 80), 1e-6)
        np.testing.assert_allclose(told["supply"], 0.25 * np.log(supply), rtol=1e-4, atol=1e-5)
        np.testing.assert_allclose(told["energy_left"], left / (30 * full), rtol=1e-5, atol=1e-6)
        ahead = FAR_AHEAD * POOR.period_s
        for feature, periods in (("supply_near", 0.0), ("supply_ahead", ahead)):
            points = view.predicted_mean[:, ::2] + periods * view.predicted_mean[:, 1::2]
            expected = [0.25 * np.log(supply_at(view, b, points[b])) for b in range(20)]
            np.testing.assert_allclose(told[feature], expected, rtol=1e-4, atol=1e-5)


def supply_at(view, b, point):
    """Energy about a point, over what a typical schedule spends while the target is about there in the time left."""
    reach = neighbourhood_m(POOR)
    squared = ((view.positions[b] - point) ** 2).sum(axis=1)
    energy_mj = 1e3 * (view.battery[b] * np.maximum(1 - squared / reach**2, 0)).sum()
    cell = np.clip((point / POOR.field.side_m * CELLS).astype(int), 0, CELLS - 1)
    spent_mj = presence(POOR)[tuple(cell)] * POOR.typical_energy_mj * (POOR.periods - view.period[b])
    return max(energy_mj / spent_mj, LEAST_SUPPLY)


def test_the_map_of_presence_is_that_of_other_tracks():
    """Of 4,000 fresh ones, within five standard errors; the middle of the field is where waypoints lead to most."""
    found, reach, rows = presence(POOR), neighbourhood_m(POOR), 4000
    tracks = np.empty((rows, POOR.periods + 1, 4))
    keys = np.array([draws.key_of_seed(i) for i in range(rows)], np.uint64)
    Tracks(POOR).draw(np.ones(rows, bool), keys, tracks, 1)
    middles = (np.arange(CELLS) + 0.5) * POOR.field.side_m / CELLS
    for cell in ((0, 0), (5, 12), (12, 12), (23, 7)):
        squared = (tracks[..., 0] - middles[cell[0]]) ** 2 + (tracks[..., 2] - middles[cell[1]]) ** 2
        shares = np.maximum(1 - squared / reach**2, 0).mean(axis=1)
        error = shares.std() / np.sqrt(min(rows, STATES // POOR.periods)) * 1.5
        assert found[cell] == pytest.approx(shares.mean(), abs=5 * error + 0.02 * shares.mean()), cell  # cells are wide
    assert found[12, 12] > 4 * found[0, 0]


def test_entries_of_the_menu_tell_the_energy_of_head_and_poorest(halfway):
    view, menu = halfway, make_action("menu", POOR, "nearest", 12)
    observation = make_observation("menu", POOR, "nearest", 12)
    entries = observation.encode(view)[:, observation.belief :].reshape(20, MENU_ENTRIES, -1)
    shares, masks = view.battery / view.full_j[:, None], menu.masks(view)
    for entry in range(1, MENU_ENTRIES):
        heads, members = menu.cluster(np.full(20, entry), view)
        for b in np.flatnonzero(masks[:, entry]):
            head = view.head[b] if heads[b] == -1 else heads[b]
            nodes = [head, *members[b][members[b] >= 0]]
            told = entries[b, entry, len(ENTRY_FEATURES) :]
            assert told == pytest.approx([shares[b, head], shares[b, nodes].min()], abs=1e-6), (entry, b)
    assert masks[:, 1 + GROUP :].any()


def test_where_energy_is_not_scarce_observations_are_as_ever():
    scenario = POOR.override(scarce_energy=False)
    view = View.of(World(scenario).reset([draws.key_of_seed(3)]))
    more, less = (make_observation("menu", each, "nearest", 12).encode(view)[0] for each in (POOR, scenario))
    belief = len(BELIEF_FEATURES | MOTION_FEATURES)
    assert (more[:belief] == less[:belief]).all()
    entries = more[belief + len(ENERGY_FEATURES) :].reshape(MENU_ENTRIES, -1)[:, : len(ENTRY_FEATURES)]
    assert (entries == less[belief:].reshape(MENU_ENTRIES, -1)).all()


@pytest.mark.parametrize("scarce", [True, False])  # whether observations tell of it does not matter
def test_a_budgets_price_is_its_formula(scarce, halfway):
    budget = Budget(POOR.override(scarce_energy=scarce), price=5.0, steering=0.7)
    price = [5.0 * supply_at(halfway, b, halfway.predicted_mean[b, ::2]) ** -0.7 for b in range(20)]
    np.testing.assert_allclose(budget.prices(halfway), np.clip(price, 1e-3, 1e3), rtol=1e-9)
    assert max(price) > 2 * min(price)


def test_rows_for_training_are_rewarded_and_told_at_the_price_of_their_supply():
    """The price of a period is what the observation before it told, and what budget finds at the drawn lam."""
    drawn = POOR.override(lam=(2, 50))
    envs = PricedVectorEnv(6, drawn, observation="menu", autoreset_mode="Disabled", steering=0.8)
    plain = ClusterVectorEnv(6, drawn, observation="menu", autoreset_mode="Disabled")
    observation, _ = envs.reset(seed=3)
    plain.reset(seed=3)
    prices, generator = plain.lam.copy(), np.random.default_rng(0)
    for _ in range(2 * POOR.periods):
        lam = envs.lam.copy()
        expected = [Budget(POOR, price=prices[b], steering=0.8).prices(envs.view)[b] for b in range(6)]
        np.testing.assert_allclose(lam, expected, rtol=1e-12)
        np.testing.assert_allclose(observation[:, 0], np.clip(0.5 * np.log(np.maximum(lam, 1e-3)), -10, 10), rtol=1e-5)
        actions = generator.integers(0, MENU_ENTRIES, 6)
        observation, reward, _, ended, info = envs.step(actions)
        plain.step(actions)
        np.testing.assert_allclose(reward, -(drawn.counted_m(info["error_m"]) + lam * info["energy_mj"]), rtol=1e-9)
        if ended.any():
            observation, _ = envs.reset(options={"reset_mask": ended})
            plain.reset(options={"reset_mask": ended})
            prices = np.where(ended, plain.lam, prices)
    with pytest.raises(ValueError, match="scarce_energy = False of PreDC-v0: must be True"):
        PricedVectorEnv(2, "PreDC-v0")
    with pytest.raises(ValueError, match="Scenario.lam = 0.0: must be a finite number above 0"):
        PricedVectorEnv(2, POOR)


@pytest.mark.parametrize("rule", ["greedy", "adaptive", "ppo:of=PreDC-v0"])
def test_a_budgets_choice_is_that_of_its_rule_at_its_price(rule, halfway):
    """Whatever the row's own lam is; the view is as it was."""
    before, prices = halfway.lam.copy(), []
    for price in (0.5, 50.0):
        budget = Budget(POOR, rule=rule, price=price, steering=0.0)
        assert budget.prices(halfway) == pytest.approx(np.full(20, price))
        fixed = make_policy(rule, POOR).act(halfway.at_lam(np.full(20, price)))
        assert all((ours == theirs).all() for ours, theirs in zip(budget.act(halfway), fixed))
        prices.append((fixed.members >= 0).sum())
    assert prices[0] > prices[1] and (halfway.lam == before).all()


def test_a_table_of_another_scenario_serves_until_there_is_one(monkeypatch):
    own, other = {"greedy": [[1.0, 1.0, 1.0]]}, {"greedy": [[2.0, 2.0, 2.0]]}
    for table in ({"PreDC-v0": other}, {"PreDC-v0": other, "Lifetime-v0": own}):
        monkeypatch.setattr("wsn_env.agents.tuned._load_table", lambda table=table: table)
        assert tuned(POOR, "greedy") == table.get("Lifetime-v0", other)["greedy"]


def test_tables_tell_of_lifetimes_where_nodes_die():
    dying, lasting = (
        evaluate(["nearest1", "nearest2"], each, episodes=2) for each in (POOR, POOR.override(battery_j=1))
    )
    assert table_header(dying, "nearest1")[-len(LIFETIME) :] == list(LIFETIME)
    assert not set(LIFETIME) & set(table_header(lasting, "nearest1"))


def test_a_training_at_a_price_goes_on_where_it_was_stopped():
    """Rows that are played again are told the same prices, to the bit."""
    drawn, actions = POOR.override(lam=(2, 50)), np.random.default_rng(1).integers(0, MENU_ENTRIES, (170, 4))

    def rows():
        envs = PricedVectorEnv(4, drawn, observation="menu", autoreset_mode="Disabled")
        made = ReplayableRows(SB3VecEnv(envs, stagger=True))
        made.seed(5)
        return made

    going, again = rows(), rows()
    going.reset()
    for each in actions:
        observation = going.step(each)[0]
    replayed = again.replay(going.episodes, going.episode_lengths, going.recent_actions(), len(actions))
    assert (replayed == observation).all()
    for each in actions[:20]:
        one, other = going.step(each), again.step(each)
        assert (one[0] == other[0]).all() and (one[1] == other[1]).all()


def test_a_policy_with_a_price_of_its_own_acts_at_it_where_lam_is_0(halfway, tmp_path):
    shipped = Path(ppo.PRETRAINED) / "PreDC-v0"
    said = json.loads((shipped / "policy.json").read_text())
    shutil.copy(shipped / "policy.safetensors", tmp_path)
    path = tmp_path / "policy.json"

    def act(price, lam):
        path.write_text(json.dumps(said | ({} if price is None else {"price": price})))
        return make_policy(str(path), POOR).act(halfway.at_lam(lam))

    def same(one, other):
        return (one.head == other.head).all() and (one.members == other.members).all()

    none, dear = np.zeros(20), np.full(20, 30.0)
    budget = Budget(POOR, rule="ppo:of=PreDC-v0", price=9.0, steering=0.8)
    assert same(act([9.0, 0.8], none), budget.act(halfway))
    assert same(act([9.0, 0.8], dear), act(None, dear)) and not same(act([9.0, 0.8], dear), budget.act(halfway))
    half = np.where(np.arange(20) < 10, 0.0, 30.0)
    assert same(act([9.0, 0.8], half), act(None, np.where(half == 0.0, budget.prices(halfway), half)))
    told = []
    for price in (None, [9.0, 0.8], [9.0, 0.7]):
        act(price, none)
        told.append(repr(make_policy(str(path), POOR)))
    assert len(set(told)) == 3  # kept blocks of one are not the other's
    for wrong in ([1.0], [0.0, 1.0], ["a", 1.0], 5, [1.0, -1.0]):
        with pytest.raises(ValueError, match="policy.json is not a saved policy: price"):
            act(wrong, none)


def test_find_price_takes_the_best_of_what_it_tries():
    seeds, world = range(6), World(POOR)
    found = find_price("greedy", POOR, seeds, lambda *_: None)
    errors = {
        pair: np.mean([np.log(row["error_m"]) for row in rollout(Budget(POOR, "greedy", *pair), world, seeds)])
        for pair in product(PRICES, STEERINGS)
    }
    assert errors[found] == min(errors.values()) < np.mean(list(errors.values()))
