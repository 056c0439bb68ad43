"""Several targets in one field: the bits with one, shared nodes and batteries, and the faces of the environment."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import wsn_env
from wsn_env import ClusterVectorEnv, MultiEnv, MultiVectorEnv, Scenario, ScenarioError, View, World, make_policy
from wsn_env.compiled import draws
from wsn_env.envs.scarcity import energy_prices
from wsn_env.evaluation.comparison import evaluate
from wsn_env.models.state import Cluster

SMALL = dict(particles=200, periods=30)
POOR = SMALL | dict(battery_j=0.0003, nodes=100)  # nodes die in dozens
UNNAMED = POOR | dict(association="unknown", clutter=0.5, resolution_m=2.0, motion="meeting")
MODEM = dict(radio="modem", hop_m=200.0, **SMALL)


def play(world: World, policy: str, fields: int, seed: int = 0):
    """State and outcome after every period."""
    targets, chooser = world.scenario.targets, make_policy(policy, world.scenario)
    keys = np.repeat([draws.key_of_seed(seed + i) for i in range(fields)], targets)
    state = world.reset(keys)
    for _ in range(world.scenario.periods):
        state, outcome = world.step(state, chooser.act(View.of(state)), donate=True)
        yield state, outcome


@pytest.mark.parametrize("observation", ["candidates", "menu", "dict", "view"])
@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_one_target_is_the_single_targets_environment_to_the_bit(observation, mode):
    settings = SMALL | dict(observation=observation, autoreset_mode=mode)
    one, several = ClusterVectorEnv(3, **settings), MultiVectorEnv(3, targets=1, **settings)
    left, right = one.reset(seed=7), several.reset(seed=7)
    one.action_space.seed(0)
    for _ in range(SMALL["periods"] + (0 if mode == "Disabled" else 3)):
        same_but_for_an_axis(left[0], right[0])
        actions = one.action_space.sample()
        left, right = one.step(actions), several.step(actions[:, None])
        for mine, other in zip(left[1:4], right[1:4], strict=True):
            assert (mine == other).all()
        for name, value in left[4].items():
            if not name.startswith(("_", "final")):
                assert (value.reshape(3, -1) == right[4][name].reshape(3, -1)).all(), name


def same_but_for_an_axis(left, right):
    if isinstance(left, dict):
        for name, value in left.items():
            same_but_for_an_axis(value, right[name])
    else:
        assert (left == right[:, 0]).all()


@pytest.mark.parametrize("targets", [2, 3, 5])
def test_the_first_of_several_is_the_single_target_where_energy_lasts(targets):
    """Fields, tracks, detections and noises are its own; another target changes nothing but batteries."""
    alone = list(play(World(Scenario.named("PreDC-v0", **SMALL)), "nearest2", 3))
    world = World(Scenario.named("PreDC-v0", targets=targets, **SMALL))
    for (_, outcome), (_, joint) in zip(alone, play(world, "nearest2", 3), strict=True):
        for name in ("error_m", "energy_mj", "estimate_m", "target_m", "delivered"):
            assert (outcome.row[name] == joint.row[name][::targets]).all()


@pytest.mark.parametrize("targets", [1, 2, 3, 4, 5])
@pytest.mark.parametrize(
    "settings", [SMALL, POOR, MODEM, SMALL | dict(sensing_nj=2000.0), UNNAMED], ids=lambda s: str(len(s))
)
def test_nodes_and_batteries_are_shared(targets, settings):
    """What all targets' periods cost is what the batteries have lost, at any moment; the dead serve nobody."""
    scenario = Scenario.named("PreDC-v0", targets=targets, **settings)
    spent = 0.0
    for state, outcome in play(World(scenario), "nearest3", 4):
        spent = spent + outcome.row["energy_mj"].reshape(-1, targets).sum(axis=1)
        lost = 1e3 * (state.full_j[:, None] - state.residual_j).sum(axis=1)
        assert lost[::targets] == pytest.approx(spent, rel=1e-9)
        for name in ("positions", "battery"):
            shared = getattr(state.network, name).reshape(4, targets, -1)
            assert (shared == shared[:, :1]).all()
        assert (state.residual_j.reshape(4, targets, -1) == state.residual_j[::targets, None]).all()
        assert (state.living == (state.residual_j > 0).sum(axis=1)).all() and (outcome.alive == state.living).all()
        for name in ("first_death", "half_dead"):
            died = state.life[name].reshape(-1, targets)
            assert (died == died[:, :1]).all()
        view = View(state.knowledge)
        assert (view.network.row["alive"] == view.alive.sum(axis=1)).all()
        assert view.network.row["left_j"] == pytest.approx(view.battery.sum(axis=1), rel=1e-6, abs=1e-9)
        assert not (view.member & (state.residual_j <= 0)).any()
    assert "battery_j" not in settings or (state.living < 100).all()


def test_a_node_in_two_clusters_senses_once_and_reports_to_both():
    """Two targets, the same cluster for both: the sensing is paid once, all else as often as it is done."""
    settings = SMALL | dict(search=False, sensing_nj=1e5)
    seeds = dict(keys=np.repeat([draws.key_of_seed(0)], 2))
    world = World(Scenario.named("PreDC-v0", targets=2, **settings))
    state = world.reset(**seeds)
    nodes = np.array([[0, 1, 2], [1, 2, 3]], np.int32)
    _, outcome = world.step(state, Cluster(nodes[:, 0].astype(np.int64), nodes))
    sensing_mj = 1e3 * outcome.row["energy_j"][:, 0]
    assert sensing_mj == pytest.approx([0.3, 0.1])  # 1 and 2 are awake already
    assert (outcome.row["members"] == 3).all()


def test_it_senses_once_also_where_a_head_dies():
    """The first target's cluster ends with its head; compiled and other filters follow one order."""
    nodes, ended = np.array([[0, 1, 2], [3, 1, 2]], np.int32), []
    for battery_j in np.linspace(1e-4, 4e-4, 16):
        sensing_j = []
        for tracker in ("particle", "ekf"):
            settings = SMALL | dict(search=False, sensing_nj=1e5, tracker=tracker)
            world = World(Scenario.named("PreDC-v0", targets=2, **settings))
            state = world.reset(np.repeat([draws.key_of_seed(0)], 2))
            state.residual_j[:, 0] = state.network.battery[:, 0] = battery_j
            state, outcome = world.step(state, Cluster(nodes[:, 0].astype(np.int64), nodes))
            sensing_j.append(outcome.row["energy_j"][:, 0].tolist())
            ended.append(state.network.row["head"][0] < 0)
            assert outcome.row["energy_j"][:, 0].sum() <= 4e-4 + 1e-12
        assert sensing_j[0] == sensing_j[1]
    assert any(ended) and not all(ended)


def test_a_search_wakes_who_is_asleep_for_all_targets():
    """Two searches at once: two calls, but each node pays once for being awake."""
    settings = SMALL | dict(start="search", nodes=50, sensing_nj=1e5)
    world = World(Scenario.named("PreDC-v0", targets=2, **settings))
    state = world.allocate(2)
    _, outcome = world.restart(state, [True] * 2, np.repeat([draws.key_of_seed(0)], 2), donate=True)
    search_mj = 1e3 * outcome.row["energy_j"][:, -1]
    assert outcome.row["searched"].all() and search_mj[0] - search_mj[1] == pytest.approx(50 * 0.1, rel=0.02)


@pytest.mark.parametrize("policy", ["nearest2", "greedy", "adaptive", "pre_dc", "ppo"])
def test_a_field_does_not_depend_on_the_batch_or_on_threads(policy):
    scenario = Scenario.named("PreDC-v0", targets=3, **POOR)
    *_, (whole, _) = play(World(scenario, threads=2), policy, 7)
    for fields, threads in ((7, 1), (3, 2), (1, 1)):
        *_, (part, _) = play(World(scenario, threads=threads), policy, fields)
        assert (part.belief.mean == whole.belief.mean[: 3 * fields]).all()
        assert (part.residual_j == whole.residual_j[: 3 * fields]).all()


def test_a_copy_goes_on_as_the_original():
    world = World(Scenario.named("PreDC-v0", targets=3, **POOR))
    policy = make_policy("nearest3", world.scenario)
    state = world.reset(np.repeat([draws.key_of_seed(5)], 3))
    for _ in range(10):
        state, _ = world.step(state, policy.act(View.of(state)))
    ends = []
    for start in (state, state.copy()):
        own = start
        for _ in range(10):
            own, _ = world.step(own, policy.act(View.of(own)))
        ends.append(own)
    assert (ends[0].residual_j == ends[1].residual_j).all() and (ends[0].belief.mean == ends[1].belief.mean).all()


def test_the_evaluation_is_of_what_the_environment_gives():
    scenario = Scenario.named("PreDC-v0", targets=3, lam=4.0, **SMALL)
    evaluation = evaluate(["nearest2"], scenario, episodes=4)
    policy = make_policy("nearest2", scenario)
    for row in evaluation.rows:
        env = MultiEnv("PreDC-v0", targets=3, lam=4.0, **SMALL)
        env.reset(seed=int(row["seed"]))
        total, ended = 0.0, False
        while not ended:
            _, reward, _, ended, info = env.step(policy.act(env.view))
            total += reward
        assert float(row["return"]) == pytest.approx(total, rel=1e-12)
        assert float(row["rms_m"]) == pytest.approx(np.sqrt((info["episode_rms_m"] ** 2).mean()), rel=1e-12)
        assert float(row["energy_mj"]) * SMALL["periods"] == pytest.approx(info["episode_energy_mj"], rel=1e-12)
        assert float(row["reference_m"]) == pytest.approx(np.sqrt((info["episode_reference_m"] ** 2).mean()), rel=1e-12)


def test_greedy_choices_share_nodes_that_cost_energy_while_awake():
    """Of targets that meet: together they are better than each alone, paired; where being awake is free, the same."""
    together, alone = "greedy", "greedy:jointly=false"
    for sensing_nj in (0.0, 100_000.0):
        scenario = Scenario.named("PreDC-v0", targets=3, motion="meeting", sensing_nj=sensing_nj, particles=200)
        found = evaluate([together, alone], scenario, 4.0, 60, seed=3)
        ahead = found.values(together, 4.0, "return") - found.values(alone, 4.0, "return")
        if sensing_nj == 0.0:
            assert (ahead == 0).all()
        else:
            assert ahead.mean() > 2 * ahead.std() / np.sqrt(len(ahead))
            saved = found.values(alone, 4.0, "energy_mj") - found.values(together, 4.0, "energy_mj")
            assert saved.mean() > 2 * saved.std() / np.sqrt(len(saved))


def test_scarce_energy_is_that_of_all_targets():
    """With three targets what is left is a third as long a supply."""
    supply = []
    for targets in (1, 3):
        world = World(Scenario.named("Lifetime-v0", targets=targets, **SMALL))
        state = world.reset(np.repeat([draws.key_of_seed(4)], targets))
        supply.append(energy_prices(View.of(state), world.scenario, 1.0, -1.0)[0])
    assert supply[0] == pytest.approx(3 * supply[1])


def named_columns(env, observation, prefix):
    """The columns whose names begin so, by name."""
    names = list(env.rows.interface.observation.features)
    return {name: observation[..., k] for k, name in enumerate(names) if name.startswith(prefix)}


def test_observations_tell_of_other_targets():
    """Against positions and clusters as they are; one target is told of none, and all else as without."""
    settings = SMALL | dict(observation="menu", motion="meeting", autoreset_mode="Disabled")
    envs = MultiVectorEnv(4, targets=3, tells_others=True, **settings)
    plain = MultiVectorEnv(4, targets=3, **settings)
    seen, without = envs.reset(seed=2)[0], plain.reset(seed=2)[0]
    radius_m, shared = envs.scenario.radius_m, 0
    for step in range(SMALL["periods"]):
        view = envs.view
        places, members = view.prediction.reshape(4, 3, 2) / radius_m, view.member.reshape(4, 3, -1)
        apart = np.linalg.norm(places[:, :, None] - places[:, None], axis=-1)
        about = np.exp(-0.5 * apart**2).sum(axis=2) - 1
        told = named_columns(envs, seen, "other")
        assert told["others_near"] == pytest.approx(about, abs=1e-5)
        nearest = np.where(np.eye(3, dtype=bool), np.inf, apart).min(axis=2)
        distance = np.hypot(told["other_ahead"], told["other_left"])
        assert distance[nearest < 10] == pytest.approx(nearest[nearest < 10], rel=1e-4)
        standing = named_columns(envs, seen, "shared[0]")["shared[0]"]
        both = [[(members[i, t] & members[i, [t - 1, t - 2]].any(axis=0)).sum() for t in range(3)] for i in range(4)]
        assert 4 * standing == pytest.approx(np.array(both))
        shared += np.sum(both)
        names = list(envs.rows.interface.observation.features)
        kept = [not name.startswith(("other", "shared")) for name in names]
        assert (seen[..., kept] == without).all()
        actions = np.full((4, 3), 10 + step % 9)
        seen, without = envs.step(actions)[0], plain.step(actions)[0]
    assert shared > 50
    alone = MultiVectorEnv(3, targets=1, tells_others=True, observation="menu", **SMALL)
    seen = alone.reset(seed=0)[0]
    for prefix in ("other", "shared"):
        assert all((column == 0).all() for column in named_columns(alone, seen, prefix).values())


def test_a_network_is_shown_what_it_was_trained_with():
    """The pretrained one knows nothing of others, wherever it plays."""
    choices = []
    for tells_others in (False, True):
        scenario = Scenario.named("PreDC-v0", targets=3, tells_others=tells_others, **SMALL)
        *_, (state, _) = play(World(scenario), "ppo", 3)
        choices.append(state.belief.mean)
    assert (choices[0] == choices[1]).all()


# --- faces --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("action", ["menu", "subset", "radius", "scores", "nodes", "cluster"])
@pytest.mark.parametrize("observation", ["candidates", "menu", "dict", "view"])
def test_gymnasiums_checker(action, observation):
    env = gym.make("wsn_env/Multi-v0", targets=2, action=action, observation=observation, nodes=30, **SMALL)
    assert env.spec.max_episode_steps == SMALL["periods"]
    check_env(env.unwrapped, skip_render_check=True)


def test_spaces_have_an_axis_of_targets():
    env = gym.make("wsn_env/Multi-v0", targets=4)
    assert env.action_space == gym.spaces.MultiDiscrete([28] * 4)
    assert env.observation_space.shape == (4, 157) and gym.make("wsn_env/Multi-v0").unwrapped.targets == 3
    envs = gym.make_vec("wsn_env/Multi-v0", 5, vectorization_mode="vector_entry_point", targets=2, **SMALL)
    assert envs.observation_space.shape == (5, 2, 157) and envs.action_space.shape == (5, 2)
    envs.reset(seed=3)
    *_, info = envs.step(envs.action_space.sample())
    assert info["error_m"].shape == (5, 2) and info["energy_mj"].shape == (5,) and info["target_m"].shape == (5, 2, 2)
    assert envs.unwrapped.action_masks().shape == (5, 2, 28)


def test_targets_are_those_of_a_scenario_unless_told():
    five = Scenario.named("PreDC-v0", targets=5)
    assert gym.make("wsn_env/Multi-v0", scenario=five).unwrapped.targets == 5
    assert gym.make("wsn_env/Multi-v0", scenario=five, targets=2).unwrapped.targets == 2
    assert MultiEnv(Scenario.named("PreDC-v0")).targets == 1 and MultiEnv("Rssi-v0").targets == 3


def test_generators_and_seeds_are_those_that_draw():
    env = MultiEnv(targets=2, **SMALL)
    env.reset()
    again = MultiEnv(targets=2, **SMALL)
    again.reset(seed=env.np_random_seed)
    assert (env.view.positions == again.view.positions).all() and env.np_random is env.fields.np_random[0]
    for each in (env, again):
        each.np_random = np.random.Generator(np.random.PCG64(3))
        each.reset()
    assert (env.view.positions == again.view.positions).all()
    envs = MultiVectorEnv(3, targets=2, **SMALL)
    seen = envs.reset(seed=5)[0]
    assert (envs.rows.reset(seed=5)[0].reshape(seen.shape) == seen).all() and envs.np_random_seed == (5, 6, 7)


def test_fields_are_reset_as_a_whole():
    envs = MultiVectorEnv(3, targets=2, autoreset_mode="Disabled", **SMALL)
    envs.reset(seed=0)
    before = envs.view.positions
    envs.reset(options={"reset_mask": np.array([False, True, False])})
    changed = (envs.view.positions != before).any(axis=(1, 2))
    assert changed.tolist() == [False, False, True, True, False, False]
    for mask in (np.array([True, False]), [True, False, False], np.array([[True], [False], [False]])):
        with pytest.raises(ValueError, match=r"NumPy bool array of shape \(3,\)"):
            envs.reset(options={"reset_mask": mask})
    with pytest.raises(ValueError, match="must mark all 2 rows of a field, or none"):
        envs.rows.reset(options={"reset_mask": np.array([True] + [False] * 5)})


def test_single_and_batch_are_the_same_fields():
    envs = MultiVectorEnv(3, targets=2, autoreset_mode="Disabled", **SMALL)
    seen = envs.reset(seed=11)[0]
    singles = [MultiEnv(targets=2, **SMALL) for _ in range(3)]
    for i, env in enumerate(singles):
        assert (env.reset(seed=11 + i)[0] == seen[i]).all()
    for _ in range(SMALL["periods"]):
        actions = envs.action_space.sample()
        seen, rewards, _, truncated, infos = envs.step(actions)
        for i, env in enumerate(singles):
            own, reward, _, ended, info = env.step(actions[i])
            assert (own == seen[i]).all() and reward == rewards[i] and ended == truncated[i]
    assert info["episode_energy_mj"] == infos["episode_energy_mj"][2]
    with pytest.raises(gym.error.ResetNeeded):
        singles[0].step(actions[0])


def test_what_is_made_for_one_target_says_so():
    with pytest.raises(ScenarioError, match="targets = 2: must be 1 for ClusterEnv; several"):
        gym.make("wsn_env/PreDC-v0", targets=2)
    with pytest.raises(ScenarioError, match="targets = 2: must be 1 for ClusterVectorEnv; several"):
        ClusterVectorEnv(4, targets=2)
    for settings in (
        dict(scenario="Binary-v0"),
        dict(scenario="Ble-v0"),
        dict(faults="stuck"),
        dict(ends_outside=True),
    ):
        with pytest.raises(ScenarioError, match="targets = 2: must be 1 with"):
            MultiEnv(targets=2, **settings)
    with pytest.raises(ValueError, match="'vector': must be"):
        MultiEnv(targets=2, reward="vector")
    with pytest.raises(TypeError, match=r"MultiVectorEnv\(\) got an unexpected keyword argument 'target'"):
        MultiEnv(target=2)
    with pytest.raises(ValueError, match=r"shape \(2, 3\): must be \(2, 2, ...\)"):
        envs = MultiVectorEnv(2, targets=2, **SMALL)
        envs.reset(seed=0)
        envs.step(np.zeros((2, 3), int))
    with pytest.raises(TypeError, match="MultiEnv.. got an unexpected keyword argument 'threads'"):
        MultiEnv(threads=1)
    envs = MultiVectorEnv(2, targets=2, autoreset_mode="SameStep", **SMALL)
    for wrong, words in (
        (lambda: wsn_env.score(lambda seen: seen, envs), "MultiVectorEnv: must be"),
        (lambda: wsn_env.score(lambda seen: seen, envs.rows), "must be 1 for score"),
        (lambda: wsn_env.error_bound("nearest2", Scenario.named("PreDC-v0", targets=2)), "must be 1 for a bound"),
        (lambda: wsn_env.plot_episode("nearest2", Scenario.named("PreDC-v0", targets=2)), "must be 1 for plot_episode"),
        (lambda: wsn_env.register("Mine-v0", targets=2), "must be 1 for ClusterEnv"),
    ):
        with pytest.raises(ValueError, match=words):
            wrong()
    world = World(Scenario.named("PreDC-v0", targets=3, **SMALL))
    with pytest.raises(ValueError, match="multiple of targets = 3"):
        world.allocate(4)
    with pytest.raises(ValueError, match="same in the 3 rows of a field"):
        world.reset([1, 2, 3])


# --- PettingZoo ---------------------------------------------------------------------------------------------

PARALLEL = (
    dict(targets=3),
    dict(targets=2, rewards="own", observation="menu"),
    dict(targets=2, agents="candidates"),
    dict(targets=1, action="subset"),
)


@pytest.mark.parametrize("settings", PARALLEL, ids=str)
def test_pettingzoos_own_tests(settings):
    test = pytest.importorskip("pettingzoo.test")
    from pettingzoo.utils import parallel_to_aec

    def make():
        return wsn_env.parallel_env("Multi-v0", **settings, **SMALL)

    test.parallel_api_test(make(), num_cycles=40)
    test.parallel_seed_test(make)
    test.api_test(parallel_to_aec(make()), num_cycles=40)
    test.seed_test(lambda: parallel_to_aec(make()))


def test_agents_have_their_targets_part_of_the_joint_environment():
    pytest.importorskip("pettingzoo")
    joint = MultiEnv(targets=3, **SMALL)
    shared, own = (wsn_env.parallel_env(targets=3, rewards=each, **SMALL) for each in ("shared", "own"))
    seen = joint.reset(seed=2)[0]
    for env in (shared, own):
        assert all((value == seen[k]).all() for k, value in enumerate(env.reset(seed=2)[0].values()))
    for _ in range(SMALL["periods"]):
        actions = joint.action_space.sample()
        seen, reward, _, ended, info = joint.step(actions)
        for env, per_target in ((shared, False), (own, True)):
            told, rewards, _, ends, infos = env.step({f"target_{k}": action for k, action in enumerate(actions)})
            assert all((told[f"target_{k}"] == seen[k]).all() for k in range(3))
            assert sum(rewards.values()) == pytest.approx(reward if per_target else 3 * reward)
            assert infos["target_1"]["error_m"] == info["error_m"][1] and set(ends.values()) == {ended}
    assert shared.agents == []


def test_an_agent_for_each_candidate_wakes_by_offering():
    """All sleep but two; the higher offer leads."""
    pytest.importorskip("pettingzoo")
    env = wsn_env.parallel_env(targets=2, agents="candidates", **SMALL)
    seen, _ = env.reset(seed=0)
    assert len(env.agents) == 24 and seen["target_0/node_3"].shape == (25 + 11,)
    actions = dict.fromkeys(env.agents, 0) | {"target_0/node_1": 1, "target_0/node_4": 3, "target_1/node_0": 2}
    nodes = env.env.view.nearest(12)[0]
    *_, infos = env.step(actions)
    view = env.env.view
    assert view.head.tolist() == [nodes[0, 4], nodes[1, 0]]
    assert np.flatnonzero(view.member[0]).tolist() == sorted([nodes[0, 1], nodes[0, 4]])
    assert infos["target_0/node_0"]["members"] == 2 and infos["target_1/node_7"]["members"] == 1
    for wrong in (-1, 4, 1.7):
        with pytest.raises(ValueError, match="must be 0, 1, 2 or 3"):
            env.step(dict.fromkeys(env.agents, 0) | {"target_0/node_0": wrong})
    with pytest.raises(ValueError, match="target_1/node_11 must have one"):
        env.step({agent: 0 for agent in env.agents[:-1]})
    with pytest.raises(ValueError, match="agents = 'nodes': allowed are 'targets' and 'candidates'"):
        wsn_env.parallel_env(agents="nodes")
    with pytest.raises(ValueError, match="action = 'menu': must be 'scores' with agents = 'candidates'"):
        wsn_env.parallel_env(agents="candidates", action="menu")


# --- pictures -------------------------------------------------------------------------------------------------


def test_a_frame_shows_every_target():
    """Where each target is, and its head; a frame of the first target alone is the single environment's."""
    settings = SMALL | dict(render_mode="rgb_array", frame_px=400)
    env, one = MultiEnv(targets=3, **settings), wsn_env.ClusterEnv(**settings)
    policy = make_policy("nearest2", env.scenario)
    env.reset(seed=3), one.reset(seed=3)
    for _ in range(12):
        env.step(policy.act(env.view))
        one.step(policy.act(one.view))
    picture = env.render()
    assert picture.shape == (400, 400, 3)
    changed = (picture != one.render()).any(axis=2)
    rows, columns = np.nonzero(changed[60:340])
    assert len(rows) > 500  # two more targets with their clusters
    envs = MultiVectorEnv(2, targets=3, **settings)
    envs.reset(seed=3)
    assert len(envs.render()) == 2
