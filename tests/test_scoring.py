"""Scores of policies from other toolkits: the returns of `evaluate`, episode by episode."""

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers.vector import NormalizeObservation, NormalizeReward

from tests.test_env import SMALL
from wsn_env import ClusterVectorEnv, Scenario, evaluate, make_policy, score

EPISODES = 6


@pytest.mark.parametrize("mode", list(AutoresetMode))
@pytest.mark.parametrize("reward", ["error", "belief", "vector"])
def test_a_policy_scores_what_evaluate_gives(mode, reward):
    scenario = Scenario.of("PreDC-v0", lam=2.0, **SMALL)
    policy = make_policy("pre_dc", scenario)
    envs = ClusterVectorEnv(
        EPISODES, scenario, action="cluster", observation="view", reward=reward, autoreset_mode=mode
    )
    evaluation = evaluate({"it": policy}, scenario, episodes=EPISODES, seed=3)
    scores = score(lambda observations: policy.predict(observations)[0], envs, seed=3)
    assert (scores == evaluation.values("it", 2.0, "return")).all()
    assert len(set(scores)) == EPISODES


def test_wrappers_change_nothing_but_what_the_policy_sees():
    plain = ClusterVectorEnv(EPISODES, "PreDC-v0", lam=(0.5, 8.0), **SMALL)
    wrapped = NormalizeReward(NormalizeObservation(ClusterVectorEnv(EPISODES, "PreDC-v0", lam=(0.5, 8.0), **SMALL)))
    three = np.full(EPISODES, 13)
    assert (score(lambda _: three, plain) == score(lambda _: three, wrapped)).all()
    assert (score(lambda _: three, plain) != score(lambda _: three, plain, seed=1)).all()
