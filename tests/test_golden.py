"""The same bits everywhere: a digest of whole episodes, for any number of threads and any processor; compiled once.

A change of the physics, the filter or the draws changes the digests; then `python -m tests.test_golden` prints new
ones, and CHANGELOG.md says why.
"""

import hashlib
import os
import platform
import subprocess
import sys
from pathlib import Path

import pytest
from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__

from wsn_env import Scenario, View, World, make_policy
from wsn_env.compiled import draws
from wsn_env.models.quantity import parse_overrides

HERE = Path(__file__).parents[1]
ROWS = 8
OUTCOMES = """error_m energy_mj energy_j spent_j members detections delivered dropped handover searched resampled n_eff
posterior_rms_m believed_error_m alive target_m estimate_m""".split()
VIEWED = "mean cov predicted_mean predicted_cov battery head member".split()
GOLDEN = {
    "PreDC-v0": "309ed52c7574dee96f63af6fbe5c9f02229fdde1335d62225ca84aed9d0cf64a",
    "Rssi-v0": "d065e9d6428143dad590d86bb1c371c83ff27437d447e15254c82735e2d3f255",
    "Binary-v0": "27ba17e4735d9d7058506bc87f0c9c6f7cd8353b3d85d49dfbd2f5a0ea7618a4",
    "Anchors-v0": "a50d1cdf8321b3bf6a9e4b904c8731be0f632fe1e1b8529f06fa4ace06e687c4",
    "Underwater-v0": "c4029527bb2459dbe64a5957299246491eaad910ff2fa0807884b7bd549095a1",
    "Lifetime-v0": "7e8caedcfc2bbd8f6cb539135a4ee59a324a49f4b516535ae2c92b82b3bf9ffa",
    "PreDC-v0 filter_q=0.05": "346e8f0ac23abb47b017db93f73fe25799429b82416717d45f73e7f2379d2f8f",
    "Rssi-v0 filter_q=0.05": "efe611ea1e981ddb3740e66680d5951fbef425bf1165ebf7d5584ffe4c326a45",
    "Binary-v0 filter_q=0.3": "80f3a96dbc277155f7cc1020a286c30887180e4b584591f16be7f323cfe0dc24",
    "Anchors-v0 filter_q=1": "0282a0b8404a233d8b2d7dd0ab40b791daf929f8c68c2bc7f1c8067958147b81",
    "Underwater-v0 filter_q=0.01": "1166cca6c6d41f1fa1409332cee6f8a4a257b533dab97eae42953360828aed70",
    "Lifetime-v0 filter_q=0.2": "aaebf64b934c7f7857e3b0d47eb4aa70ddbbcc3d05b8c92f43f1acae3ddbb535",
    "Ble-v0": "f4624d31aa889db826b1b7473f1e807854dd3ae512853e9fcc1a12be8fe1218b",
}


def digest(name: str, rows: int = ROWS, threads: int = 1) -> str:
    """SHA-256 of what the first ROWS rows brought and know in every period of 100, with three nearest members, in a
    scenario, maybe with further settings.

    By name and value, so that another layout of the state is no other digest.
    """
    scenario_id, *settings = name.split()
    scenario = Scenario.named(scenario_id, **parse_overrides(settings))
    world, policy = World(scenario, threads=threads), make_policy("nearest3", scenario, hysteresis_m=8.0)
    state = world.reset([draws.key_of_seed(seed) for seed in range(rows)])
    sha = hashlib.sha256()
    for _ in range(100):
        state, outcome = world.step(state, policy.act(View.of(state)), donate=True)
        for source, names in ((outcome, OUTCOMES), (View.of(state), VIEWED)):
            for name in names:
                values = getattr(source, name)[:ROWS]
                sha.update(name.encode())
                sha.update(values.astype("<f8" if values.dtype.kind == "f" else "<i8").tobytes())
    return sha.hexdigest()


@pytest.mark.parametrize("name", GOLDEN)
def test_the_bits_are_those_on_record(name):
    assert digest(name) == GOLDEN[name]


@pytest.mark.parametrize("name", GOLDEN)
@pytest.mark.parametrize("threads", [1, 2])
def test_neither_threads_nor_further_rows_change_a_bit(name, threads):
    assert digest(name, 12, threads) == GOLDEN[name]


# Processors by their vector units of 2008 and 2013, and which of NumPy's they lack; this machine's own is a third.
PROCESSORS = {
    "nehalem": lambda unit: True,
    "haswell": lambda unit: "AVX512" in unit or unit == "X86_V4",
}


# A processor that nothing has been compiled for: `wsn compile` first, then `PLAY`, then the digests as on the others.
# In short, what it does for a scenario, and `PLAY_ONE`.
FRESH = "nehalem"
SHORT = "Binary-v0"  # of those that take the least
PLAY_ONE = """
import gymnasium as gym, wsn_env
from wsn_env.compiled import store
for keywords in (dict(), dict(observation="menu", order="information", render_mode="rgb_array", frame_px=64)):
    env = gym.make("wsn_env/Binary-v0", particles=60, periods=3, disable_env_checker=True, **keywords)
    env.reset(seed=0)
    env.step(10)
wsn_env.evaluate(["nearest2", "greedy", "adaptive"], "Binary-v0", episodes=2)
print("compiled:", *store.compiled)
"""
PLAY = """
import gymnasium as gym, wsn_env
from wsn_env.cli import main
from wsn_env.compiled import store
from wsn_env.envs.registration import IDS
from wsn_env.evaluation.policies import make_policy, policy_names
for keywords in (dict(action="menu", observation="dict", order="information"), dict(action="subset", fast=True)):
    env = gym.make("wsn_env/PreDC-v0", particles=60, periods=30, radius_m=3.0, **keywords)
    env.action_space.seed(0)
    env.reset(seed=0)
    for _ in range(30):
        env.step(env.action_space.sample())
for name in IDS:
    envs = gym.make_vec(f"wsn_env/{name}", num_envs=20, vectorization_mode="vector_entry_point", particles=60)
    envs.reset(seed=0)
    envs.step(envs.action_space.sample())
    scenario = wsn_env.Scenario.named(name, particles=60, periods=5)
    policies = {}
    for policy in policy_names():
        try:
            policies[policy] = make_policy(policy, scenario)
            policies[policy].act(wsn_env.View.of(wsn_env.World(scenario).reset([0])))
        except ValueError:  # no such network, or a planner that cannot plan there
            policies.pop(policy, None)
    wsn_env.evaluate(policies, scenario, episodes=2)
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
print("compiled:", *store.compiled)
"""


@pytest.mark.slow
@pytest.mark.parametrize("scenarios", [[SHORT], pytest.param([], marks=pytest.mark.full)], ids=["short", "all"])
@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="names x86 processors")
def test_other_processors_give_the_same_bits_and_wsn_compile_leaves_nothing_to_compile(scenarios, tmp_path):
    """With one thread and with two; emulated ones run at once, the fresh one compiling for minutes."""
    started = {}
    for processor, lacks in PROCESSORS.items():
        lacking = [unit for unit in __cpu_dispatch__ if __cpu_features__[unit] and lacks(unit)]
        units = {"NUMBA_CPU_FEATURES": "", "NPY_DISABLE_CPU_FEATURES": " ".join(lacking), "NUMBA_CPU_NAME": processor}
        units["NUMBA_CACHE_DIR"] = str(tmp_path / processor)
        started[processor] = subprocess.Popen(
            [sys.executable, "-m", "tests.test_golden", *([FRESH] if processor == FRESH else []), *scenarios],
            env=os.environ | units,
            stdout=subprocess.PIPE,
            text=True,
            cwd=HERE,
        )
        if scenarios:
            break
    for processor, process in started.items():
        printed = process.communicate()[0].splitlines()
        assert process.returncode == 0, processor
        lines = [f"{name} {threads} {GOLDEN[name]}" for name in scenarios or GOLDEN for threads in (1, 2)]
        assert printed[-len(lines) :] == lines, processor
        if processor == FRESH:
            compiling, played = printed[:2]
            assert int(compiling.split()[0]) > 10 and played == "compiled:"


def first_time(names: list[str]) -> None:
    """What `wsn compile` says, and what playing then compiles."""
    one = "from wsn_env.evaluation.warm_up import *; print(sum(compile_job(job) for job in JOBS if job.scenario in {}))"
    both = (["-c", one.format(names)], ["-c", PLAY_ONE]) if names else (["-m", "wsn_env", "compile"], ["-c", PLAY])
    for command in both:
        done = subprocess.run([sys.executable, *command], capture_output=True, text=True, check=True)
        print(done.stdout.splitlines()[-1])


if __name__ == "__main__":
    named = [name for name in GOLDEN if name in sys.argv[1:]]
    if sys.argv[1:2] == [FRESH]:
        first_time(named)
    for name in named or GOLDEN:
        for threads in (1, 2):
            print(name, threads, digest(name, 12, threads))
