"""What other libraries rely on: specs, ids, seeds, masks, choices as actions; and their models as policies."""

import json
import re
from dataclasses import replace
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec, registry
from gymnasium.wrappers import TimeAwareObservation

import wsn_env
from tests.test_env import SMALL
from wsn_env import Cluster, ClusterEnv, ClusterVectorEnv, Scenario, as_policy, evaluate, make_policy, score
from wsn_env.envs.registration import CONTINUOUS, IDS
from wsn_env.models.quantity import ScenarioError, UnknownKeyword
from wsn_env.reports.pages.evaluation_page import write_report
from wsn_env.scenario import named_scenarios

ID = "wsn_env/PreDC-v0"
OWN = """
from dataclasses import dataclass
from wsn_env.models.motion.straight import Straight

@dataclass(frozen=True)
class Mine(Straight):
    abstract = False
"""


def again(spec):
    """Through JSON."""
    return EnvSpec.from_json(spec.to_json())


# --- specs ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [*IDS, *CONTINUOUS])
def test_a_spec_tells_the_horizon(name):
    env = gym.make(f"wsn_env/{name}", periods=7)
    assert env.spec.max_episode_steps == 7
    assert gym.make_vec(f"wsn_env/{name}", num_envs=2, periods=7).spec.max_episode_steps == 7


def test_tools_that_need_the_horizon_find_it():
    env = TimeAwareObservation(gym.make(ID, **SMALL))
    assert env.reset(seed=1)[0].shape == (gym.make(ID, **SMALL).observation_space.shape[0] + 1,)


ARGUMENTS = {
    "a pair": dict(lam=(0.3, 30.0)),
    "positions": dict(positions=np.random.default_rng(0).uniform(0, 90, (9, 2))),
    "kinds": dict(motion="waypoint", measurement="rssi", faults="stuck,share=0.3+late"),
    "a section": dict(motion=Scenario.named("Ble-v0").motion),
    "a scenario": dict(scenario=Scenario.named("Rssi-v0", nodes=50, faults="stuck")),
    "modes": dict(action="scores", observation="dict", candidates=9),
}


@pytest.mark.parametrize("given", ARGUMENTS.values(), ids=ARGUMENTS)
def test_a_spec_goes_through_json_with_every_argument(given):
    made = gym.make(ID, **given)
    assert again(made.spec) == made.spec
    one, other = gym.make(made.spec), gym.make(again(made.spec))
    assert one.unwrapped.scenario == other.unwrapped.scenario == made.unwrapped.scenario
    assert one.spec == other.spec == made.spec
    assert other.observation_space == made.observation_space and other.action_space == made.action_space
    batch = gym.make_vec(ID, num_envs=2, **given)
    other = gym.make_vec(again(batch.spec))
    assert other.unwrapped.scenario == made.unwrapped.scenario and other.spec == batch.spec


@pytest.mark.parametrize("name", named_scenarios())
def test_a_scenario_goes_through_json(name):
    scenario = Scenario.named(name, faults="late+failures,share=0.2")
    assert Scenario.of(json.loads(json.dumps(scenario.as_dict()))) == scenario


def test_a_kind_of_ones_own_goes_through_json(tmp_path):
    (tmp_path / "mine.py").write_text(OWN)
    made = gym.make(ID, motion=f"{tmp_path / 'mine.py'}:Mine")
    told = made.unwrapped.scenario.as_dict()
    assert told["motion"]["kind"] == f"{tmp_path / 'mine.py'}:Mine"
    assert gym.make(again(made.spec)).unwrapped.scenario == made.unwrapped.scenario
    assert Scenario.of(json.loads(json.dumps(told))) == made.unwrapped.scenario


@pytest.mark.parametrize(
    ("told", "words"),
    [
        ({}, "scenario = {}: must tell its name"),
        ({"name": "x", "nodez": 3}, "has no quantity 'nodez': did you mean nodes"),
        ({"name": "x", "motion": {"kind": "Crosing"}}, "kind 'Crosing' is unknown: did you mean Crossing"),
        ({"name": "x", "motion": {}}, "Scenario.motion: kind None is unknown: known are Circle"),
        ({"name": "x", "field": {"kind": "Motion"}}, "Scenario.field: kind 'Motion' is unknown"),
        ({"name": "x", "motion": {"kind": "Sine", "x": 1}}, "Sine has no quantity 'x'"),
    ],
)
def test_what_tells_no_scenario_is_refused(told, words):
    with pytest.raises(ScenarioError, match=words):
        Scenario.of(told)


def test_an_unknown_argument_is_also_a_type_error_in_pythons_words():
    """TorchRL tries `frameskip`, and goes on without it if Python would have refused it."""
    with pytest.raises(TypeError, match="got an unexpected keyword argument 'frameskip': did you mean") as caught:
        gym.make(ID, frameskip=1)
    assert isinstance(caught.value, ValueError) and "environment creator" not in str(caught.value)
    with pytest.raises(UnknownKeyword, match=r"^ClusterVectorEnv\(\) got an unexpected"):
        ClusterVectorEnv(2, frameskip=1)


def test_a_batch_is_cut_where_it_is_told_to():
    envs = gym.make_vec(ID, num_envs=3, max_episode_steps=4, **SMALL)
    whole = gym.make_vec(ID, num_envs=3, **SMALL)
    envs.reset(seed=5), whole.reset(seed=5)
    assert envs.spec.max_episode_steps == 4
    squares, energy, references = np.zeros((3, 3))
    for _ in range(4):
        action = np.full(3, 12)
        observations, _, _, truncated, infos = envs.step(action)
        assert (observations == whole.step(action)[0]).all()
        squares += infos["error_m"] ** 2
        energy += infos["energy_mj"]
        references += infos["reference_m"] ** 2
    assert truncated.all()
    assert infos["episode_rms_m"] == pytest.approx(np.sqrt(squares / 4))
    assert infos["episode_energy_mj"] == pytest.approx(energy)
    assert infos["episode_reference_m"] == pytest.approx(np.sqrt(references / 4))
    asked = dict(num_envs=2, max_episode_steps=4, action="nodes", **SMALL)
    awake = gym.make_vec(ID, autoreset_mode=gym.vector.AutoresetMode.DISABLED, **asked)
    assert gym.make_vec(again(awake.spec)).spec == awake.spec
    awake.reset(seed=5)
    for _ in range(4):
        infos = awake.step(np.ones((2, SMALL["nodes"]), int))[4]
    assert infos["episode_reference_m"] == pytest.approx(awake.unwrapped.reference_all_awake_m())
    with pytest.raises(ValueError, match="max_episode_steps = 0: must be a whole number, at least 1"):
        gym.make_vec(ID, num_envs=3, max_episode_steps=0)


def test_seeds_of_rows_are_told():
    envs = gym.make_vec(ID, num_envs=3, **SMALL)
    assert envs.np_random_seed == (None, None, None)
    envs.reset(seed=42)
    assert envs.np_random_seed == (42, 43, 44)
    envs.reset()
    assert envs.np_random_seed == (42, 43, 44)
    assert [each.bit_generator.state for each in envs.np_random] == [
        each.bit_generator.state for each in envs.unwrapped._generators
    ]
    envs.reset(seed=[7, None, 9])
    assert envs.np_random_seed == (7, 43, 9)


def test_the_page_tells_every_key_of_an_info():
    told = dict(ends_outside=True, motion="free", action_mask=True)
    env = gym.make(ID, **{name: SMALL[name] for name in SMALL if name != "crossing_m"} | told)
    env.reset(seed=0)
    ended, keys = False, set()
    while not ended:
        _, _, terminated, truncated, info = env.step(13)
        ended = terminated or truncated
        keys |= set(info)
    env = gym.make(ID, **SMALL)  # with a reference
    env.reset(seed=0)
    for _ in range(SMALL["periods"]):
        keys |= set(env.step(13)[4])
    page = (Path(__file__).parents[1] / "docs" / "reference.md").read_text()
    section = page[page.index("## Info") : page.index("## Meaning of lam")]
    rows = [line.split("|")[1] for line in section.splitlines() if line.startswith("| `")]
    assert {name for row in rows for name in re.findall(r"`(\w+)`", row)} == keys


# --- ids ------------------------------------------------------------------------------------------------------


@pytest.fixture
def own_ids():
    known = set(registry)
    yield
    for name in set(registry) - known:
        del registry[name]


def test_an_id_of_ones_own(own_ids):
    for _ in range(2):  # the same again does no harm
        wsn_env.register("test/Mine-v0", scenario="Rssi-v0", lam=2, action="scores", **SMALL)
        wsn_env.register("test/Placed-v0", positions=np.array([[10.0, 20.0], [30.0, 40.0]]))
    env, envs = gym.make("test/Mine-v0"), gym.make_vec("test/Mine-v0", num_envs=2)
    same = ClusterEnv("Rssi-v0", lam=2, action="scores", **SMALL)
    assert (env.reset(seed=3)[0] == same.reset(seed=3)[0]).all()
    assert (envs.reset(seed=3)[0][0] == same.reset(seed=3)[0]).all()
    assert gym.make("test/Mine-v0", lam=5).unwrapped.scenario == replace(same.scenario, lam=5.0)
    with pytest.raises(ValueError, match="id 'test/Mine-v0': is another environment's"):
        wsn_env.register("test/Mine-v0", lam=3)
    with pytest.raises(ValueError, match="id 'no id!': must be a text NAME-vN|id = 'no id!': must be a text NAME-vN"):
        wsn_env.register("no id!")
    with pytest.raises(ScenarioError, match="did you mean nodes"):
        wsn_env.register("test/Other-v0", nodez=3)
    assert "test/Other-v0" not in registry


def test_a_continuous_id_is_for_learners_of_numbers():
    from stable_baselines3 import SAC

    env = gym.make("wsn_env/PreDCContinuous-v0", **SMALL)
    SAC("MlpPolicy", env, learning_starts=10, batch_size=8, device="cpu").learn(20)
    assert env.action_space == gym.spaces.Box(-1.0, 1.0, (12,), np.float32)


# --- choices and masks ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("action", ["menu", "subset", "radius", "scores", "nodes", "cluster"])
def test_a_cluster_is_an_action_in_every_mode(action):
    env = gym.make(ID, action=action, **SMALL)
    other = gym.make(ID, action="cluster", **SMALL)
    envs = gym.make_vec(ID, num_envs=1, action=action, **SMALL)
    env.reset(seed=2), other.reset(seed=2), envs.reset(seed=2)
    policy = make_policy("pre_dc", env.unwrapped.scenario)
    nodes = env.unwrapped.scenario.field.nodes
    for _ in range(5):
        choice = policy.act(env.unwrapped.view)
        members = np.isin(np.arange(nodes), choice.members).astype(int)
        told = env.step(choice)
        batch = envs.step(choice)
        if choice.head[0] >= 0:
            assert told[4]["error_m"] == other.step({"head": choice.head[0], "members": members})[4]["error_m"]
        else:
            other.step(choice)
        assert told[1] == batch[1][0] and (told[0] == batch[0][0]).all()
    env.step(Cluster(np.array([wsn_env.models.state.KEEP_CLUSTER]), np.full((1, 1), -1)))
    with pytest.raises(ValueError, match=r"cluster has head \(2,\)"):
        env.step(Cluster(np.array([1, 2]), np.array([[3], [4]])))


@pytest.mark.parametrize("mode", list(gym.vector.AutoresetMode))
def test_infos_tell_the_mask_where_it_is_asked_for(mode):
    env, plain = gym.make(ID, action_mask=True, **SMALL), gym.make(ID, **SMALL)
    envs = gym.make_vec(ID, num_envs=3, action_mask=True, autoreset_mode=mode, **SMALL)
    info = env.reset(seed=1)[1]
    assert "action_mask" not in plain.reset(seed=1)[1]
    assert info["action_mask"].dtype == np.int8 and (info["action_mask"] == env.unwrapped.action_masks()).all()
    assert env.action_space.sample(info["action_mask"]) in np.flatnonzero(info["action_mask"])
    infos = envs.reset(seed=1)[1]
    assert (infos["action_mask"][0] == info["action_mask"]).all()
    for _ in range(env.unwrapped.scenario.periods):
        info, infos = env.step(0)[4], envs.step(np.zeros(3, int))[4]
        assert (info["action_mask"] == env.unwrapped.action_masks()).all()
        assert (infos["action_mask"] == envs.unwrapped.action_masks()).all() and infos["_action_mask"].all()
    if mode == gym.vector.AutoresetMode.SAME_STEP:
        assert (infos["final_info"]["action_mask"][0] == info["action_mask"]).all()
    else:
        assert (infos["action_mask"][0] == info["action_mask"]).all()
    with pytest.raises(ValueError, match="action_mask = True: action 'scores' is of numbers and has no masks"):
        gym.make(ID, action="scores", action_mask=True)


# --- models of other libraries --------------------------------------------------------------------------------


def test_a_function_is_a_policy():
    """The menu's "best node and three more" is `nearest3` where it moves its head in every period."""
    scenario = Scenario.of("PreDC-v0", **SMALL)
    mine = as_policy(lambda observations: np.full(len(observations), 13))
    evaluation = evaluate({"mine": mine}, scenario, episodes=5)
    envs = ClusterVectorEnv(5, scenario)
    assert (evaluation.values("mine", 4.0, "return") == score(lambda _: np.full(5, 13), envs)).all()
    assert (evaluation.values("mine", 4.0, "reference_m") > 0).all()


def test_a_model_is_replayed_reported_and_drawn_like_any_policy(tmp_path):
    import matplotlib

    matplotlib.use("Agg")
    mine = as_policy(lambda observations: np.full(len(observations), 13))
    scenario = Scenario.of("PreDC-v0", **SMALL)
    recording = wsn_env.replay(
        {"mine": mine, "rule": make_policy("nearest3", scenario)}, scenario, 3, tmp_path / "a.html"
    )
    assert [episode.policy for episode in recording.episodes] == ["mine", "rule"]
    assert "mine" in (tmp_path / "a.html").read_text()
    evaluation = evaluate({"mine": mine}, scenario, episodes=2)
    assert "mine" in write_report(tmp_path, evaluation, {"mine": mine}).read_text()
    assert "ForeignPolicy" in wsn_env.plot_episode(mine, scenario).get_title()


def test_models_of_libraries_are_policies():
    import torch
    from sb3_contrib import MaskablePPO
    from stable_baselines3 import PPO

    scenario = Scenario.of("PreDC-v0", **SMALL)
    env = ClusterEnv(scenario)
    inputs = env.observation_space.shape[0]
    models = {
        "ppo": PPO("MlpPolicy", env, device="cpu", seed=1),
        "masked": MaskablePPO("MlpPolicy", env, device="cpu", seed=1),
        "logits": torch.nn.Linear(inputs, 28),
    }
    evaluation = evaluate({name: as_policy(model) for name, model in models.items()}, scenario, episodes=4)
    envs = ClusterVectorEnv(4, scenario)

    def acts(name, observations):
        if name == "logits":
            return models[name](torch.as_tensor(observations)).argmax(dim=1).numpy()
        masks = {"action_masks": envs.action_masks()} if name == "masked" else {}
        return models[name].predict(observations, deterministic=True, **masks)[0]

    for name in models:
        own = score(lambda observations, name=name: acts(name, observations), envs)
        assert (own == evaluation.values(name, 4.0, "return")).all(), name


def test_models_that_cannot_be_policies_are_refused():
    from sb3_contrib import RecurrentPPO
    from stable_baselines3 import PPO

    env = ClusterEnv("PreDC-v0", **SMALL)
    with pytest.raises(ValueError, match="model = 3: must map observations to actions"):
        as_policy(3)
    with pytest.raises(ValueError, match="model: has a memory"):
        as_policy(RecurrentPPO("MlpLstmPolicy", env, device="cpu"))
    ppo = PPO("MlpPolicy", env, device="cpu")
    for settings, words in (
        (dict(action="subset"), r"the model's action space Discrete\(28\) is not MultiDiscrete.*action = 'subset'"),
        (dict(observation="menu"), "the model's observation space .* that of observation = 'menu' in PreDC-v0"),
    ):
        with pytest.raises(ValueError, match=words):
            evaluate({"mine": as_policy(ppo, **settings)}, "PreDC-v0", episodes=1)


def test_a_single_environment_is_scored_as_a_row():
    scenario = Scenario.of("PreDC-v0", lam=2.0, **SMALL)
    expected = evaluate("nearest2", scenario, episodes=1, seed=4).values("nearest2", 2.0, "return")
    env = gym.make(ID, lam=2.0, **SMALL)
    policy = make_policy("nearest2", scenario)
    assert (score(lambda _: policy.act(env.unwrapped.view), env, seed=4) == expected).all()
    with pytest.raises(ValueError, match="envs: truncated after 3 of"):
        score(lambda _: 0, gym.make(ID, max_episode_steps=3, **SMALL))
