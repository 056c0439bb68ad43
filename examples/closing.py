"""How every example begins and ends: the same field, and what it has learned beside random actions."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import gymnasium as gym
import torch

from wsn_env import score
from wsn_env.evaluation.intervals import Summary

ENV = "wsn_env/PreDC-v0"  # "wsn_env:wsn_env/PreDC-v0" where a process of a toolkit's own makes it
FIELD = dict(lam=4.0, observation="menu", reward="belief")  # of lower variance; scores are of the true error
EPISODES = 200

torch.set_num_threads(1)  # a second thread gains little, and crawls as soon as anything else runs


class Example:
    """Takes the time of a training, and closes with what came of it."""

    def __init__(self, name: str, **field):
        self.name = name
        self.held_out = gym.make_vec(ENV, EPISODES, vectorization_mode="vector_entry_point", **FIELD | field)
        self._started = time.perf_counter()

    def close(self, act: Callable, steps: int) -> None:
        """Print the closing line; exit status 1 where nothing was learned.

        Args:
            act: observations of all rows of `held_out` -> actions.
            steps: time steps trained.
        """
        seconds = time.perf_counter() - self._started
        self.held_out.action_space.seed(0)
        random = score(lambda _: self.held_out.action_space.sample(), self.held_out)
        trained = score(act, self.held_out)
        better = Summary.of(trained - random)
        print(
            f"{self.name}: return {trained.mean():.1f} after {steps:,} time steps in {seconds:.1f} s"
            f" ({steps / seconds:,.0f} a second); random actions {random.mean():.1f},"
            f" better by {better.mean:.1f} [{better.low:.1f}, {better.high:.1f}] over {EPISODES} held-out episodes"
        )
        sys.exit(0 if better.low > 0 else f"{self.name}: no better than random actions")
