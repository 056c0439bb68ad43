"""Arguments: NumPy's scalars go wherever Python's do; near misses work or are told what is wanted."""

import json
import pickle
import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest

from wsn_env import (
    ClusterEnv,
    ClusterVectorEnv,
    Scenario,
    ScenarioError,
    World,
    error_bound,
    evaluate,
    make_policy,
    score,
)
from wsn_env.bluetooth.recorded_evaluation import insert_track_name
from wsn_env.learning.concat_vector_env import ConcatVectorEnv
from wsn_env.reports.pages.replay_page import replay

SMALL = Scenario.named("PreDC-v0", periods=4, particles=30, nodes=25)
INTEGERS = [np.int8, np.uint8, np.int16, np.uint16, np.int32, np.uint32, np.int64, np.uint64]


def rows(**more):
    return evaluate(["nearest0"], SMALL, **(dict(lams=4.0, episodes=2) | more)).rows


@pytest.mark.parametrize("kind", INTEGERS)
def test_numpys_integers_are_seeds_and_counts(kind, tmp_path):
    found = evaluate(["nearest0"], SMALL, 4.0, kind(2), kind(3), keep=tmp_path)
    assert found.rows == evaluate(["nearest0"], SMALL, 4.0, 2, 3).rows
    found.save(tmp_path)
    assert json.loads((tmp_path / "evaluation.json").read_text())["seed"] == 3
    env, envs = ClusterEnv(SMALL, candidates=kind(12)), ClusterVectorEnv(kind(2), SMALL, threads=kind(1))
    usual = ClusterVectorEnv(2, SMALL).reset(seed=5)[0]
    np.testing.assert_array_equal(env.reset(seed=kind(5))[0], usual[0])
    for seed in (kind(5), [kind(5), kind(6)], np.array([5, 6], kind), (5, kind(6))):
        np.testing.assert_array_equal(envs.reset(seed=seed)[0], usual)
    joined = ConcatVectorEnv([ClusterVectorEnv(1, SMALL), ClusterVectorEnv(1, SMALL)])
    np.testing.assert_array_equal(joined.reset(seed=kind(5))[0], usual)
    three = np.full(2, 3)
    np.testing.assert_array_equal(score(lambda _: three, envs, kind(1)), score(lambda _: three, envs, 1))
    replay({"nearest": make_policy("nearest", SMALL, n=kind(2))}, SMALL, kind(5), tmp_path / "replay.html")


@pytest.mark.parametrize("kind", [*INTEGERS, np.float16, np.float32, np.float64])
def test_numpys_numbers_are_quantities(kind):
    given = dict(lam=kind(4), nodes=kind(25), period_s=kind(2), periods=kind(6), retries=kind(1))
    usual = SMALL.override(**{name: int(value) for name, value in given.items()})
    assert SMALL.override(**given) == usual
    assert json.dumps(SMALL.override(**given).as_dict())
    assert type(SMALL.override(**given).lam) in (int, float)
    pair = SMALL.override(lam=(kind(1), kind(8)))
    assert pair == SMALL.override(lam=(1, 8)) and json.dumps(pair.as_dict())
    assert SMALL.override(lam=np.array([1, 8], kind)).lam == (1, 8)
    legs = dict(start_m=(kind(1), kind(2)), legs=((kind(50), kind(1), kind(3)),))
    assert json.dumps(SMALL.override(motion="legs", **legs).as_dict())
    assert rows(lams=kind(4)) == rows(lams=[kind(4)]) == rows(lams=np.array([4], kind)) == rows()


def test_numpys_bools_and_words_are_quantities():
    given = SMALL.override(ends_outside=np.True_, tracker=np.str_("ekf"))
    assert given == SMALL.override(ends_outside=True, tracker="ekf") and json.dumps(given.as_dict())
    assert given.ends_outside is True


NO_COUNTS = [2.0, "2", None, True, np.nan, [2], -1, np.float32(2), np.True_, 10**6]


@pytest.mark.parametrize("wrong", NO_COUNTS, ids=repr)
@pytest.mark.parametrize(("name", "range_"), [("episodes", "1..100000"), ("seed", "0..9999")])
def test_what_is_no_count_is_refused_by_name(name, range_, wrong):
    with pytest.raises(ValueError, match=rf"^{name} = .*: must be in {range_}, a whole number$"):
        rows(**{name: wrong})


@pytest.mark.parametrize("wrong", [2.0, "2", True, np.nan, -1, {1, 2}])
def test_what_is_no_seed_is_refused(wrong):
    for env in (ClusterEnv(SMALL), ClusterVectorEnv(2, SMALL)):
        with pytest.raises(ValueError, match="^seed = .*: must be a whole number, at least 0$"):
            env.reset(seed=wrong)
        with pytest.raises(ValueError, match="^options = 3: must be a dict or None$"):
            env.reset(options=3)


@pytest.mark.parametrize("name", ["num_envs", "threads", "candidates"])
@pytest.mark.parametrize("wrong", [True, 1.5, "2", 0, -1])
def test_what_is_no_number_of_environments_or_threads_is_refused(name, wrong):
    with pytest.raises(ValueError, match=f"^{name} = .*: must be a whole number, at least 1$"):
        ClusterVectorEnv(scenario=SMALL, **{name: wrong})


def test_names_do_where_scenarios_and_lists_are_expected():
    assert evaluate("nearest0", "PreDC-v0", 4.0, 1).rows == evaluate(["nearest0"], Scenario(), [4.0], 1).rows
    assert make_policy("nearest0", "wsn_env/Rssi-v0").scenario == Scenario.named("Rssi-v0")
    assert World("Rssi-v0", threads=1).scenario == Scenario.named("Rssi-v0")
    assert rows(lams=4) == rows(lams=(4.0,)) == rows(lams={4.0}) == rows(lams=np.array(4.0)) == rows(lams=None)
    assert insert_track_name("ppo={track}/policy.json", "a") == ["ppo=a/policy.json"]


NEAREST = make_policy("nearest0", SMALL)


@pytest.mark.parametrize(
    ("policies", "message"),
    [
        (None, "policies: NoneType is no name: give policies of your own as {name: policy}"),
        (3, "policies: int is no name: give policies of your own as {name: policy}"),
        (NEAREST, "policies: Nearest is no name: give policies of your own as {name: policy}"),
        ([NEAREST], "policies: Nearest is no name: give policies of your own as {name: policy}"),
        ([], "policies: must name at least one"),
        ({}, "policies: must name at least one"),
        ("", "policy '': must be a name, FILE.py:CLASS, or the path of a policy.json"),
        ("nearst", "policy 'nearst' is unknown: did you mean nearest"),
        ({"a": "nearest0"}, "policies['a'] = 'nearest0': must be a policy, with act(view)"),
        ({"a": type(NEAREST)}, "must be a policy, with act(view)"),
    ],
)
def test_what_is_no_policy_is_told_what_is_wanted(policies, message):
    with pytest.raises(ValueError) as problem:
        evaluate(policies, SMALL, 4.0, 1)
    assert message in str(problem.value) and "\n" not in str(problem.value)


@pytest.mark.parametrize("scenario", [None, 3, ["PreDC-v0"], Scenario])
def test_what_is_no_scenario_is_told_what_is_wanted(scenario):
    for use in (lambda: evaluate("nearest0", scenario), lambda: World(scenario), lambda: ClusterEnv(scenario)):
        with pytest.raises(
            ScenarioError, match="^scenario = .*: must be a Scenario or a name: Anchors-v0, .*Underwater-v0$"
        ):
            use()


@pytest.mark.parametrize("lams", ["4.0", ["4.0"], [], [None], True, [[1, 2]], np.array([[1.0]])])
def test_what_are_no_lams_is_told_what_is_wanted(lams):
    with pytest.raises(ValueError, match="^lams = .*: must be a number of m/mJ, or at least one in a list$"):
        rows(lams=lams)


def test_scores_are_of_the_native_vector_environment():
    envs = gym.make_vec("wsn_env/PreDC-v0", num_envs=2, vectorization_mode="sync")
    for wrong, name in (
        ("PreDC-v0", "str"),
        (envs, "SyncVectorEnv"),
        (None, "NoneType"),
    ):
        with pytest.raises(ValueError, match=f"^envs = {name}: must be the native vector environment, of gym.make_vec"):
            score(lambda _: 3, wrong)
    with pytest.raises(ValueError, match="^act = 3: must be a function of the observations of all rows$"):
        score(3, ClusterVectorEnv(2, SMALL))
    with pytest.raises(ValueError, match="must be a policy, with act"):
        error_bound(3, SMALL)


TYPOS = {
    "observations": "observation", "actions": "action", "rewards": "reward", "orders": "order",
    "candidate": "candidates",
    "fram_px": "frame_px", "render_mod": "render_mode", "fasts": "fast", "scenari": "scenario", "nodess": "nodes",
    "lamb": "lam", "particels": "particles", "measurment": "measurement", "motin": "motion",
    "calibation": "calibration",
    "trackr": "tracker", "batery_j": "battery_j",
}  # fmt: skip


@pytest.mark.parametrize(("typo", "meant"), [*TYPOS.items(), ("num_env", "num_envs"), ("threds", "threads")])
def test_a_typo_suggests_among_all_names(typo, meant):
    makers = [lambda **given: ClusterVectorEnv(2, **given)]
    if typo in TYPOS:
        makers += [ClusterEnv, lambda **given: gym.make("wsn_env/PreDC-v0", **given)]
    for make in makers:
        with pytest.raises(ScenarioError, match=f"unexpected keyword argument '{typo}': did you mean {meant}\\b"):
            make(**{typo: 1})


def test_a_quantity_of_another_kind_is_told_whose_it_is():
    with pytest.raises(ScenarioError, match="scenario has no quantity 'amplitude_m': it is one of motion='sine'$"):
        ClusterEnv(amplitude_m=3)
    with pytest.raises(ScenarioError, match="did you mean amplitude_m"):
        SMALL.override(motion="sine", amplitud_m=3)
    with pytest.raises(ValueError, match="unexpected keyword argument 'thetaa': did you mean theta"):
        make_policy("pre_dc", SMALL, thetaa=1)


def test_an_unknown_quantity_can_be_pickled():
    with pytest.raises(ScenarioError) as problem:
        SMALL.override(nodess=3)
    assert str(pickle.loads(pickle.dumps(problem.value))) == str(problem.value)


def test_pickles_carry_their_network_without_assertions():
    code = """
import pickle, sys
from wsn_env import Scenario, make_policy
assert False, "not with -O"
carried = pickle.dumps(make_policy("ppo", Scenario()))
import wsn_env.agents.ppo as ppo
ppo.PRETRAINED = None
print("_interface_and_network" in vars(pickle.loads(carried)), len(carried) > 10_000)
"""
    done = subprocess.run([sys.executable, "-O", "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["True", "True"]
