"""Evaluation on a Ray cluster: the local rows to the byte, whoever is killed."""

import contextlib
import os
import pickle
import signal
import subprocess
import sys
import time

import pytest

from wsn_env import Scenario, evaluate, make_policy
from wsn_env.agents.ppo import PPOPolicy
from wsn_env.cli import main
from wsn_env.evaluation.kept_blocks import BLOCKS_FILE
from wsn_env.evaluation.ray_engine import on_ray
from wsn_env.evaluation.rollout import BLOCK

SCENARIO = Scenario.named("PreDC-v0", particles=50, nodes=40, side_m=50.0, crossing_m=20.0, periods=10)
ROOT = os.path.dirname(os.path.dirname(__file__))
pytestmark = pytest.mark.xdist_group("ray")  # one cluster at a time


@pytest.fixture
def cluster(monkeypatch):
    """Two nodes on this machine, with a core each."""
    pytest.importorskip("ray")
    from ray.cluster_utils import Cluster

    monkeypatch.setenv("RAY_ENABLE_UV_RUN_RUNTIME_ENV", "0")
    nodes = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    nodes.other = nodes.add_node(num_cpus=1)
    nodes.wait_for_nodes()
    yield nodes
    nodes.shutdown()


@pytest.mark.slow
def test_a_node_that_is_killed_costs_a_retry_and_not_a_row(cluster, tmp_path):
    lams, episodes = [1.0, 10.0], 8 * BLOCK
    policies = ["ppo", "pre_dc", "nearest1"]
    evaluate(policies, SCENARIO, lams, episodes).save(tmp_path / "local")
    seen = []

    def kill(done, total, what):
        seen.append((done, total))
        if done == 8:
            cluster.remove_node(cluster.other, allow_graceful=False)

    spread = evaluate(policies, SCENARIO, lams, episodes, progress=kill, engine=on_ray(cluster.address))
    spread.save(tmp_path / "spread")
    assert seen == [(done, 32) for done in range(1, 33)]
    local, other = ((tmp_path / name / "evaluation.csv").read_bytes() for name in ("local", "spread"))
    assert local == other


@pytest.mark.slow
@pytest.mark.full
def test_a_worker_that_is_killed_costs_a_retry(tmp_path):
    ray = pytest.importorskip("ray")
    ray.init("local", num_cpus=2, log_to_driver=False)
    try:
        marks = tmp_path / "killed"
        policies = {"suicidal": _Suicidal(SCENARIO, str(marks)), "pre_dc": make_policy("pre_dc", SCENARIO)}
        spread = evaluate(policies, SCENARIO, [4.0], 3 * BLOCK, engine=on_ray())
        assert marks.exists()
        local = evaluate(policies, SCENARIO, [4.0], 3 * BLOCK)
        assert repr(spread.rows) == repr(local.rows)
    finally:
        ray.shutdown()


@pytest.mark.slow
def test_policies_of_a_file_travel_to_the_workers(tmp_path):
    ray = pytest.importorskip("ray")
    (tmp_path / "mine.py").write_text(
        "from wsn_env import make_policy\n"
        "class Mine:\n"
        "    def __init__(self, scenario):\n        self.other = make_policy('nearest2', scenario)\n"
        "    def act(self, view):\n        return self.other.act(view)\n"
    )
    ray.init("local", num_cpus=1, log_to_driver=False)
    try:
        own = f"mine={tmp_path}/mine.py:Mine"
        spread = evaluate([own, "nearest2"], SCENARIO, [4.0], 3, engine=on_ray())
        assert list(spread.values("mine", 4.0, "return")) == list(spread.values("nearest2", 4.0, "return"))
    finally:
        ray.shutdown()


class _Suicidal:
    """Pre-DC, but kill -9 to the first process that plays it."""

    def __init__(self, scenario, marks):
        self.policy, self.marks = make_policy("pre_dc", scenario), marks

    def act(self, view):
        if not os.path.exists(self.marks):
            open(self.marks, "w").close()
            os.kill(os.getpid(), signal.SIGKILL)
        return self.policy.act(view)


@pytest.mark.slow
def test_the_command_stops_and_continues(tmp_path):
    pytest.importorskip("ray")
    asked = ["evaluate", "--policies", "nearest1", "pre_dc", "--episodes", "120", "--set", "periods=10", "particles=50"]
    assert main([*asked, "--out", str(tmp_path / "local")]) == 0
    assert main([*asked, "--out", str(tmp_path / "ray"), "--engine", "ray"]) == 0
    local, other = ((tmp_path / name / "evaluation.csv").read_bytes() for name in ("local", "ray"))
    assert local == other


def test_an_address_needs_the_engine(capsys):
    assert main(["evaluate", "--address", "auto"]) == 2
    assert "--engine ray" in capsys.readouterr().err


@pytest.mark.parametrize("address", ["127.0.0.1:1", "nowhere", "127.0.0.1:port"])
def test_nobody_at_the_address_is_said_at_once(address, capsys):
    pytest.importorskip("ray")
    assert main(["evaluate", "--engine", "ray", "--address", address, "--episodes", "3"]) == 2
    assert f"nobody answers at '{address}'" in capsys.readouterr().err


def test_a_learned_policy_travels_without_its_file(tmp_path):
    shipped = make_policy("ppo", SCENARIO)
    for suffix in ("json", "safetensors"):
        source = os.path.join(ROOT, "agents", "pretrained", "PreDC-v0", f"policy.{suffix}")
        (tmp_path / f"policy.{suffix}").write_bytes(open(source, "rb").read())
    policy = PPOPolicy(SCENARIO, path=str(tmp_path / "policy.json"))
    sent = pickle.dumps(policy)
    for file in tmp_path.iterdir():
        file.unlink()
    arrived = pickle.loads(sent)
    rows = evaluate({"it": arrived}, SCENARIO, [4.0], 3).values("it", 4.0, "return")
    assert (rows == evaluate({"it": shipped}, SCENARIO, [4.0], 3).values("it", 4.0, "return")).all()


OWN = """
import helper
from wsn_env import make_policy

class Mine:
    def __init__(self, scenario, fails=False):
        self.scenario, self.fails = scenario, fails
        self.other = make_policy(f"nearest{helper.COUNT}", scenario)

    def act(self, view):
        if self.fails:
            return {}["gone"]
        assert open("data.txt").read() == "here"
        return helper.act(self.other, view)
"""
HELPER = """
COUNT = 2

def act(policy, view):
    return policy.act(view)
"""


@pytest.mark.slow
def test_relative_paths_and_files_beside_an_own_one_reach_workers_begun_elsewhere(tmp_path, monkeypatch, capsys):
    ray = pytest.importorskip("ray")
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "mine.py").write_text(OWN)
    (tmp_path / "own" / "helper.py").write_text(HELPER)
    (tmp_path / "data.txt").write_text("here")
    (tmp_path / "track.csv").write_text("t,x,y\n0,10,10\n10,40,40\n")
    monkeypatch.chdir(tmp_path / "elsewhere")
    ray.init("local", num_cpus=1, log_to_driver=False)
    try:
        monkeypatch.chdir(tmp_path)
        scenario = SCENARIO.override(motion="recorded", tracks=("track.csv",))
        spread = evaluate(["own/mine.py:Mine", "nearest2"], scenario, [4.0], 3, engine=on_ray())
        returns = [list(spread.values(name, 4.0, "return")) for name in spread.policies]
        assert returns[0] == returns[1]
        asked = ["--policies", "own/mine.py:Mine:fails=true", "--episodes", "2", "--engine", "ray"]
        assert main(["evaluate", *asked]) == 2
        last = capsys.readouterr().err.strip().splitlines()[-1]
        assert last == f"wsn: {tmp_path}/own/mine.py:12: KeyError: 'gone'"
        with monkeypatch.context() as patch:
            patch.setattr("wsn_env.evaluation.ray_engine.software", lambda: {"numba": "0.1"})
            with pytest.raises(ValueError, match="has numba .* instead of 0.1: must be the same on every node"):
                evaluate(["nearest2"], SCENARIO, [4.0], 2, engine=on_ray())
    finally:
        ray.shutdown()


@pytest.mark.slow
@pytest.mark.full
@pytest.mark.parametrize("process", ["gcs_server", "raylet"])
def test_a_lost_cluster_is_a_line_and_the_same_command_continues(process, tmp_path, monkeypatch):
    pytest.importorskip("ray")
    from ray.cluster_utils import Cluster

    monkeypatch.setenv("RAY_ENABLE_UV_RUN_RUNTIME_ENV", "0")
    policies = ["nearest0", "nearest1", "nearest2", "nearest3", "centroid"]
    small = ["--set", "particles=300", "nodes=40", "periods=60"]
    command = [sys.executable, "-m", "wsn_env", "evaluate", "--policies", *policies, "--episodes", "300", *small]

    def begin(out, cluster):
        ray = ["--engine", "ray", "--address", cluster.address, "--out", str(out)]
        return subprocess.Popen([*command, *ray], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    blocks = tmp_path / "out" / BLOCKS_FILE
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    run = begin(tmp_path / "out", cluster)
    while run.poll() is None and not (blocks.exists() and blocks.read_bytes().count(b"\n") >= 3):
        time.sleep(0.1)
    for each in cluster.head_node.all_processes[process]:
        os.kill(each.process.pid, signal.SIGKILL)
    _, said = run.communicate(timeout=100)
    with contextlib.suppress(Exception):  # parts of it are dead
        cluster.shutdown()
    assert run.returncode == 2 and said.count("\n") == 1
    assert said.startswith("wsn: engine 'ray': the cluster is lost (") and "the same command continues" in said
    kept = blocks.read_bytes().splitlines()
    assert 3 <= len(kept) < 30

    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    run, other = begin(tmp_path / "out", cluster), tmp_path / "other"
    while run.poll() is None and not (blocks.exists() and len(blocks.read_bytes().splitlines()) > len(kept)):
        time.sleep(0.1)
    assert not blocks.exists() or set(kept) <= set(blocks.read_bytes().splitlines())
    assert run.wait(timeout=200) == 0
    cluster.shutdown()
    assert main([*command[3:], "--out", str(other)]) == 0
    for name in ("evaluation.csv", "evaluation.json", "evaluation.md"):
        assert (tmp_path / "out" / name).read_bytes() == (other / name).read_bytes()
