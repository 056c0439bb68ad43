"""stable-baselines3: the adapter against DummyVecEnv, and policies in evaluate_policy."""

import itertools

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.vec_env import DummyVecEnv, VecFrameStack

from tests.test_env import same
from wsn_env import Cluster, ClusterEnv, ClusterVectorEnv, Scenario, make_policy
from wsn_env.agents.base import ViewPolicy
from wsn_env.evaluation.comparison import evaluate
from wsn_env.evaluation.policies import policy_names
from wsn_env.learning.concat_vector_env import ConcatVectorEnv
from wsn_env.learning.sb3 import SB3VecEnv
from wsn_env.learning.training_reward import TrainingReward

SMALL = dict(particles=50, nodes=30, side_m=50.0, crossing_m=20.0, periods=13)


@pytest.mark.parametrize(
    "mode,observation,action",
    list(itertools.product(("SameStep", "Disabled"), ("candidates", "dict", "view"), ("menu", "subset"))),
)
def test_adapter_equals_dummy_vec_env(mode, observation, action):
    """300 steps: observations, rewards, dones, terminal observations, truncation and last infos, to the bit."""
    rows, settings = 9, dict(observation=observation, action=action, lam=(0.5, 8.0), **SMALL)
    ours = SB3VecEnv(ClusterVectorEnv(rows, autoreset_mode=mode, **settings))
    theirs = DummyVecEnv([lambda: ClusterEnv(**settings)] * rows)
    for envs in (ours, theirs):
        envs.seed(11)
    assert same(ours.reset(), theirs.reset())
    rng, ended = np.random.default_rng(0), 0
    ours.action_space.seed(0)
    for _ in range(300):
        actions = np.array([ours.action_space.sample() for _ in range(rows)])
        if action == "menu":
            actions = rng.integers(0, 28, rows)
        left, right = ours.step(actions), theirs.step(actions)
        assert all(same(a, b) for a, b in zip(left[:3], right[:3]))
        for i in np.flatnonzero(left[2]):
            a, b = left[3][i], right[3][i]
            assert same(a.pop("terminal_observation"), b.pop("terminal_observation"))
            assert a["TimeLimit.truncated"] is True and same(a, b)
            ended += 1
    assert ended >= rows * 20


def test_adapter_refuses_next_step_and_single_row_settings():
    with pytest.raises(ValueError, match="NextStep"):
        SB3VecEnv(ClusterVectorEnv(2, **SMALL))
    with pytest.raises(ValueError, match="stagger"):
        SB3VecEnv(ClusterVectorEnv(2, autoreset_mode="SameStep", **SMALL), stagger=True)
    envs = SB3VecEnv(ClusterVectorEnv(2, autoreset_mode="SameStep", **SMALL))
    with pytest.raises(AttributeError):
        envs.set_attr("lam", 3.0)


def test_staggered_rows_end_at_different_times():
    rows = 13
    envs = SB3VecEnv(ClusterVectorEnv(rows, autoreset_mode="Disabled", **SMALL), stagger=True)
    envs.reset()
    ends = np.array([envs.step(np.zeros(rows, int))[2] for _ in range(4 * SMALL["periods"])])
    assert (ends.sum(axis=1) == 1).all() and (ends.sum(axis=0) == 4).all()


def test_scaled_rewards_and_wrappers():
    rows = 3
    plain = SB3VecEnv(ClusterVectorEnv(rows, lam=4.0, autoreset_mode="SameStep", **SMALL))
    scaled = SB3VecEnv(TrainingReward(ClusterVectorEnv(rows, lam=4.0, autoreset_mode="SameStep", **SMALL)))
    stacked = VecFrameStack(SB3VecEnv(ClusterVectorEnv(rows, autoreset_mode="SameStep", **SMALL)), 2)
    for envs in (plain, scaled, stacked):
        envs.seed(0)
        envs.reset()
    a, b, _ = (envs.step(np.full(rows, 13)) for envs in (plain, scaled, stacked))
    assert np.allclose(a[1], b[1] * np.sqrt(1 + 0.3 * 4.0), rtol=1e-6) and a[1].dtype == np.float32
    assert np.array(plain.env_method("action_masks", indices=[0, 2])).shape == (2, 28)


@pytest.mark.parametrize("name", policy_names())
def test_sb3_evaluate_policy_runs_policies_unchanged(name):
    """The same episode returns as our own evaluation, through SB3's own environments."""
    scenario = Scenario.named("PreDC-v0", **SMALL)
    expected = evaluate([name], scenario, [3.0], episodes=2).rows
    policy = make_policy(name, scenario)
    kinds = dict(scenario=scenario, action="cluster", observation="view", lam=3.0)
    returns = []
    for row in expected:
        envs = make_vec_env(lambda: ClusterEnv(**kinds), n_envs=1)
        envs.seed(row["seed"])
        returns += evaluate_policy(policy, envs, n_eval_episodes=1, return_episode_rewards=True)[0]
    assert returns == pytest.approx([row["return"] for row in expected], abs=1e-6)  # Monitor rounds


def test_predict_takes_one_environment_or_many():
    scenario = Scenario.named("PreDC-v0", **SMALL)
    policy = make_policy("pre_dc", scenario)
    env = ClusterEnv(scenario, action="cluster", observation="view")
    observation, _ = env.reset(seed=4)
    action, memory = policy.predict(observation, state=None, episode_start=None, deterministic=True)
    assert env.action_space.contains(action) and memory is None
    envs = ClusterVectorEnv(3, scenario, action="cluster", observation="view")
    many, _ = envs.reset(seed=4)
    actions, _ = policy.predict(many)
    assert len(actions) == 3 and same(actions[0], action)
    envs.step(actions)


def test_predict_keeps_the_head_where_a_policy_says_so():
    class Keep(ViewPolicy):
        def act(self, view):
            return Cluster(np.full(len(view.head), -1), np.full((len(view.head), 0), -1))

    env = ClusterEnv(action="cluster", observation="view", **SMALL)
    observation, _ = env.reset(seed=0)
    for nearest_first in (True, False):
        action, _ = Keep(env.scenario).predict(observation)
        order = np.hypot(*(observation["positions"] - observation["predicted_mean"][::2]).T).argsort()
        assert action["head"] == (order[0] if nearest_first else observation["head"])
        observation, *_ = env.step({"head": order[5], "members": np.zeros(30, int)})


@pytest.mark.parametrize("mode", list(AutoresetMode))
@pytest.mark.parametrize("observation", ("candidates", "dict"))
def test_a_fleet_is_its_parts_one_after_the_other(mode, observation):
    """Of other horizons: rows end at different times."""

    def parts():
        scenarios = [dict(SMALL, nodes=20, periods=5), SMALL]
        settings = dict(autoreset_mode=mode, observation=observation, lam=(0.5, 8.0))
        return [ClusterVectorEnv(3 + i, **settings, **one) for i, one in enumerate(scenarios)]

    fleet, alone = ConcatVectorEnv(parts()), parts()
    ours, theirs = fleet.reset(seed=5), [alone[0].reset(seed=5), alone[1].reset(seed=5 + 3)]
    rng = np.random.default_rng(0)
    for _ in range(30):
        actions = rng.integers(0, 28, 7)
        ours, theirs = fleet.step(actions), (alone[0].step(actions[:3]), alone[1].step(actions[3:]))
        for rows, part in ((slice(0, 3), theirs[0]), (slice(3, 7), theirs[1])):
            assert same(of_rows(ours[0], rows), part[0])
            assert all(same(ours[i][rows], part[i]) for i in (1, 2, 3))
            for name, value in ours[4].items():
                if name == "final_info":
                    found = part[4].get(name, {})
                    assert all(same(value[each][rows], found[each]) for each in found)
                elif name in part[4]:
                    assert same(value[rows], part[4][name])
                elif name.startswith("_"):
                    assert not value[rows].any()
        if mode == AutoresetMode.DISABLED and ours[3].any():
            mask = ours[3]
            begun = fleet.reset(options={"reset_mask": mask})[0]
            for rows, part in ((slice(0, 3), alone[0]), (slice(3, 7), alone[1])):
                if mask[rows].any():
                    assert same(of_rows(begun, rows), part.reset(options={"reset_mask": mask[rows]})[0])
    assert fleet.action_masks().shape == (7, 28) and fleet.lam.shape == (7,)
    other = ClusterVectorEnv(2, action="subset", observation=observation, autoreset_mode=mode, lam=(0.5, 8.0), **SMALL)
    with pytest.raises(ValueError, match="single_action_space.*differs"):
        ConcatVectorEnv([*parts(), other])


def of_rows(observation, rows):
    return (
        {name: of_rows(value, rows) for name, value in observation.items()}
        if isinstance(observation, dict)
        else observation[rows]
    )


def remember(result, infos):
    infos.update(result[4])
    return result


def test_calibrated_rewards_cost_what_the_true_errors_do_among_sharp_and_wide_beliefs():
    """Once thousands of metres of errors are known."""
    settings = dict(scenario="Rssi-v0", nodes=81, particles=500, lam=0.0, filter_q=0.05, autoreset_mode="Disabled")
    envs = [ClusterVectorEnv(64, reward="belief", **settings) for _ in range(2)]
    believed, calibrated = SB3VecEnv(envs[0]), SB3VecEnv(TrainingReward(envs[1], calibrated=True))
    rng, infos = np.random.default_rng(0), {}
    step = believed.envs.step
    believed.envs.step = lambda actions: remember(step(actions), infos)
    for envs in (believed, calibrated):
        envs.seed(0)
        envs.reset()
    true, taken, given = np.zeros(2), np.zeros(2), np.zeros(2)
    for period in range(1500):
        actions = rng.integers(0, 28, 64)
        rewards = [envs.step(actions)[1] for envs in (believed, calibrated)]
        if period >= 500:
            wide = (infos["posterior_rms_m"] > 3.0).astype(int)
            for sums, errors in zip((true, taken, given), (infos["error_m"], -rewards[0], -rewards[1])):
                sums += np.bincount(wide, errors, 2)
    assert abs(np.diff(taken / true)) > 0.08  # so that one ratio for all would not do
    assert given == pytest.approx(true, rel=0.02)
    with pytest.raises(ValueError, match="Disabled"):
        TrainingReward(ClusterVectorEnv(2, autoreset_mode="SameStep", **SMALL), calibrated=True)


def test_ppo_learns_from_the_view():
    """Its observation has no Discrete that begins below 0, which stable-baselines3 cannot encode."""
    envs = SB3VecEnv(ClusterVectorEnv(2, observation="view", autoreset_mode="SameStep", **SMALL))
    model = PPO("MultiInputPolicy", envs, n_steps=16, batch_size=16, n_epochs=1, seed=0, device="cpu")
    model.learn(32)
    observation, _ = ClusterEnv(observation="view", **SMALL).reset(seed=1)
    assert observation["head"].shape == (1,) and model.predict(observation)[0].shape == ()
