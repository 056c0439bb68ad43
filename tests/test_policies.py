"""Hand-written policies do what their papers and names say."""

import subprocess
import sys
import textwrap
from dataclasses import replace

import numpy as np
import pytest

from wsn_env import Scenario, View, World, evaluate, make_policy
from wsn_env.agents.base import ViewPolicy
from wsn_env.agents.boundary import Boundary
from wsn_env.agents.nearest import Nearest
from wsn_env.agents.pre_dc import PreDC
from wsn_env.agents.strongest_signal import StrongestSignal
from wsn_env.cli import main
from wsn_env.compiled import draws
from wsn_env.evaluation.kept_blocks import BLOCKS_FILE
from wsn_env.evaluation.policies import named_policies, policy_names
from wsn_env.models.state import Cluster
from wsn_env.scenario.sensing import detection_probability
from wsn_env.training.comparison import make_baselines

SCENARIO = Scenario.named("PreDC-v0", particles=200)


@pytest.fixture(scope="module")
def view():
    """Forty rows, some periods into their episodes, led by nearest3."""
    return View.of(walked())


def walked(periods=9, scenario=SCENARIO, policy="nearest3"):
    world = World(scenario, threads=1)
    state = world.reset([draws.key_of_seed(seed) for seed in range(40)])
    chooser = make_policy(policy, scenario)
    for _ in range(periods):
        state, _ = world.step(state, chooser.act(View.of(state)), donate=True)
    return state


def chosen(cluster: Cluster, row: int) -> set[int]:
    return {int(node) for node in cluster.members[row] if node >= 0} | {int(cluster.head[row])}


def test_every_name_is_an_entry_point():
    expected = set("adaptive adaptive_informed greedy informed nearest pre_dc boundary centroid static_cluster".split())
    expected |= set("strongest_signal strongest quadrants every random all planner mcts ppo".split())
    assert expected <= set(policy_names())
    for name, n, order in (("nearest4", 4, "nearest"), ("informed12", 12, "information")):
        made = make_policy(name, SCENARIO)
        assert (made.n, made.order) == (n, order)
        assert made == make_policy(f"{name.rstrip('0123456789')}:n={n}", SCENARIO)
    with pytest.raises(ValueError, match="did you mean pre_dc"):
        make_policy("predc", SCENARIO)


def test_pre_dc_forms_until_the_joint_probability_passes_theta(view):
    policy = PreDC(SCENARIO, phi0_m=1e-9)  # never keeps
    cluster = policy.act(view)
    for row in range(40):
        order = np.argsort(view.distance[row])
        assert cluster.head[row] == order[0]
        p = detection_probability(view.distance[row][order], SCENARIO)
        joint = 1 - np.cumprod(1 - p)
        size = int(np.argmax(joint > 0.9)) + 1 if (joint > 0.9).any() else int((p > 0).sum())
        assert chosen(cluster, row) == set(order[:size].tolist()), row


def test_pre_dc_keeps_while_sharp_and_covering_and_else_not(view):
    kept = PreDC(SCENARIO, phi0_m=1e9, theta=1e-12).act(view)
    assert all(chosen(kept, row) == set(np.flatnonzero(view.member[row])) for row in range(40))
    default = PreDC(SCENARIO).act(view)
    p = detection_probability(view.distance, SCENARIO)
    joint = 1 - np.prod(np.where(view.member, 1 - p, 1), axis=1)
    keep = (view.spread_m < 2) & (joint >= 0.9)
    assert 2 < keep.sum() < 38
    for row in range(40):
        stays = chosen(default, row) == set(np.flatnonzero(view.member[row]))
        assert stays == keep[row] or not keep[row]


def test_pre_dc_takes_all_who_can_when_theta_is_out_of_reach():
    scenario = SCENARIO.override(nodes=25)  # two or three nodes in reach
    view = View.of(walked(3, scenario))
    cluster = PreDC(scenario, phi0_m=1e-9, theta=0.999).act(view)
    p = detection_probability(view.distance, scenario)
    for row in range(40):
        assert chosen(cluster, row) == set(np.flatnonzero(p[row] > 0)) | {int(cluster.head[row])}


def test_pre_dc_passes_over_a_head_without_energy(view):
    nearest = view.nearest_living()
    battery = view.battery.copy()
    battery[np.arange(40), nearest] = 1e-6  # alive, but a handover costs more
    knowledge = View.of(walked()).knowledge
    poor = View(replace(knowledge, network=replace(knowledge.network, battery=battery)))
    head = PreDC(SCENARIO, phi0_m=1e-9).act(poor).head
    assert (head != nearest).all()
    assert (head == poor.nearest(2)[0][:, 1]).all()


def test_centroid_has_no_motion_model(view):
    policy = make_policy("centroid", SCENARIO)
    cluster = policy.act(view)
    for row in range(40):
        heard = view.detected[row]
        if not heard.any():
            assert chosen(cluster, row) == set(np.flatnonzero(view.member[row]))
            continue
        distance = np.hypot(*(view.positions[row] - view.positions[row][heard].mean(axis=0)).T)
        assert cluster.head[row] == distance.argmin()
        assert chosen(cluster, row) == set(np.flatnonzero(distance <= 10)) | {int(cluster.head[row])}


def test_centroid_follows_the_binary_sensors_that_see_the_target():
    """Those that have reported nothing new, too."""
    scenario = Scenario.named("Binary-v0", particles=200)
    view = View.of(walked(9, scenario, "centroid"))
    assert (view.sees.sum(axis=1) > view.detected.sum(axis=1)).any()
    head = make_policy("centroid", scenario).act(view).head
    for row in np.flatnonzero(view.sees.any(axis=1)):
        distance = np.hypot(*(view.positions[row] - view.positions[row][view.sees[row]].mean(axis=0)).T)
        assert head[row] == distance.argmin()


def test_boundary_wakes_the_ring():
    scenario = Scenario.named("Binary-v0", particles=200, period_s=2.0, periods=25)
    view = View.of(walked(5, scenario, "boundary"))
    dead = view.battery.copy()
    dead[:, ::3] = 0.0
    view = View(replace(view.knowledge, network=replace(view.network, battery=dead)))
    cluster = Boundary(scenario, width_m=4.0, sds=2.0).act(view)
    for row in range(40):
        speed = np.hypot(*view.predicted_mean[row, 1::2])
        band = 4.0 + speed * 2.0 / 2 + 2.0 * view.spread_m[row]
        ring = (dead[row] > 0) & (abs(view.distance[row] - 60.0) <= band)
        assert chosen(cluster, row) == set(np.flatnonzero(ring))
        assert cluster.head[row] == np.where(ring, view.distance[row], np.inf).argmin()


def test_boundary_falls_back_on_the_nearest_node():
    scenario = Scenario.named("Binary-v0", particles=200, positions=((250, 250), (240, 250)), nodes=2)
    state = World(scenario, threads=1).reset([1])
    state.belief.predicted_mean[0] = [249, 0, 250, 0]
    state.belief.predicted_cov[0] = np.eye(4)
    view = View.of(state)
    cluster = make_policy("boundary", scenario).act(view)
    assert chosen(cluster, 0) == {0}


def test_boundary_hears_as_much_as_all_at_less_cost():
    """Where the target is followed, few change their state outside of the ring; sensing has its price here."""
    errors, energies = {}, {}
    for name in ("all", "boundary"):
        scenario = Scenario.named("Binary-v0", particles=2000, sensing_nj=1000.0)
        world, policy = World(scenario, threads=1), make_policy(name, scenario)
        state = world.reset([draws.key_of_seed(seed) for seed in range(10)])
        played = []
        for _ in range(scenario.periods):
            state, outcome = world.step(state, policy.act(View.of(state)), donate=True)
            played.append((outcome.error_m, outcome.energy_mj))
        errors[name], energies[name] = np.array(played).mean(axis=(0, 2))
    assert errors["boundary"] < 1.5 * errors["all"] and energies["boundary"] < 0.9 * energies["all"]


def test_static_cluster_and_all(view):
    p = detection_probability(view.distance, SCENARIO)
    static, everybody = (make_policy(name, SCENARIO).act(view) for name in ("static_cluster", "all"))
    for row in range(40):
        assert chosen(static, row) == set(np.flatnonzero(p[row] > 0)) | {int(view.distance[row].argmin())}
        assert len(chosen(everybody, row)) == 225
    assert (static.head == view.distance.argmin(axis=1)).all()


@pytest.mark.parametrize("n", range(9))
def test_nearest_counts_further_members_and_keeps_its_head(view, n):
    cluster = make_policy(f"nearest{n}", SCENARIO, hysteresis_m=8.0).act(view)
    eager = Nearest(SCENARIO, n=n, hysteresis_m=0.0).act(view)
    distance = view.distance[view.rows, view.head]
    assert (cluster.head == np.where(distance <= 8, view.head, view.distance.argmin(axis=1))).all()
    assert (eager.head == view.distance.argmin(axis=1)).all()
    for row in range(40):
        others = [node for node in np.argsort(view.distance[row]) if node != cluster.head[row]][:n]
        assert chosen(cluster, row) == {*others, int(cluster.head[row])}


def test_a_policy_that_says_so_does_not_look_at_lam(view):
    """An evaluation plays it once for all lams. What says nothing counts as looking."""
    other = View(replace(view.knowledge, row=view.row.copy()))
    other.row["lam"] = np.geomspace(0.01, 1000, 40)
    seeing = set()
    for name in policy_names():
        if not name.startswith("ppo"):
            policy = make_policy(name, SCENARIO)
            one, two = policy.act(view), policy.act(other)
            if policy.sees_lam:
                seeing.add(name)
            else:
                assert (one.head == two.head).all() and (one.members == two.members).all(), name
    assert {"adaptive", "adaptive_informed", "greedy"} <= seeing
    assert not seeing & {"nearest3", "informed3", "pre_dc", "random"}
    assert ViewPolicy.sees_lam


UNDERWATER = Scenario.named("Underwater-v0", particles=50)


@pytest.mark.parametrize("hysteresis_db", [0.0, 3.0, 10.0])
def test_the_strongest_signal_leads_unless_the_head_is_nearly_as_strong(hysteresis_db):
    view = View.of(walked(9, UNDERWATER, "strongest_signal"))
    cluster = StrongestSignal(UNDERWATER, hysteresis_db=hysteresis_db).act(view)
    changed = 0
    for row in range(40):
        n, old = view.reports.count[row], view.head[row]
        level = dict(zip(view.reports.node[row, :n].tolist(), view.reports.value[row, :n, 0].tolist()))
        best = max(level, key=level.get)
        stays = level[best] < level.get(old, -np.inf) + hysteresis_db
        assert cluster.head[row] == (old if stays else best)
        changed += cluster.head[row] != old
        hop = np.linalg.norm(view.positions[row] - view.positions[row, cluster.head[row]], axis=1) <= 250
        assert chosen(cluster, row) == set(np.flatnonzero(hop))
    assert changed > 0 or hysteresis_db == 10


def test_the_strongest_signals_head_stays_in_silence_and_begins_at_the_prediction():
    policy = StrongestSignal(UNDERWATER)
    state = World(UNDERWATER, threads=1).reset(np.arange(40))
    assert (policy.act(View.of(state)).head == View.of(state).nearest_living()).all()
    state = walked(5, UNDERWATER, "strongest_signal")
    state.reports.count[:] = 0
    view = View.of(state)
    cluster = policy.act(view)
    assert (cluster.head == view.head).all()
    assert all(chosen(cluster, row) == set(np.flatnonzero(view.member[row])) for row in range(40))


def test_the_strongest_signal_passes_over_the_dead():
    state = walked(5, UNDERWATER, "strongest_signal")
    for row in range(40):  # all that reported but the old head
        nodes = state.reports.node[row, : state.reports.count[row]]
        state.network.battery[row, nodes[nodes != state.network.head[row]]] = 0.0
    view = View.of(state)
    cluster = StrongestSignal(UNDERWATER, hysteresis_db=0.0).act(view)
    assert (cluster.head == view.head).all()
    assert all(view.alive[row, list(chosen(cluster, row))].all() for row in range(40))


@pytest.mark.parametrize("measurement", ["position", "rssi", "rssi_power"])
def test_the_strongest_signal_on_land(measurement):
    """A radio has no hop: the sensing radius stands for it. 3 dB are a factor of 2 of power."""
    land = SCENARIO.override(measurement=measurement)
    view = View.of(walked(6, land))
    cluster = make_policy("strongest_signal", land).act(view)
    changed = 0
    for row in range(40):
        n, old = view.reports.count[row], view.head[row]
        near = np.linalg.norm(view.positions[row] - view.positions[row, cluster.head[row]], axis=1) <= 10
        assert chosen(cluster, row) == set(np.flatnonzero(near))
        nodes, values = view.reports.node[row, :n], view.reports.value[row, :n]
        if measurement == "position":
            power = np.linalg.norm(values - view.positions[row, nodes], axis=1) ** -2
        else:
            power = 10 ** (values[:, 0] / 10) if measurement == "rssi" else values[:, 0]
        signal = dict(zip(nodes.tolist(), power.tolist()))
        best = max(signal, key=signal.get, default=old)
        stays = n == 0 or (old in signal and signal[best] < 10**0.3 * signal[old])
        assert cluster.head[row] == (old if stays else best)
        changed += cluster.head[row] != old
    assert changed > 3


def test_random_repeats_itself_and_differs_between_rows_and_periods(view):
    policy = make_policy("random", SCENARIO)
    first, again = policy.act(view), policy.act(view)
    assert (first.head == again.head).all() and (first.members == again.members).all()
    sizes = [len(chosen(first, row)) for row in range(40)]
    assert len(set(sizes)) > 3


def test_a_package_of_ones_own_adds_a_policy(tmp_path):
    """An entry point in another distribution is found by name."""
    (tmp_path / "mine.py").write_text(
        textwrap.dedent(
            """
            from wsn_env.agents.nearest import Nearest
            def lazy(scenario):
                return Nearest(scenario, n=1, hysteresis_m=20.0)
            """
        )
    )
    info = tmp_path / "mine-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: mine\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[wsn_env.policies]\nlazy = mine:lazy\n")
    code = (
        f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n"
        "from wsn_env import Scenario, make_policy\n"
        "print(make_policy('lazy', Scenario()).hysteresis_m)"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "20.0"


def test_parameters_of_the_published_policies_are_checked():
    for name, message in (
        ("pre_dc:theta=", "PreDC.theta = ''"),
        ("pre_dc:phi0_m=-1", "PreDC.phi0_m = -1"),
        ("strongest_signal:hop_m=0", "StrongestSignal.hop_m = 0"),
        ("random:n=-1", "Random.n = -1"),
        ("every:n=0", "Every.n = 0"),
    ):
        with pytest.raises(ValueError, match=message):
            make_policy(name, SCENARIO)


OWN = """
import numpy as np
from wsn_env.agents.base import ViewPolicy
from wsn_env import Cluster

class Mine(ViewPolicy):
    def act(self, view):
        nodes, _ = view.nearest(2)
        return Cluster(nodes[:, 0], nodes.astype(np.int32))

class Broken(Mine):
    def act(self, view):
        cluster = super().act(view)
        return Cluster(cluster.head, np.concatenate([cluster.members, cluster.head], axis=1))

class Nodes(Mine):
    def act(self, view):
        return Cluster(super().act(view).head + 1000, super().act(view).members)

class Array(Mine):
    def act(self, view):
        return np.zeros(3)

class Alone:
    def act(self, view):
        return None

class Idle:
    def __init__(self, scenario):
        pass
"""


@pytest.mark.parametrize(
    "policy,words",
    [
        ("mine.py:Mine:reach=3", ("Mine", "reach")),
        ("mine.py:Mina", ("Mina", "did you mean Mine")),
        ("mine.py", ("mine.py:CLASS",)),
        ("yours.py:Mine", ("no file yours.py",)),
        ("mine.py:Broken", ("mine.py:14: ", "dimensions")),
        ("mine.py:Nodes", ("Nodes.act", "chose node 1", "below 225")),
        ("mine.py:Array", ("Array.act", "ndarray", "Cluster(head, members)")),
        ("mine.py:Alone", ("mine.py:Alone", "takes no arguments")),
        ("mine.py:Idle", ("mine.py:Idle", "act(view)")),
        ("runs/nowhere", ("runs/nowhere", "does not exist")),
        ("a=nearest0 a=nearest3", ("'a'", "twice")),
    ],
)
def test_mistakes_in_a_policy_of_ones_own_are_told_in_a_line(policy, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(OWN)
    assert main(["evaluate", "--policies", *policy.split(), "--episodes", "2"]) == 2
    said = capsys.readouterr().err.strip()
    assert "\n" not in said and all(word in said for word in words)


def test_a_file_that_was_edited_is_played_anew(tmp_path, monkeypatch):
    """Kept blocks of a stopped run are of the old text."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(OWN)
    scenario = Scenario.named("PreDC-v0", particles=50, periods=3)
    mine = {"mine": make_policy("mine.py:Mine", scenario)}
    kept = [evaluate(mine, scenario, episodes=2, keep=tmp_path) and (tmp_path / BLOCKS_FILE).read_text()]
    (tmp_path / "mine.py").write_text(OWN + "# another text\n")
    kept += [evaluate(mine, scenario, episodes=2, keep=tmp_path) and (tmp_path / BLOCKS_FILE).read_text()]
    assert kept[0].splitlines()[0] != kept[1].splitlines()[0]
    assert kept[0].splitlines()[1:] == kept[1].splitlines()[1:]


def test_what_was_not_compared_is_told():
    scenario = Scenario.named("PreDC-v0", particles=50, periods=3)
    with pytest.raises(ValueError, match="Nearest is no name"):
        evaluate([make_policy("nearest2", scenario)], scenario)
    evaluation = evaluate(["nearest2", "all"], scenario, episodes=2)
    with pytest.raises(ValueError, match="'nearest3' at lam = 4.0: compared were nearest2, all at 4"):
        evaluation.difference("nearest3", "all", 4.0)


def test_a_label_is_not_empty():
    with pytest.raises(ValueError, match="'=pre_dc' has no label"):
        named_policies(["=pre_dc"], Scenario.named("PreDC-v0"))


def test_a_training_is_compared_with_the_policies_that_fit_its_scenario(capsys):
    made = {name: make_baselines(Scenario.named(name)) for name in ("PreDC-v0", "Binary-v0", "Ble-v0", "Lifetime-v0")}
    assert "meant for other scenarios: all, boundary, budget, every, quadrants, strongest\n" in capsys.readouterr().out
    for name in ("pre_dc", "centroid", "static_cluster", "nearest0", "informed8", "greedy", "adaptive", "random"):
        assert all(name in baselines for baselines in made.values())
    at_home = {
        "boundary": "Binary-v0",
        "strongest": "Ble-v0",
        "quadrants": "Ble-v0",
        "all": "Ble-v0",
        "budget": "Lifetime-v0",
    }
    for name, home in at_home.items():
        assert [scenario for scenario, baselines in made.items() if name in baselines] == [home]
