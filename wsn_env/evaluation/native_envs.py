"""The native vector environment behind Gymnasium's wrappers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, cast

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv

if TYPE_CHECKING:
    from wsn_env.envs.interface import Interface
    from wsn_env.scenario import Scenario


NATIVE = (
    'the native vector environment, of gym.make_vec(..., vectorization_mode="vector_entry_point") or'
    " ClusterVectorEnv(...)"
)


class NativeEnvs(Protocol):
    """What a ClusterVectorEnv has beyond Gymnasium's interface.

    A ConcatVectorEnv has neither scenario nor interface.
    """

    num_envs: int
    autoreset_mode: AutoresetMode

    @property
    def lam(self) -> np.ndarray:
        """(B,) the present episodes' trade-offs [m/mJ]."""
        ...

    @property
    def scenario(self) -> Scenario:
        """What its environments are."""
        ...

    @property
    def interface(self) -> Interface:
        """Its actions, observations and rewards."""
        ...

    def action_masks(self) -> np.ndarray:
        """(B, n) bool: which parts of each environment's action make sense now."""
        ...


def unwrap_native(envs: VectorEnv) -> NativeEnvs:
    """What wrappers stand around.

    Raises:
        ValueError: another environment.
    """
    native = envs.unwrapped
    if not hasattr(type(native), "lam") or hasattr(native, "targets"):
        raise ValueError(f"envs = {type(native).__name__}: must be {NATIVE}; of MultiVectorEnv its `rows`")
    return cast(NativeEnvs, native)
