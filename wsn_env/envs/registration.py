"""Registers the environments' ids with Gymnasium, once."""

from gymnasium.envs.registration import register, registry

IDS = ("PreDC-v0", "Rssi-v0", "Binary-v0", "Anchors-v0", "Underwater-v0", "Ble-v0")


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
