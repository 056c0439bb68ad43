"""Threads: one environment serves one at a time and says so; one environment a thread, or taking turns, is as ever."""

import asyncio
import copy
import pickle
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from wsn_env import ClusterEnv, ClusterVectorEnv, make_policy

SMALL = dict(particles=64, nodes=40, side_m=50.0, crossing_m=20.0, periods=7)

TOGETHER = """
import threading, time
import numpy as np
from wsn_env import ClusterEnv, ClusterVectorEnv
env, action = {made}
env.reset(seed=1)
said, ends = set(), time.monotonic() + 3
def go(number):
    calls = [lambda: env.step(action), lambda: env.reset(seed=3), env.action_masks, lambda: env.view.nearest(5)]
    while time.monotonic() < ends:
        for call in calls if number % 2 else calls[:1]:
            try:
                call()
            except RuntimeError as problem:
                said.add(str(problem))
            except Exception as problem:
                assert "reset()" in str(problem), problem
threads = [threading.Thread(target=go, args=(number,)) for number in range(6)]
[thread.start() for thread in threads]
[thread.join() for thread in threads]
print("\\n".join(sorted(said)))
once = [env.reset(seed=5), env.step(action)][1]
other, _ = {made}
other.reset(seed=5)
twin = other.step(action)
assert np.array_equal(once[0], twin[0]) and np.array_equal(once[1], twin[1])
"""


@pytest.mark.parametrize(
    "made",
    [
        "ClusterEnv(particles=2000, periods=9), 5",
        "ClusterVectorEnv(16, particles=500, periods=9, threads=2), np.full(16, 5)",
    ],
)
def test_six_threads_in_one_environment_are_told_and_break_nothing(made):
    program = TOGETHER.replace("{made}", made)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr[-2000:]
    kind = made.partition("(")[0]
    words = "the environment is being stepped by another thread: give each thread an environment of its own"
    lines = done.stdout.splitlines()
    assert f"{kind}.step: {words}, or let them take turns" in lines
    assert all(line.startswith(f"{kind}.") and words in line for line in lines)


def play(env, seed):
    env.reset(seed=seed)
    return [env.step((seed + k) % 28)[1] for k in range(7)]


def test_an_environment_a_thread_is_that_of_a_thread_alone():
    """With one policy for all, too."""
    policy = make_policy("greedy", ClusterEnv(**SMALL).scenario)

    def greedy(seed):
        env = ClusterEnv(action="cluster", **SMALL)
        env.reset(seed=seed)
        rewards = []
        for _ in range(7):
            cluster = policy.act(env.view)
            members = np.zeros(40, np.int64)
            members[[node for node in cluster.members[0] if node >= 0]] = 1
            rewards.append(env.step({"head": int(cluster.head[0]), "members": members})[1])
        return rewards

    alone = [(play(ClusterEnv(**SMALL), seed), greedy(seed)) for seed in range(12)]
    with ThreadPoolExecutor(6) as pool:
        both = pool.map(lambda seed: (play(ClusterEnv(**SMALL), seed), greedy(seed)), range(12))
        assert list(both) == alone


def test_threads_that_take_turns_share_an_environment():
    """As asyncio.to_thread does."""
    env = ClusterEnv(**SMALL)

    async def turns():
        await asyncio.to_thread(env.reset, seed=4)
        return [(await asyncio.to_thread(env.step, (4 + k) % 28))[1] for k in range(7)]

    assert asyncio.run(turns()) == play(ClusterEnv(**SMALL), 4)


@pytest.mark.parametrize("make", [lambda: ClusterEnv(**SMALL), lambda: ClusterVectorEnv(3, **SMALL)])
def test_copies_are_free_of_what_holds_the_original(make):
    env = make()
    env.reset(seed=2)
    action = env.action_space.sample()
    with ThreadPoolExecutor(1) as pool:
        pool.submit(env._busy.acquire, False).result()
        with pytest.raises(RuntimeError, match=rf"{type(env).__name__}.reset: the environment is being stepped"):
            env.reset(seed=2)
        for twin in (copy.deepcopy(env), pickle.loads(pickle.dumps(env))):
            twin.step(action)
        pool.submit(env._busy.release).result()
    env.step(action)


@pytest.mark.parametrize("bad", ["nothing", 28, None])
def test_a_refused_action_holds_nothing(bad):
    env = ClusterEnv(**SMALL)
    env.reset(seed=2)
    with pytest.raises(ValueError, match="action"):
        env.step(bad)
    with ThreadPoolExecutor(1) as pool:
        pool.submit(env.step, 5).result()
