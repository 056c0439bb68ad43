"""Minari datasets for learners from recorded episodes: Pre-DC's choices as actions of the discrete action set."""

from __future__ import annotations

import gymnasium as gym
import minari
import numpy as np
from closing import ENV, FIELD

from wsn_env.agents.pre_dc import PreDC
from wsn_env.envs.actions import GROUP


def action_of(policy: PreDC, view) -> int:
    """What Pre-DC chooses in a single environment: 0 keeps the cluster, 1 + GROUP + n the best head and n members."""
    chosen = policy.act(view)
    nodes = set(chosen.members[0][chosen.members[0] >= 0]) | {chosen.head[0]}
    if chosen.head[0] == view.head[0] and nodes == set(np.flatnonzero(view.member[0])):
        return 0
    return 1 + GROUP + min(len(nodes) - 1, GROUP - 1)


def record(episodes: int, seed: int, random: float = 0.0) -> minari.MinariDataset:
    """Episodes of single environments as a Minari dataset, in the folder of MINARI_DATASETS_PATH.

    Args:
        episodes: how many.
        seed: of the first; the others follow.
        random: share of actions that are drawn at random instead.
    """
    env = minari.DataCollector(gym.make(ENV, **FIELD))
    policy = PreDC(env.unwrapped.scenario)
    rng = np.random.default_rng(seed)
    env.action_space.seed(seed)
    for episode in range(episodes):
        env.reset(seed=1000 * seed + episode)
        ended = False
        while not ended:
            draw = rng.random() < random
            action = int(env.action_space.sample()) if draw else action_of(policy, env.unwrapped.view)
            *_, ended, _ = env.step(action)
    return env.create_dataset("wsn_env/pre-dc-v0", algorithm_name="Pre-DC")
