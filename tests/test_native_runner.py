"""RLlib's env runner for a native batch: what it samples is what the environment told, episode by episode."""

import numpy as np
import pytest

from tests.test_env import SMALL
from wsn_env import ClusterVectorEnv

pytestmark = pytest.mark.slow  # importing RLlib takes seconds

ROWS, SEED = 5, 11
SETTINGS = dict(lam=(0.5, 8.0), autoreset_mode="Disabled", **SMALL)


@pytest.fixture(scope="module")
def make():
    pytest.importorskip("ray")
    from ray.rllib.algorithms.ppo import PPOConfig

    from wsn_env.learning.native_runner import NativeRunner

    def runner(**settings):
        config = (
            PPOConfig()
            .environment("wsn_env:wsn_env/PreDC-v0", env_config=SETTINGS | settings)
            .env_runners(num_env_runners=0, num_envs_per_env_runner=ROWS, gym_env_vectorize_mode="vector_entry_point")
            .debugging(seed=SEED)
        )
        return NativeRunner(config=config, worker_index=0)

    return runner


def test_chunks_are_the_environments_episodes(make):
    """Fragments of other lengths than an episode: put together by id, each is one played by the same actions."""
    runner = make()
    parts: dict[str, list] = {}
    for periods in (4, 9, 3, 10):
        for chunk in runner.sample(num_timesteps=ROWS * periods):
            assert chunk.t_started == sum(map(len, parts.setdefault(chunk.id_, [])))
            parts[chunk.id_].append(chunk)
    assert sum(len(chunk) for own in parts.values() for chunk in own) == ROWS * 26
    assert sum(own[-1].is_truncated for own in parts.values()) == ROWS * (26 // SMALL["periods"])
    envs = ClusterVectorEnv(ROWS, "PreDC-v0", **SETTINGS)
    now, _ = envs.reset(seed=SEED)
    first = [next(own for own in parts.values() if np.array_equal(own[0].get_observations(0), one)) for one in now]
    actions, rewards, before, after = (
        np.stack([np.concatenate([take(chunk) for chunk in own]) for own in first], axis=1)
        for take in (
            lambda chunk: chunk.get_actions(),
            lambda chunk: chunk.get_rewards(),
            lambda chunk: chunk.get_observations()[:-1],
            lambda chunk: chunk.get_observations()[1:],
        )
    )
    assert len(actions) == SMALL["periods"]
    for t, action in enumerate(actions):
        assert np.array_equal(before[t], now)
        now, reward, _, truncated, _ = envs.step(action)
        assert np.array_equal(after[t], now) and np.array_equal(rewards[t], reward.astype(np.float32))
    assert truncated.all()


def test_probabilities_are_the_modules(make):
    import torch

    runner = make()
    for chunk in runner.sample(num_timesteps=ROWS * 5):
        logits = torch.as_tensor(chunk.get_extra_model_outputs("action_dist_inputs"))
        logp = torch.distributions.Categorical(logits=logits).log_prob(torch.as_tensor(chunk.get_actions()))
        assert np.allclose(chunk.get_extra_model_outputs("action_logp"), logp, atol=1e-5)
        with torch.no_grad():
            again = runner.module.forward_exploration({"obs": torch.as_tensor(chunk.get_observations()[:-1])})
        assert np.allclose(again["action_dist_inputs"], logits, atol=1e-5)


def test_what_it_cannot_do_is_refused(make):
    with pytest.raises(ValueError, match="Disabled"):
        make(autoreset_mode="NextStep")
    with pytest.raises(ValueError, match="periods"):
        make().sample(num_episodes=3)
