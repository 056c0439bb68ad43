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

from tests.worlds import leaves
from wsn_env import Scenario, View, World, draws, make_policy

HERE = Path(__file__).parents[1]
ROWS = 8
GOLDEN = {
    "PreDC-v0": "89cda4d94cb8242a78c2d3d206d12395c2a922889626186845f30d32bd846238",
    "Rssi-v0": "082090700aad4cf0768f2f3a23bb2ffbec805c8f4f955fdf251c4de899c23340",
}


def digest(name: str, rows: int = ROWS, threads: int = 1) -> str:
    """SHA-256 of every array of the first ROWS rows in every period of 100, with nearest3."""
    scenario = Scenario.named(name)
    world, policy = World(scenario, threads=threads), make_policy("nearest3", scenario)
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


@pytest.mark.slow
@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="names x86 processors")
@pytest.mark.parametrize("processor", ["nehalem", "haswell"])
def test_other_processors_give_the_same_bits(processor):
    """Code for the vector units of 2008 and of 2013; compiling it takes a minute each the first time."""
    environment = os.environ | {"NUMBA_CPU_NAME": processor, "NUMBA_CPU_FEATURES": ""}
    answer = subprocess.run(
        [sys.executable, "-m", "tests.test_golden"],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
        cwd=HERE,
    )
    assert answer.stdout.split() == [word for pair in GOLDEN.items() for word in pair]


if __name__ == "__main__":
    for name in GOLDEN:
        print(name, digest(name))
