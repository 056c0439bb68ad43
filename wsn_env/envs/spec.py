"""What an environment tells of how it was made: Gymnasium's spec, with the horizon, in values that JSON can hold."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from enum import Enum
from os import PathLike, fspath
from typing import Any

import numpy as np
from gymnasium.envs.registration import EnvSpec

from wsn_env.models.quantity import Section
from wsn_env.scenario.scenario import Scenario, section_as_dict


class TellsHorizon:
    """An environment whose spec, as Gymnasium sets it, tells its horizon."""

    _spec: EnvSpec | None = None
    horizon_as_argument = False  # of a batch, which `make_vec` gives the horizon that a spec tells

    @property
    def horizon(self) -> int:
        """Time steps of an episode."""
        raise NotImplementedError

    @property
    def spec(self) -> EnvSpec | None:
        """How `gym.make` or `gym.make_vec` made it, with the horizon as `max_episode_steps`."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = told_spec(spec, self.horizon)
        if self._spec is not None and self.horizon_as_argument:
            self._spec.kwargs.setdefault("max_episode_steps", self.horizon)


def told_spec(spec: EnvSpec | None, horizon: int) -> EnvSpec | None:
    """As `gym.make` has set it, with `max_episode_steps`, so that tools which look for the horizon there find it.

    Args:
        horizon: periods of an episode.
    """
    if spec is None:
        return None
    told = copy.copy(spec)
    told.max_episode_steps = horizon
    told.kwargs = {name: _plain(value) for name, value in spec.kwargs.items()}
    return told


def _plain(value: Any) -> Any:
    """As JSON gives it back."""
    if isinstance(value, Scenario):
        return _plain(value.as_dict())
    if isinstance(value, Section):
        return _plain(section_as_dict(value))
    if isinstance(value, Enum):  # an autoreset mode
        return value.value
    if isinstance(value, Mapping):
        return {name: _plain(each) for name, each in value.items()}
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    if isinstance(value, PathLike):
        return fspath(value)
    return [_plain(each) for each in value] if isinstance(value, (tuple, list)) else value
