"""The Gymnasium environments: spaces, checkers, seeds, the three autoreset modes."""

import copy
import itertools
import pickle
import subprocess
import sys
import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import wsn_env
from wsn_env import ClusterEnv, ClusterVectorEnv, Scenario, ScenarioError
from wsn_env.envs.registration import IDS

ACTIONS = ("menu", "subset", "nodes", "cluster")
OBSERVATIONS = ("candidates", "dict", "view")
SMALL = dict(particles=64, nodes=40, side_m=50.0, crossing_m=20.0, periods=7)
SMALL_OTHERS = {  # small enough, in a field of their own
    "Binary-v0": dict(particles=64, nodes=100, periods=7),
    "Anchors-v0": dict(particles=64, periods=7),
    "Underwater-v0": dict(particles=64, nodes=36, periods=7),
    "Ble-v0": dict(particles=64, periods=7),
    "Lifetime-v0": dict(particles=64, nodes=40, side_m=50.0, periods=7),
}


def same(a, b) -> bool:
    """Equal to the bit, through dicts and object arrays."""
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[k], b[k]) for k in a)
    if a is None or b is None:
        return a is b
    if isinstance(a, tuple):
        return len(a) == len(b) and all(map(same, a, b))
    a, b = np.asarray(a), np.asarray(b)
    if a.dtype == object:
        return a.shape == b.shape and all(same(x, y) for x, y in zip(a.ravel(), b.ravel()))
    return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()


@pytest.mark.parametrize("scenario", IDS)
@pytest.mark.parametrize("reward", ("error", "belief"))
@pytest.mark.parametrize("action,observation", list(itertools.product(ACTIONS, OBSERVATIONS)))
def test_check_env_passes_without_a_warning(scenario, action, observation, reward):
    env = gym.make(
        f"wsn_env/{scenario}",
        action=action,
        observation=observation,
        reward=reward,
        render_mode="rgb_array",
        lam=(0.3, 30.0),
        **SMALL_OTHERS.get(scenario, SMALL),
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped)


def test_found_without_importing_wsn_env_first():
    code = "import gymnasium as gym; print(gym.make('wsn_env:wsn_env/PreDC-v0', particles=10).spec.id)"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "wsn_env/PreDC-v0"


def test_import_is_light():
    code = (
        "import wsn_env, sys; print(sorted({'torch', 'matplotlib', 'numba', 'scipy', 'filterpy'} & set(sys.modules)))"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "[]"


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("mode", list(AutoresetMode))
@pytest.mark.parametrize("observation", OBSERVATIONS)
def test_vector_equals_single_environments(mode, observation, threads):
    """64 rows: observations, rewards, flags, infos and final observations, over several episodes, to the bit."""
    rows = 64
    settings = dict(observation=observation, lam=(0.5, 8.0), radius_m=6.0, packet_success=0.7, **SMALL)
    native = ClusterVectorEnv(rows, autoreset_mode=mode, threads=threads, **settings)
    single = SyncVectorEnv([lambda: ClusterEnv(**settings)] * rows, autoreset_mode=mode)
    native.action_space.seed(1)
    pair = native.reset(seed=5), single.reset(seed=5)
    assert same(*pair)
    for _ in range(3 * SMALL["periods"]):
        action = native.action_space.sample()
        ours, theirs = native.step(action), single.step(action)
        assert same(ours, theirs)
        ended = ours[2] | ours[3]
        if mode == AutoresetMode.DISABLED and ended.any():
            # Gymnasium's own takes the mask out of the options that it is given.
            pair = [envs.reset(options={"reset_mask": ended.copy()}) for envs in (native, single)]
            assert same(*pair)


@pytest.mark.parametrize("scenario", IDS)
def test_sixty_four_rows_equal_sixty_four_environments(scenario):
    """At the scenario's size, 1 and 2 threads."""
    rows, seed, name = 64, 2**31 + 7, f"wsn_env/{scenario}"
    runs = []
    for threads in (1, 2):
        envs = gym.make_vec(name, num_envs=rows, vectorization_mode="vector_entry_point", threads=threads)
        first, _ = envs.reset(seed=seed)
        rng = np.random.default_rng(0)
        runs.append([first] + [envs.step(rng.integers(0, 28, rows))[:2] for _ in range(12)])
    assert all(same(a, b) for a, b in zip(*[[x for pair in run[1:] for x in pair] for run in runs]))
    for i in range(0, rows, 9):
        env = gym.make(name)
        observation, _ = env.reset(seed=seed + i)
        assert same(observation, runs[0][0][i])
        rng = np.random.default_rng(0)
        for batch_observation, batch_reward in runs[0][1:]:
            observation, reward, *_ = env.step(rng.integers(0, 28, rows)[i])
            assert same(observation, batch_observation[i]) and reward == batch_reward[i]


@pytest.mark.interpreted
def test_reward_is_minus_error_and_energy():
    env = ClusterEnv(lam=2.5, **SMALL)
    env.reset(seed=3)
    squares = 0.0
    for k in range(SMALL["periods"]):
        _, reward, terminated, truncated, info = env.step(12)
        assert reward == pytest.approx(-(info["error_m"] + 2.5 * info["energy_mj"]), abs=1e-12)
        assert reward == pytest.approx(info["reward_error"] + info["reward_energy"], abs=1e-12)
        assert info["error_m"] == pytest.approx(np.hypot(*(info["target_m"] - info["estimate_m"])), abs=1e-12)
        squares += info["error_m"] ** 2
        assert not terminated and truncated == (k + 1 == SMALL["periods"])
    assert info["episode_rms_m"] == pytest.approx((squares / SMALL["periods"]) ** 0.5)


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_antnp_is_the_mean_number_of_reporting_nodes(mode):
    env = ClusterEnv("Binary-v0", particles=50, periods=12)
    env.reset(seed=4)
    reporting = []
    for _ in range(12):
        *_, info = env.step(18)
        reporting.append(info["detections"])
    assert info["antnp"] == np.mean(reporting) > 0
    envs = ClusterVectorEnv(2, "Binary-v0", particles=50, periods=12, autoreset_mode=mode)
    envs.reset(seed=4)
    for _ in range(12):
        *_, infos = envs.step(np.full(2, 18))
    last = infos["final_info"] if mode == "SameStep" else infos
    assert last["antnp"][0] == info["antnp"]


def test_belief_reward_turns_to_the_error_when_the_belief_is_wrong():
    env = ClusterEnv(
        reward="belief",
        lam=0.0,
        search=False,
        filter_q=0.0,
        motion="turns",
        speed_ms=3.0,
        **{k: v for k, v in SMALL.items() if k not in ("crossing_m", "periods")},
        periods=30,
    )
    env.reset(seed=0)
    kinds = set()
    for _ in range(30):
        _, reward, *_, info = env.step(10)
        wrong = info["error_m"] > 3 * info["posterior_rms_m"]
        assert -reward == pytest.approx(info["error_m"] if wrong else info["believed_error_m"])
        kinds.add(wrong)
    assert kinds == {True, False}


def test_lam_is_drawn_log_uniformly_for_each_episode():
    envs = ClusterVectorEnv(400, lam=(0.3, 30.0), autoreset_mode="SameStep", **(SMALL | {"periods": 1}))
    envs.reset(seed=0)
    drawn = [envs.lam.copy()]
    for _ in range(5):
        envs.step(np.zeros(400, int))
        drawn.append(envs.lam.copy())
    logs = np.log(np.concatenate(drawn) / 0.3) / np.log(100.0)
    assert 0 <= logs.min() and logs.max() <= 1
    assert abs(logs.mean() - 0.5) < 4 * (1 / 12) ** 0.5 / len(logs) ** 0.5
    assert abs(logs.var() - 1 / 12) < 0.01


def test_menu_keeps_moves_and_counts():
    env = ClusterEnv(observation="view", **SMALL)
    view, _ = env.reset(seed=1)
    order = np.argsort(np.hypot(*(view["positions"] - view["predicted_mean"][::2]).T))
    view, *_ = env.step(0)  # nothing to keep yet: the nearest node alone
    assert view["head"] == order[0] and view["member"].sum() == 1
    order = np.argsort(np.hypot(*(view["positions"] - view["predicted_mean"][::2]).T))
    view, *_ = env.step(10 + 4)
    assert view["head"] == order[0] and set(np.flatnonzero(view["member"])) == set(order[:5])
    before = view
    view, *_ = env.step(0)
    assert view["head"] == before["head"] and same(view["member"], before["member"])
    order = np.argsort(np.hypot(*(view["positions"] - view["predicted_mean"][::2]).T))
    others = [node for node in order if node != view["head"]][:2]
    view, *_ = env.step(1 + 2)
    assert view["head"] == before["head"] and set(np.flatnonzero(view["member"])) == {before["head"].item(), *others}


def test_dead_choices_are_masked_dropped_and_counted():
    env = ClusterEnv(action="nodes", battery_j=2e-4, **(SMALL | {"periods": 60}))
    env.reset(seed=0)
    for _ in range(60):
        mask = env.action_masks().reshape(-1, 2)
        alive = env._view.alive[0]
        assert mask[:, 0].all() and same(mask[:, 1], alive)
        *_, info = env.step(np.ones(SMALL["nodes"], int))
        assert info["dropped"] == (~alive).sum()
    assert info["alive"] < SMALL["nodes"]


@pytest.mark.parametrize("action", ["menu", "subset", "nodes", "cluster"])
def test_masks_fit_the_action(action):
    envs = ClusterVectorEnv(3, action=action, **SMALL)
    envs.reset(seed=0)
    size = gym.spaces.flatdim(envs.single_action_space)
    assert envs.action_masks().shape == (3, size) and envs.action_masks().any(axis=1).all()


def test_a_radius_names_who_is_within_it():
    env = ClusterEnv(action="radius", observation="view", **SMALL)
    observation, _ = env.reset(seed=0)
    for radius in (0.0, 0.3, 1.0):
        distance = np.hypot(*(observation["positions"] - observation["predicted_mean"][::2]).T)
        within = set(np.flatnonzero(distance <= radius * 2 * env.scenario.radius_m)) & set(np.argsort(distance)[:12])
        observation, *_ = env.step(np.array([radius], np.float32))
        assert set(np.flatnonzero(observation["member"])) == within | {observation["head"].item()}
    with pytest.raises(AttributeError, match="no masks"):
        env.action_masks()


def test_scores_name_members_and_the_head():
    env = ClusterEnv(action="scores", observation="view", **SMALL)
    observation, _ = env.reset(seed=0)
    distance = np.hypot(*(observation["positions"] - observation["predicted_mean"][::2]).T)
    nearest = np.argsort(distance)[:12]
    scores = np.full(12, -0.5, np.float32)
    scores[[1, 4, 7]] = 0.2, 0.9, 0.1
    observation, *_ = env.step(scores)
    assert observation["head"] == nearest[4]
    assert set(np.flatnonzero(observation["member"])) == set(nearest[[1, 4, 7]])
    observation, *_ = env.step(np.full(12, -1.0, np.float32))  # nobody above 0: the head alone
    assert observation["member"].sum() == 1


def test_environments_survive_pickle_and_deepcopy():
    env = ClusterEnv(**SMALL)
    env.reset(seed=2)
    twins = [copy.deepcopy(env), pickle.loads(pickle.dumps(env))]
    step = env.step(13)
    assert all(same(step[0], twin.step(13)[0]) for twin in twins)


@pytest.mark.parametrize("observation", ["candidates", "menu", "dict"])
def test_observations_are_those_of_one_who_encodes_all_anew(observation):
    """After steps, with more members than there was room for, and where some rows alone begin; of a copy, too."""
    envs = ClusterVectorEnv(3, autoreset_mode="Disabled", action="nodes", observation=observation, **SMALL)
    envs.reset(seed=2)
    anew = {"reset_mask": np.array([False, True, False])}
    many, few = np.ones((3, 40), int), np.eye(3, 40, dtype=int)
    for twin in (copy.deepcopy(envs), pickle.loads(pickle.dumps(envs)), envs):
        for actions in (None, few, many, None, many, few):
            told = twin.reset(options=anew) if actions is None else twin.step(actions)
            assert same(told[0], twin.interface.observation.encode(twin.view))


@pytest.mark.parametrize(
    "keywords,words",
    [
        (dict(nodse=3), ("nodse", "nodes")),
        (dict(radius_m=-1.0), ("radius_m", "-1.0", "above 0")),
        (dict(nodes=0), ("nodes", "0", "at least 1")),
        (dict(lam=-1.0), ("lam", "-1.0")),
        (dict(scenario="PreDC-v9"), ("PreDC-v9", "PreDC-v0")),
        (dict(action="menue"), ("menue", "menu")),
        (dict(observation="vieww"), ("vieww", "view")),
        (dict(reward="eror"), ("eror", "error")),
        (dict(order="close"), ("close", "nearest")),
        (dict(render_mode="human4"), ("human4", "rgb_array", "human")),
        (dict(render_mode="rgb_array", frame_px=10), ("frame_px", "10", "64")),
        (dict(candidates=3), ("candidates", "3", "9")),
    ],
)
def test_bad_keywords_name_themselves(keywords, words):
    with pytest.raises(ValueError) as problem:
        ClusterEnv(**keywords)
    assert all(word in str(problem.value) for word in words)


@pytest.mark.parametrize(
    "action,bad",
    [
        ("menu", 28),
        ("menu", -1),
        ("subset", np.full(13, 2)),
        ("nodes", np.zeros(3, int)),
        ("radius", np.array([1.5])),
        ("radius", np.array([np.nan])),
        ("scores", np.zeros(3)),
    ],
)
def test_bad_actions_name_the_space(action, bad):
    env = ClusterEnv(action=action, **SMALL)
    env.reset(seed=0)
    with pytest.raises(ValueError, match="not in"):
        env.step(bad)
    envs = ClusterVectorEnv(2, action=action, **SMALL)
    envs.reset(seed=0)
    with pytest.raises(ValueError, match="not in"):
        envs.step(np.stack([bad, bad]))


def test_the_view_can_be_flattened():
    env = gym.wrappers.FlattenObservation(ClusterEnv(observation="view", **SMALL))
    observation, _ = env.reset(seed=0)
    assert env.observation_space.contains(observation) and len(observation) < 1000


def test_actions_are_whole_numbers():
    envs = ClusterVectorEnv(2, **SMALL)
    envs.reset(seed=0)
    with pytest.raises(ValueError, match="not in"):
        envs.step(np.array([3.7, 2.2]))


@pytest.mark.parametrize(("action", "given"), [("menu", True), ("menu", np.int8(3)), ("nodes", "mask")])
def test_what_the_space_contains_is_an_action(action, given):
    """Python's True, too, which is 1 to a Discrete space; and a mask of the nodes."""
    env, twin = (ClusterEnv(action=action, **SMALL) for _ in range(2))
    given = np.arange(SMALL["nodes"]) < 3 if isinstance(given, str) else given
    assert action == "nodes" or env.action_space.contains(given)
    for each in (env, twin):
        each.reset(seed=0)
    assert same(env.step(given), twin.step(np.asarray(given).astype(int)))


def test_stepping_at_the_wrong_time_says_reset():
    env = ClusterEnv(**SMALL)
    with pytest.raises(gym.error.ResetNeeded):
        env.step(0)
    env.reset(seed=0)
    for _ in range(SMALL["periods"]):
        env.step(0)
    with pytest.raises(gym.error.ResetNeeded):
        env.step(0)
    envs = ClusterVectorEnv(2, autoreset_mode="Disabled", **(SMALL | {"periods": 1}))
    envs.reset(seed=0)
    envs.step(np.zeros(2, int))
    with pytest.raises(gym.error.ResetNeeded, match="reset_mask"):
        envs.step(np.zeros(2, int))


def test_scenarios_and_ids_agree():
    assert gym.make("wsn_env/Rssi-v0").unwrapped.scenario == Scenario.named("Rssi-v0")
    assert gym.make("wsn_env/PreDC-v0", scenario=Scenario.named("Rssi-v0"), nodes=7).unwrapped.scenario.field.nodes == 7
    with pytest.raises(ScenarioError):
        Scenario.named("wsn_env/None-v0")
    assert wsn_env.__version__


def test_an_observation_may_be_written_into():
    envs = ClusterVectorEnv(3, autoreset_mode="Disabled", **SMALL)
    envs.reset(seed=0)
    observation = envs.step(np.full(3, 12))[0]
    seen = observation.copy()
    observation[:] = 7.0
    again, _ = envs.reset(options={"reset_mask": np.array([True, False, True])})
    assert (again[1] == seen[1]).all() and not (again[0] == seen[0]).all()
