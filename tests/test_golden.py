"""The same bits everywhere: a digest of whole episodes, for any number of threads and any processor.

A change of the physics, the filter or the draws changes the digests; then `python -m tests.test_golden` prints new
ones, and CHANGELOG.md says why.
"""

import hashlib
import os
import platform
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__

from tests.worlds import leaves
from wsn_env import Scenario, View, World, draws, make_policy

HERE = Path(__file__).parents[1]
ROWS = 8
GOLDEN = {
    "PreDC-v0": "101b9c7b6e0b8642c9f02c84c639d8e7eb46fd6be34e8fb9cece635bdd089d53",
    "Rssi-v0": "b77bcec67de8607f70ce66fe150ec92c914cda28c69541a879394241653935e0",
    "Binary-v0": "8ff3bdbc39ee141a24589ae425aba44692cbbf0809172ab651b870032cd6cfc7",
    "Anchors-v0": "8a2fcb1095420ec1049f78a6295032574074ae0e13421e4ed91b6771ac20d9f2",
    "Underwater-v0": "899ccca96bd33e93f057cfe9653cb8b15779db3b70715386a51cd66d555740ba",
    "Ble-v0": "cebc0fd3188c011a77420c254dadde73116174c2dd5231bd0c61f502e770e244",
}


def digest(name: str, rows: int = ROWS, threads: int = 1) -> str:
    """SHA-256 of every array of the first ROWS rows in every period of 100, with three nearest members."""
    scenario = Scenario.named(name)
    world, policy = World(scenario, threads=threads), make_policy("nearest3", scenario, hysteresis_m=8.0)
    state = world.reset([draws.key_of_seed(seed) for seed in range(rows)])
    sha = hashlib.sha256()
    for _ in range(100):
        state, outcome = world.step(state, policy.act(View.of(state)), donate=True)
        for _, array in (*leaves(state), *leaves(outcome)):
            sha.update(np.ascontiguousarray(array[:ROWS]).tobytes())
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


@pytest.fixture(scope="module")
def emulated():
    """{processor: its process}, all at once: each compiles for a minute the first time, on a core of its own."""
    started = {}
    for processor, lacks in PROCESSORS.items():
        lacking = [unit for unit in __cpu_dispatch__ if __cpu_features__[unit] and lacks(unit)]
        units = {"NUMBA_CPU_FEATURES": "", "NPY_DISABLE_CPU_FEATURES": " ".join(lacking)}
        started[processor] = subprocess.Popen(
            [sys.executable, "-m", "tests.test_golden"],
            env=os.environ | units | {"NUMBA_CPU_NAME": processor},
            stdout=subprocess.PIPE,
            text=True,
            cwd=HERE,
        )
    yield started
    for process in started.values():
        process.kill()
        process.wait()


@pytest.mark.slow
@pytest.mark.xdist_group("emulated")  # the processes of one fixture
@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="names x86 processors")
@pytest.mark.parametrize("processor", PROCESSORS)
def test_other_processors_give_the_same_bits_with_one_thread_and_with_two(processor, emulated):
    said, _ = emulated[processor].communicate()
    lines = [f"{name} {threads} {hash}" for name, hash in GOLDEN.items() for threads in (1, 2)]
    assert emulated[processor].returncode == 0 and said.splitlines() == lines


if __name__ == "__main__":
    for name in GOLDEN:
        for threads in (1, 2):
            print(name, threads, digest(name, 12, threads))
