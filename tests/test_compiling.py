"""Kernels are compiled once and kept."""

import os
import subprocess
import sys

import pytest

PLAY = """
import gymnasium as gym, wsn_env
from wsn_env.cli import main
for keywords in (dict(action="menu", observation="dict", order="information"), dict(action="subset", fast=True)):
    env = gym.make("wsn_env/PreDC-v0", particles=60, periods=30, radius_m=3.0, **keywords)
    env.action_space.seed(0)
    env.reset(seed=0)
    for _ in range(30):
        env.step(env.action_space.sample())
envs = gym.make_vec("wsn_env/Rssi-v0", num_envs=20, vectorization_mode="vector_entry_point", particles=60)
envs.reset(seed=0)
envs.step(envs.action_space.sample())
for scenario in ("PreDC-v0", "Binary-v0", "Anchors-v0", "Underwater-v0"):
    policies = "pre_dc random centroid nearest2 boundary strongest_signal greedy adaptive_informed".split()
    main(["evaluate", "--scenario", scenario, "--episodes", "3", "--policies", *policies, "--set", "particles=60"])
for scenario, trackers in {
    "Binary-v0": ("boundary", "boundary_ekf", "centroid_rls"),
    "Anchors-v0": ("ckf", "ickf", "trilateration", "grnn_kf"),
    "Underwater-v0": ("ekf", "ukf", "snapshot"),
}.items():
    for tracker in trackers:
        kept = ["silent_information=false", "resampling=systematic"]
        quantities = ["particles=60", "periods=4", f"tracker={tracker}", *kept]
        main(["evaluate", "--scenario", scenario, "--episodes", "2", "--policies", "all", "--set", *quantities])
env = gym.make("wsn_env/Binary-v0", order="value", particles=60, start="search", render_mode="rgb_array")
env.reset(seed=0)
env.render()
"""


@pytest.mark.slow
def test_after_wsn_compile_nothing_is_compiled_any_more(tmp_path):
    """In a cache of its own, so that it is the first time."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}

    def run(*arguments):
        return subprocess.run([sys.executable, *arguments], env=environment, capture_output=True, text=True, check=True)

    assert "compiling (once" in run("-m", "wsn_env", "compile").stderr
    assert "compiling" not in run("-c", PLAY).stderr
