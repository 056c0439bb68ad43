"""The strong hand-written rules: information order, size by spread, information for energy; and how they are tuned."""

import json
from dataclasses import replace

import numpy as np
import pytest

from studies import tuning
from tests.test_policies import SCENARIO, chosen, walked
from tests.worlds import expected
from wsn_env import Scenario, View, World
from wsn_env.agents.adaptive import RULES, Adaptive, Switch
from wsn_env.agents.greedy import Greedy, Terms
from wsn_env.agents.nearest import ORDERS, Nearest
from wsn_env.agents.tuned import TABLE, nearest_lam
from wsn_env.envs.actions import MenuAction
from wsn_env.models.quantity import ScenarioError

RSSI = Scenario.named("Rssi-v0", particles=200)
EVER = 1e9  # a hysteresis that no head leaves


@pytest.fixture(scope="module")
def view():
    return View.of(walked(9, RSSI))


@pytest.fixture(scope="module")
def positions_view():
    return View.of(walked())


def with_lam(view, lam):
    other = View(replace(view.knowledge, row=view.row.copy()))
    other.row["lam"] = lam
    return other


def sizes(cluster):
    return np.array([len(chosen(cluster, row)) - 1 for row in range(len(cluster.head))])


# --- the order of information ------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [0, 1, 3, 8])
@pytest.mark.parametrize("stays", [True, False])
def test_informed_takes_the_first_of_the_information_order(view, n, stays):
    cluster = Nearest(RSSI, n, EVER if stays else 0.0, "information").act(view)
    entry = (1 if stays else 10) + n
    menu = MenuAction(RSSI, "information", 12).cluster(np.full(40, entry), view)
    assert (cluster.head == menu.head).all()
    assert all(chosen(cluster, row) == chosen(menu, row) for row in range(40))
    if 0 < n < 8:
        nearest = Nearest(RSSI, n, EVER, "nearest").act(view)
        assert any(chosen(cluster, row) != chosen(nearest, row) for row in range(40))


@pytest.mark.parametrize("order", ORDERS)
def test_the_head_stays_within_the_hysteresis(view, order):
    distance = view.distance[view.rows, view.head]
    hysteresis_m = float(np.median(distance))
    head = Nearest(RSSI, 2, hysteresis_m, order).act(view).head
    best = Nearest(RSSI, 2, 0.0, order).act(view).head
    assert (head == np.where(distance <= hysteresis_m, view.head, best)).all()
    assert (head != view.head).sum() > 5


def test_where_nodes_report_positions_and_the_belief_is_round_the_orders_are_the_same(positions_view):
    """Who is most likely to detect tells most, and that is the nearest."""
    view = View(replace(positions_view.knowledge, belief=positions_view.belief.copy()))
    view.belief["predicted_cov"] = np.diag([2.0, 1.0, 2.0, 1.0])
    for hysteresis_m in (0.0, 5.0):
        a, b = (Nearest(SCENARIO, 4, hysteresis_m, order).act(view) for order in ORDERS)
        assert (a.head == b.head).all()
        assert all(chosen(a, row) == chosen(b, row) for row in range(40))


def test_bad_parameters_are_named():
    with pytest.raises(ValueError, match="order 'neerest' is unknown: did you mean nearest"):
        Nearest(order="neerest")
    with pytest.raises(ValueError, match="order 'value' is unknown"):
        Adaptive(order="value")
    for wrong in (dict(n=-1), dict(n=1.5), dict(hysteresis_m=-1.0)):
        with pytest.raises(ScenarioError, match="Nearest"):
            Nearest(**wrong)
    for switch in ((1.0, 3, 2, 1.0, 5.0), (1.0, -1, 2, 1.0, 5.0), (1.0, 1, 2, -1.0, 5.0)):
        with pytest.raises(ScenarioError, match="Switch"):
            Adaptive(switches=[switch])
    with pytest.raises(ScenarioError, match="Terms.worth = 0"):
        Greedy(terms=[(1.0, 0, 1.0)])
    for nothing in (lambda: Adaptive(switches=[]), lambda: Greedy(terms=[])):
        with pytest.raises(ScenarioError, match="at least 1"):
            nothing()


# --- size by spread ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", ORDERS)
def test_adaptive_takes_many_where_the_spread_is_wide(view, order):
    spread_m = float(np.median(view.spread_m))
    cluster = Adaptive(RSSI, order, [Switch(1.0, 1, 5, spread_m, 6.0)]).act(view)
    wide = view.spread_m > spread_m
    assert wide.sum() == 20
    few, many = (Nearest(RSSI, n, 6.0, order).act(view) for n in (1, 5))
    assert (cluster.head == few.head).all()
    for row in range(40):
        assert chosen(cluster, row) == chosen(many if wide[row] else few, row)


def test_each_row_takes_the_switch_of_its_own_lam(view):
    switches = [Switch(16.0, 0, 0, 1.0, EVER), Switch(1.0, 2, 2, 1.0, EVER), Switch(4.0, 1, 1, 1.0, EVER)]
    lam = np.tile([0.0, 0.3, 1.9, 2.1, 7.9, 8.1, 16.0, 100.0], 5)
    cluster = Adaptive(RSSI, "nearest", switches).act(with_lam(view, lam))
    assert (sizes(cluster) == np.tile([2, 2, 2, 1, 1, 0, 0, 0], 5)).all()
    assert nearest_lam([1.0, 4.0], np.array([2.0])) == [0]  # half way


# --- information for energy --------------------------------------------------------------------------------------


def covariance_after(p, detection):
    """Of the position, on average over a report's coming, which has this probability, and its not coming."""
    r = SCENARIO.measurement.noise_m**2
    return p - detection * p @ np.linalg.inv(p + r * np.eye(2)) @ p


def chances(scenario, view, row, nodes):
    """Of detecting the target, under the belief."""
    about = view.predicted_mean[row], view.predicted_cov[row]
    return expected(scenario, view.positions[row, list(nodes)], *about)["detection"]


def price_mj(view, row, node, head, detection, service):
    """Expected energy of a member's report, and its part of the invitation."""
    radio, spots = SCENARIO.radio, view.positions[row]
    far_m = float(np.linalg.norm(spots[node] - spots[head]))
    called = head != view.head[row] or not view.member[row, node]
    bits = detection * radio.report_bits + called / service * radio.invitation_bits
    return 1e3 * (radio.sending_j(bits, far_m) + radio.receiving_j(bits))


@pytest.mark.parametrize("lam", [0.2, 0.6, 1.5])
def test_greedy_takes_what_pays_and_leaves_what_does_not(positions_view, lam):
    """Each member is the best after those before it and worth its price; of the rest nobody is."""
    worth, service = 1.5, 3.0
    view = with_lam(positions_view, lam)
    cluster = Greedy(SCENARIO, [Terms(1.0, worth, service)]).act(view)
    taken = left = 0
    for row, head in enumerate(cluster.head):
        p = view.predicted_cov[row][::2, ::2]
        detection = chances(SCENARIO, view, row, range(view.positions.shape[1]))
        rest = [node for node in view.nearest(12)[0][row] if node != head and detection[node] > 1e-6]
        price = {node: price_mj(view, row, node, head, detection[node], service) for node in rest}
        p = covariance_after(p, detection[head])
        for node in [*(node for node in cluster.members[row] if node >= 0), None]:
            sds = {other: np.sqrt(np.trace(covariance_after(p, detection[other]))) for other in rest}
            surplus = {other: worth * (np.sqrt(np.trace(p)) - sds[other]) - lam * price[other] for other in rest}
            if node is None:
                assert max(surplus.values(), default=0.0) <= 1e-12
                break
            assert surplus[node] > 0 and surplus[node] >= max(surplus.values()) - 1e-12
            p = covariance_after(p, detection[node])
            rest.remove(node)
            taken += 1
        left += len(rest)
    assert left >= 5 and taken >= 5


@pytest.mark.parametrize("scenario", [SCENARIO, RSSI], ids=["position", "rssi"])
def test_greedy_goes_from_many_to_the_head_alone(view, positions_view, scenario):
    view = positions_view if scenario is SCENARIO else view
    policy = Greedy(scenario, [Terms(1.0, 2.0, 4.0)])
    counts = [sizes(policy.act(with_lam(view, lam))).mean() for lam in (0.0, 0.3, 1.0, 3.0, 1e6)]
    assert (np.diff(counts) < 0).all()
    assert counts[0] > 6 and counts[-1] == 0
    cluster = Greedy(scenario).act(with_lam(view, 0.0))
    for row in range(40):  # whoever can tell something, of the twelve nearest
        nodes = view.nearest(12)[0][row]
        p = chances(scenario, view, row, nodes)
        assert chosen(cluster, row) == set(nodes[p > 1e-6].tolist()) | {int(cluster.head[row])}


def test_greedys_head_moves_where_that_pays(view):
    """Never where a handover is too dear, to the node nearest to the prediction where it is nearly free."""
    dear, cheap = (Greedy(RSSI, [Terms(1.0, 1.0, service)]).act(with_lam(view, 5.0)) for service in (1e-9, 1e9))
    assert (dear.head == view.head).all()
    moved = cheap.head != view.head
    assert moved.sum() > 5
    assert (cheap.head[moved] == view.nearest_living()[moved]).all()


def test_a_row_does_not_depend_on_the_others(view):
    lam = np.geomspace(0.1, 60, 40)
    policies = [Adaptive(RSSI, order) for order in ORDERS] + [Greedy(RSSI), Nearest(RSSI, 3, order="information")]
    arrays = with_lam(view, lam).as_arrays()
    for policy in policies:
        whole = policy.act(with_lam(view, lam))
        for row in range(40):
            alone = policy.act(View.from_arrays({name: array[row : row + 1] for name, array in arrays.items()}))
            assert alone.head[0] == whole.head[row]
            assert (alone.members[0] == whole.members[row]).all()


# --- tuning ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["PreDC-v0", "Rssi-v0"])
def test_the_tuned_table_is_used(name):
    scenario, table = Scenario.named(name, nodes=81), json.loads(TABLE.read_text())["scenarios"][name]
    assert table["tuned_on"]["seed"] >= 100  # comparisons use smaller ones
    lams = table["tuned_on"]["lams"]
    assert lams == tuning.LAMS
    for order in ORDERS:
        for n in range(9):
            assert Nearest(scenario, n, order=order).hysteresis_m == table[order][str(n)]
        assert [list(switch) for switch in Adaptive(scenario, order).switches] == table[RULES[order]]
    assert [list(terms) for terms in Greedy(scenario).terms] == table["greedy"]
    assert [terms.lam for terms in Greedy(scenario).terms] == lams


def test_without_a_table_the_usual_serves():
    scenario = Scenario.named("PreDC-v0", name="mine", radius_m=20.0, particles=100, periods=5)
    assert Nearest(scenario).hysteresis_m == 16.0
    assert [switch.hysteresis_m for switch in Adaptive(scenario).switches] == [16.0]
    assert Nearest(Scenario.named("Anchors-v0")).hysteresis_m == 0.0  # the target receives: no head, no handover
    state, world = World(scenario, threads=1).reset([1, 2]), World(scenario, threads=1)
    for policy in (Adaptive(scenario), Adaptive(scenario, "information"), Greedy(scenario)):
        assert world.step(state, policy.act(View.of(state)))[1].members.min() >= 1


class Costs:
    """Trials whose outcome is known."""

    def __init__(self, scenario, lams, cost):
        self.scenario, self.lams, self._cost = scenario, np.array(lams), cost

    def costs(self, what, policies, played_at=None):
        seen = [None] * len(policies) if played_at is None else played_at
        return np.array([[self._cost(policy, lam, at) for lam in self.lams] for policy, at in zip(policies, seen)])


def test_tuning_finds_the_best_of_what_it_tries():
    lams = [1.0, 4.0, 16.0]
    size_for = {1.0: 6, 4.0: 2, 16.0: 0}

    def fixed(policy, lam, _):
        wanted_m = 3.5 if lam > 4 else 8.0
        return 10 + abs(policy.n - size_for[lam]) + abs(policy.hysteresis_m - wanted_m)

    found = tuning.tune_fixed(Costs(RSSI, lams, fixed), "nearest")
    assert (found["0"], found["2"], found["6"]) == (3.5, 8.0, 8.0)  # the head alone serves lam = 16
    assert set(found) == {str(n) for n in range(9)}

    def switching(policy, lam, _):
        (switch,) = policy.switches
        offset = abs(switch.many - size_for[lam]) + abs(switch.spread_m - 1.3) + 0.1 * abs(switch.hysteresis_m - 5.0)
        return 10 + offset + 0.01 * switch.few

    switches = tuning.tune_adaptive(Costs(RSSI, lams, switching), "information", found)
    assert [switch.lam for switch in switches] == lams
    assert [switch.hysteresis_m for switch in switches] == [5.0] * 3
    assert [(switch.few, switch.many) for switch in switches[:1]] == [(2, 6)]
    assert {switch.spread_m for switch in switches[:2]} == {1.3}

    def bargain(policy, lam, price):
        return 10 + abs(np.log(price / (lam / 2))) + abs(policy.terms[0].service - 5.0)

    for terms in tuning.tune_greedy(Costs(RSSI, lams, bargain)):
        assert terms.service == 5.0
        assert np.log(terms.worth / 2) == pytest.approx(0, abs=0.375 * np.log(2) + 1e-3)  # half a step of the grid


def test_tuning_plays_each_policy_once_on_seeds_of_its_own(monkeypatch):
    small = RSSI.override(particles=50, periods=4)
    played = []
    rollout = tuning.rollout
    monkeypatch.setattr(tuning, "rollout", lambda *given: played.append(given) or rollout(*given))
    trials = tuning.Trials(small, [1.0, 4.0], 3, 9000, lambda *said: None)
    policies = [Nearest(small, 2, 5.0), Nearest(small, 3, 5.0), Nearest(small, 2, 5.0)]
    costs = trials.costs("", policies)
    assert len(played) == 2 and (costs[0] == costs[2]).all()
    assert {seed for _, _, seeds in played for seed in seeds} == {2**31 + 9000 * 10**5 + i for i in range(3)}
    energies = np.diff(costs, axis=1)[:, 0] / 3
    assert energies[1] > energies[0] > 0  # the cost is linear in lam


def test_the_command_writes_the_table(monkeypatch, tmp_path):
    for name, grid in dict(
        MEMBERS=(0, 2), HYSTERESES=(0.5,), SIZES=((0, 2),), SPREADS=(0.1,), PRICE_STEP=100.0
    ).items():
        monkeypatch.setattr(tuning, name, grid)
    monkeypatch.setattr(tuning, "SERVICES", (3.0,))
    monkeypatch.setattr(tuning.Scenario, "named", lambda name: Scenario(name=name, periods=2))
    (tmp_path / "t.json").write_text('{"scenarios": {"other": {"greedy": []}}}')
    command = ["--scenario", "PreDC-v0", "--lams", "4", "2", "--episodes", "2", "--out", str(tmp_path / "t.json")]
    tuning.main(command)
    table = json.loads((tmp_path / "t.json").read_text())["scenarios"]
    assert table["other"] == {"greedy": []}
    mine = table["PreDC-v0"]
    assert mine["tuned_on"] == {"lams": [2.0, 4.0], "episodes": 2, "seed": 9000}
    assert mine["nearest"] == mine["information"] == {"0": 5.0, "2": 5.0}
    assert mine["greedy"] == [[2.0, 4.0, 3.0], [4.0, 8.0, 3.0]]  # the least price is a quarter of the least lam
