"""Registers the environments' ids with Gymnasium, once."""

from pathlib import Path

from gymnasium.envs.registration import register, registry

PRESETS = Path(__file__).parents[1] / "scenario" / "presets"

IDS = tuple(sorted(path.stem.replace("_", "-") for path in PRESETS.glob("*_v*.py")))  # without importing them


def register_envs() -> None:
    """Make `wsn_env/<id>` known to gym.make and gym.make_vec."""
    for name in IDS:
        if f"wsn_env/{name}" not in registry:
            register(
                id=f"wsn_env/{name}",
                entry_point="wsn_env.envs.env:ClusterEnv",
                vector_entry_point="wsn_env.envs.vector_env:ClusterVectorEnv",
                kwargs={"scenario": name},
            )
