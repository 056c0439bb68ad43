"""The environments' ids for gym.make: each preset's, one of it with actions that are numbers, and the user's own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium as gym
from gymnasium.envs.registration import parse_env_id, registry

PRESETS = Path(__file__).parents[1] / "scenario" / "presets"

IDS = tuple(sorted(path.stem.replace("_", "-") for path in PRESETS.glob("*_v*.py")))  # without importing them
MULTI = "wsn_env/Multi-v0"
STANDARD = *IDS, MULTI.removeprefix("wsn_env/")  # what the standard benchmark plays
CONTINUOUS = {f"{name.rpartition('-')[0]}Continuous-{name.rpartition('-')[2]}": name for name in IDS}


def register_envs() -> None:
    """Make the presets' ids known to gym.make, `wsn_env/<name>Continuous-v0` of each, with action "scores",
    and Multi-v0."""
    for name in IDS:
        _register(f"wsn_env/{name}", {"scenario": name})
    for name, scenario in CONTINUOUS.items():
        _register(f"wsn_env/{name}", {"scenario": scenario, "action": "scores"})
    several = "wsn_env.envs.multi_env"
    if MULTI not in registry:
        gym.register(
            MULTI,
            f"{several}:MultiEnv",
            vector_entry_point=f"{several}:MultiVectorEnv",
            kwargs={"scenario": "PreDC-v0"},
        )


def register(id: str, **arguments: Any) -> None:
    """A variant of an environment under an id of its own, for tools that take an id and no arguments.

    Processes that make it have to register it too: `gym.make("my_module:My-v0")` imports my_module first.

    Args:
        id: as `gymnasium.register` takes it: "My-v0", "me/My-v0".
        arguments: of ClusterEnv: `register("My-v0", scenario="Rssi-v0", lam=2, action="scores")`.

    Raises:
        ValueError: for an argument that an environment would refuse, or an id that is another environment's.
    """
    from wsn_env.envs.env import ClusterEnv  # late: to register the presets' ids must stay cheap

    try:
        parse_env_id(id)
    except (gym.error.Error, TypeError):
        raise ValueError(f"id = {id!r:.80}: must be a text NAME-vN, or NAMESPACE/NAME-vN") from None
    ClusterEnv(**arguments).close()
    known = registry.get(id)
    if known is not None and (known.entry_point, repr(known.kwargs)) != (ENTRY_POINT, repr(arguments)):
        raise ValueError(f"id {id!r}: is another environment's")
    _register(id, arguments)


ENTRY_POINT = "wsn_env.envs.env:ClusterEnv"


def _register(id: str, arguments: dict[str, Any]) -> None:
    if id not in registry:
        gym.register(id, ENTRY_POINT, vector_entry_point="wsn_env.envs.vector_env:ClusterVectorEnv", kwargs=arguments)
