"""Faults: how often and where they strike, what they leave alone, and filters that reckon with them."""

import os
import subprocess
import sys
from dataclasses import dataclass

import numpy as np
import pytest

from tests.worlds import assert_same, expected, keys_of
from wsn_env import Cluster, Scenario, View, World, evaluate, make_policy
from wsn_env.compiled import draws
from wsn_env.filters.particle import ParticleTracker
from wsn_env.learning.worlds import world_of
from wsn_env.models import Fault, ScenarioError, quantity
from wsn_env.models.fault.failures import Failures
from wsn_env.models.fault.late import Late
from wsn_env.models.fault.stuck import Stuck
from wsn_env.models.library import FAULTS
from wsn_env.models.own import class_in
from wsn_env.models.state import Belief, Network, Reports
from wsn_env.simulation.bound import why_no_bound
from wsn_env.simulation.reference import has_reference

NODES, PERIODS, ROWS = 60, 40, 24
NOTHING = {  # each fault at no strength
    "biased": "share=0",
    "excursion": None,
    "failures": "share=0",
    "false_alarms": "probability=0",
    "bursts": "bad_success=1",
    "late": "probability=0",
    "misplaced": "position_sd_m=0",
    "missed": "probability=0",
    "regional_failure": "region_m=0",
    "stops": "stops=0",
    "stuck": "share=0",
}
SURE = dict(radius_m=300.0, ceiling=1.0, search=False)  # every node detects the target wherever it is


def faulty(faults=(), **more):
    usual = dict(particles=20, nodes=NODES, periods=PERIODS) | ({} if "motion" in more else {"crossing_m": 20.0})
    return Scenario.named("PreDC-v0", faults=faults, **usual | more)


def play(scenario, rows=ROWS, seed=5, awake=None):
    """States and outcomes of all periods; everybody is awake, or some."""
    world = World(scenario, threads=1)
    state = world.reset(keys_of(seed, rows))
    awake = np.arange(scenario.field.nodes) if awake is None else np.asarray(awake)
    cluster = Cluster(np.full(rows, awake[0]), np.tile(awake, (rows, 1)))
    for _ in range(scenario.periods):
        state, outcome = world.step(state, cluster)
        yield state, outcome


def told(state, row):
    """{node: (2,)} of the head's reports."""
    n = state.reports.count[row]
    return dict(zip(state.reports.node[row, :n].tolist(), state.reports.value[row, :n], strict=True))


def four(share, count):
    """Four standard errors of a share of so many."""
    return 4 * (share * (1 - share) / count) ** 0.5


# --- all of them ----------------------------------------------------------------------------------------------


def test_every_fault_is_known_here():
    assert set(NOTHING) == set(FAULTS.kinds)


@pytest.mark.parametrize("name", [name for name in NOTHING if NOTHING[name]])
def test_a_fault_without_strength_changes_no_bit(name):
    for (_, sound), (_, struck) in zip(play(faulty()), play(faulty(f"{name},{NOTHING[name]}")), strict=True):
        assert_same(sound, struck)


@pytest.mark.parametrize("name", FAULTS.kinds)
def test_every_fault_does_something(name):
    pairs = zip(play(faulty()), play(faulty(name)), strict=True)
    assert any(a.error_m.tobytes() != b.error_m.tobytes() for (_, a), (_, b) in pairs)


def test_without_faults_the_state_has_no_room_for_them():
    state = World(faulty()).reset([1])
    assert state.condition.shape == (1, 0) and state.condition.nbytes == 0


@pytest.mark.parametrize(("name", "field"), [("failures", "fails_at"), ("stuck", "stuck_x"), ("biased", "off_x")])
def test_a_greater_share_has_the_same_nodes_and_more(name, field):
    few, many = (World(faulty(f"{name},share={s}")).reset(keys_of(1, 8)).condition[field] for s in (0.2, 0.6))
    struck = few != 0
    np.testing.assert_array_equal(many[struck], few[struck])
    assert 0 < struck.sum() < 0.6 * (many != 0).sum()


def test_two_of_a_kind_strike_apart_and_the_first_as_if_alone():
    one = World(faulty("failures")).reset(keys_of(1, 8)).condition["fails_at"]
    two = World(faulty(["failures", "failures"])).reset(keys_of(1, 8)).condition["fails_at"]
    assert ((two > 0) >= (one > 0)).all() and (two > 0).sum() > 1.5 * (one > 0).sum()


# --- nodes ----------------------------------------------------------------------------------------------------


def test_nodes_fail_as_often_as_said_at_any_time_and_nobody_hears():
    scenario, rows = faulty("failures,share=0.3"), 200
    world = World(scenario, threads=1)
    state = world.reset(keys_of(2, rows))
    times = state.condition["fails_at"]
    failing = times > 0
    assert failing.mean() == pytest.approx(0.3, abs=four(0.3, failing.size))
    shares = np.bincount(times[failing], minlength=PERIODS + 1)[1:] / failing.sum()
    assert abs(shares - 1 / PERIODS).max() < four(1 / PERIODS, failing.sum())
    nobody = Cluster(np.zeros(rows, int), np.full((rows, 0), -1))
    for period in range(1, PERIODS + 1):
        state, outcome = world.step(state, nobody)
        np.testing.assert_array_equal(outcome.alive, NODES - ((times > 0) & (times <= period)).sum(axis=1))
        assert (state.network.alive >= outcome.alive).all()
    assert (state.network.alive - outcome.alive).mean() > 0.8 * 0.3 * NODES  # none but heads were missed


def test_a_node_that_does_not_answer_is_known_to_be_dead():
    """Everybody is called in every period; at once, unless the head dies with it."""
    late = 0
    for state, outcome in play(faulty("failures,share=0.9")):
        missed = state.network.alive - outcome.alive
        fails = state.condition["fails_at"] == state.row["period"][:, None]
        assert (missed <= fails.sum(axis=1)).all()
        late += (missed > 0).sum()
    assert late < 0.1 * ROWS * PERIODS


@pytest.mark.parametrize("receiver", ["head", "sink"])
def test_a_cluster_whose_head_fails_is_known_to_have_lost_it(receiver):
    """At a sink the others stay awake: the head is a node like them."""
    world = World(faulty("failures,share=1", receiver=receiver, battery_j=10.0), threads=1)
    state = world.reset(keys_of(2, 200))
    first = state.condition["fails_at"].argmin(axis=1)
    others = np.argsort(state.condition["fails_at"], axis=1)[:, -2:]
    state, _ = world.step(state, Cluster(first, others.astype(np.int32)))
    keep = Cluster(np.full(200, -2), np.full((200, 0), -1))
    while (state.row["period"] < 3).all():
        state, _ = world.step(state, keep)
    failed = state.condition["fails_at"][np.arange(200), first] <= 3
    assert failed.sum() > 50
    assert (state.network.battery[failed, first[failed]] == 0).all()
    kept = 1 if receiver == "sink" else 0
    assert (state.network.n_members[failed] == kept).all() and (state.network.head[failed] != first[failed]).all()


def test_a_search_does_not_tell_who_is_dead():
    """Two worlds, one with failures of nodes that nobody called; in a search nobody is heard in either."""
    views = []
    for share in (0.0, 0.5):
        deaf = dict(sensing_nj=5000.0, ceiling=1e-9, search_gap=1, search_miss=1.0)
        world = World(faulty(f"failures,share={share}+missed,probability=1", **deaf), threads=1)
        state, searched = world.reset(keys_of(7, 4)), 0
        for _ in range(10):
            state, outcome = world.step(state, Cluster(np.full(4, 3), np.full((4, 0), -1)))
            searched += outcome.searched.sum()
        assert searched > 0
        views.append((state.network.battery, state.residual_j))
    asked = views[1][1][:, 4:] == 0
    assert asked.any()
    np.testing.assert_array_equal(views[0][0][:, 4:], views[1][0][:, 4:])


def test_a_region_fails_at_once():
    scenario = faulty("regional_failure,region_m=30")
    state = World(scenario).reset(keys_of(3, ROWS))
    some = 0
    for row in range(ROWS):
        times, positions = state.condition["fails_at"][row], state.network.positions[row]
        failing = times > 0
        assert len(set(times[failing].tolist())) <= 1
        if failing.sum() > 2:
            middle = positions[failing].mean(axis=0)
            inside = np.linalg.norm(positions - middle, axis=1) < 5
            assert failing[inside].all() and np.ptp(positions[failing], axis=0).max() <= 60
            some += 1
    assert some > ROWS / 2


def test_a_stuck_sensor_repeats_itself_for_good():
    scenario = faulty("stuck,share=0.5", **SURE | {"radius_m": 10.0, "softness": 0.2})
    last, repeats = {}, 0
    for state, _ in play(scenario):
        stuck = state.condition["stuck_at"]
        for row in range(ROWS):
            period, values = int(state.row["period"][row]), told(state, row)
            for node in np.flatnonzero((stuck[row] > 0) & (stuck[row] <= period)):
                told_now = values.get(node)  # None: near the edge it may have sensed nothing
                if period > stuck[row, node]:
                    np.testing.assert_array_equal(told_now, last[row, node])
                    repeats += told_now is not None
                if told_now is not None:
                    off = told_now - state.network.positions[row, node]
                    assert np.linalg.norm(off) < 10 + 5 * 2  # within the radius, but for five sds of noise
                last[row, node] = told_now
    assert repeats > 1000


def test_a_biased_sensor_is_off_by_so_much_and_the_others_by_nothing():
    scenario = faulty("biased,share=0.4,bias_m=7", **SURE)
    off, count = np.zeros((ROWS, NODES, 2)), 0
    for state, outcome in play(scenario):
        for row in range(ROWS):
            values = told(state, row)
            off[row] += np.array([values[node] for node in range(NODES)]) - outcome.target_m[row]
        count += 1
    distance = np.linalg.norm(off / count, axis=2)
    biased = state.condition["off_x"] != 0
    slack = 5 * 2 / count**0.5  # five standard errors of a mean of noise of 2 m
    assert biased.mean() == pytest.approx(0.4, abs=four(0.4, biased.size))
    assert abs(distance[biased] - 7).max() < slack and distance[~biased].max() < slack


def test_misplaced_nodes_are_off_by_their_errors():
    state = World(faulty("misplaced,position_sd_m=3"), threads=1).reset(keys_of(4, 200))
    for name in ("off_x", "off_y"):
        errors = state.condition[name]
        assert errors.std() == pytest.approx(3, abs=4 * 3 / (2 * errors.size) ** 0.5)
        assert abs(errors.mean()) < 4 * 3 / errors.size**0.5


def test_false_alarms_come_as_often_as_said_from_anywhere_within_the_radius():
    """Of nodes that do not sense the target; the others report it as they would have."""
    sound, struck = play(faulty(search=False)), play(faulty("false_alarms,probability=0.2", search=False))
    alarms, chances, squares = 0, 0, []
    for (before, _), (state, _) in zip(sound, struck, strict=True):
        for row in range(ROWS):
            true, all_ = told(before, row), told(state, row)
            assert all(np.array_equal(all_[node], value) for node, value in true.items())
            alarms, chances = alarms + len(all_) - len(true), chances + NODES - len(true)
            squares += [((all_[n] - state.network.positions[row, n]) ** 2).sum() for n in all_.keys() - true.keys()]
    assert alarms / chances == pytest.approx(0.2, abs=four(0.2, chances))
    # As detected: uniform up to the radius of 10 m, with p(d) of eqs. 2-3 on top; and noise of 2 m in x and y.
    d = np.linspace(0, 10, 2001)
    from wsn_env.scenario.sensing import detection_probability

    weights = d * detection_probability(d, faulty())
    mean = (weights * d**2).sum() / weights.sum() + 2 * 2.0**2
    assert np.mean(squares) == pytest.approx(mean, abs=4 * np.std(squares) / len(squares) ** 0.5)


def test_detections_are_missed_as_often_as_said():
    counts = [
        sum(outcome.detections.sum() for _, outcome in play(faulty(faults, search=False)))
        for faults in ([], "missed,probability=0.3")
    ]
    assert counts[1] / counts[0] == pytest.approx(0.7, abs=four(0.7, counts[0]))


# --- links and reports ----------------------------------------------------------------------------------------


def test_a_late_report_is_that_of_the_period_before():
    sound = play(faulty(**SURE), awake=[7, *range(20)])
    struck = play(faulty("late,probability=0.3", **SURE), awake=[7, *range(20)])
    before, fresh, late, chances = [{} for _ in range(ROWS)], 0, 0, 0
    for (state, _), (other, _) in zip(sound, struck, strict=True):
        for row in range(ROWS):
            now, got = told(state, row), told(other, row)
            assert np.array_equal(got[7], now[7])  # the head's own
            for node, value in got.items():
                is_fresh = np.array_equal(value, now[node])
                assert is_fresh or np.array_equal(value, before[row][node])
                fresh, late = fresh + is_fresh, late + (not is_fresh)
            chances += 19
            before[row] = now
    # Late if it was late, with .3, and the node's newer one is late, too.
    assert (fresh - ROWS * PERIODS) / chances == pytest.approx(0.7, abs=four(0.7, chances))
    assert late / chances == pytest.approx(0.3 * 0.3 * (PERIODS - 1) / PERIODS, abs=2 * four(0.09, chances))


def test_a_late_report_comes_from_a_node_that_has_been_let_go():
    scenario = faulty("late,probability=1", **SURE)
    world = World(scenario, threads=1)
    state, _ = world.step(world.reset([3]), Cluster(np.array([0]), np.array([[1, 2]])))
    assert told(state, 0).keys() == {0}
    battery = state.residual_j.copy()
    state, outcome = world.step(state, Cluster(np.array([5]), np.array([[6]])))
    assert told(state, 0).keys() == {1, 2, 5}
    assert (state.residual_j < battery)[0, [1, 2]].all() and outcome.delivered == 3
    state, _ = world.step(state, Cluster(np.array([5]), np.full((1, 0), -1)))
    assert told(state, 0).keys() == {5, 6}


def test_a_report_comes_once_whoever_leads():
    """Heads take turns among a few nodes, all awake: their own reports of before, which were late, are dropped."""
    scenario, rows = faulty("late,probability=0.5", nodes=4, **SURE), 8
    world = World(scenario, threads=1)
    state, late = world.reset(keys_of(3, rows)), 0
    for period in range(PERIODS):
        state, outcome = world.step(state, Cluster(np.full(rows, period % 4), np.tile(np.arange(4), (rows, 1))))
        for row in range(rows):
            assert (np.diff(state.reports.node[row, : state.reports.count[row]]) > 0).all()
        late += (state.condition["waiting"] > 0).sum()
        assert (state.condition["waiting"][:, period % 4] == 0).all() and (outcome.delivered <= 4).all()
    assert late > rows * PERIODS


def test_at_a_sink_what_waits_is_heard_though_all_sleep():
    scenario = faulty("late,probability=1", receiver="sink", **SURE)
    world = World(scenario, threads=1)
    state, _ = world.step(world.reset([3]), Cluster(np.array([0]), np.array([[1, 2]])))
    state, _ = world.step(state, Cluster(np.array([-3]), np.full((1, 0), -1)))
    assert told(state, 0).keys() == {0, 1, 2}


def test_a_stuck_node_is_asked_to_refresh_as_often_as_others():
    scenario = Scenario.named("Binary-v0", faults="stuck,share=1", refresh=5, periods=40, nodes=50)
    reports, periods = np.zeros(50), 0
    for state, _ in play(scenario, rows=4):
        if state.row["period"][0] % 5 == 0:
            assert (state.reports.count == 50).all()
        else:
            reports[: state.reports.count[0]] += 1
        periods += 1
    assert reports.sum() < 0.1 * 50 * periods  # else only changes, of which a stuck sensor has one at most


def test_links_turn_as_a_markov_chain_and_a_bad_one_loses_all_tries():
    scenario = faulty("bursts,to_bad=0.1,to_good=0.3", **SURE, layout="uniform")
    came = []
    for state, _ in play(scenario):
        arrived = np.zeros((ROWS, NODES), bool)
        for row in range(ROWS):
            arrived[row, list(told(state, row))] = True
        came.append(arrived[:, 1:])  # but the head's own
    came = np.array(came)
    good, chances = came[:-1], came[1:].size
    assert came.mean() == pytest.approx(
        0.75, abs=3 * four(0.75, came.size)
    )  # neighbours in time are alike: 2 / (1 - .6)
    assert (~came[1:][good]).mean() == pytest.approx(0.1, abs=four(0.1, good.sum()))
    assert came[1:][~good].mean() == pytest.approx(0.3, abs=four(0.3, chances - good.sum()))


def test_a_bad_link_costs_every_try():
    scenario = faulty("bursts,to_bad=1,to_good=1e-9", retries=2, resample_below=0.0, **SURE)
    radio = scenario.radio
    *_, (state, outcome) = play(scenario, awake=[0, 1, 2])
    assert (state.reports.count == 1).all()
    positions = state.network.positions
    tries = 3 * radio.report_bits
    for node in (1, 2):
        squared = ((positions[:, node] - positions[:, 0]) ** 2).sum(axis=1)
        sent = tries * (radio.tx_j_per_bit + radio.amplifier_j_per_bit_m2 * squared)
        np.testing.assert_allclose(outcome.spent_j[:, node] - radio.awake_j(1.0), sent, rtol=1e-12)


# --- the target -----------------------------------------------------------------------------------------------


def tracks_of(fault):
    """Of waypoints at 1 m/s, without the fault and with it, and where they part: the last instant that both have."""
    usual = dict(motion="waypoint", periods=300)
    sound, struck = (World(faulty(each, **usual)).reset(keys_of(6, ROWS)).track for each in ([], fault))
    parts = [int(np.argmax((a != b).any(axis=1))) - 1 for a, b in zip(sound, struck)]
    assert np.linalg.norm(np.diff(struck[:, :, ::2], axis=1), axis=2).max() <= 1 + 1e-9  # no jumps
    return zip(sound, struck, parts, strict=True)


def test_a_target_that_stops_goes_on_as_it_would_have_gone():
    for sound, struck, last in tracks_of("stops,stops=1,stop_s=9"):
        end = min(last + 10, 301)
        assert (struck[last + 1 : end, ::2] == struck[last, ::2]).all() and not struck[last + 1 : end, 1::2].any()
        np.testing.assert_array_equal(struck[end:], sound[last + 1 : 301 - (end - last - 1)])


def test_a_target_that_leaves_comes_back_to_where_it_turned_and_goes_on():
    returned = 0
    for sound, struck, last in tracks_of("excursion,outside_m=15"):
        turn = last + 1  # there only the velocity is another
        x, y = sound[turn, ::2]
        out = int(np.ceil(min(x, 100 - x, y, 100 - y) + 15))  # at 1 m/s
        if turn + 2 * out <= 300:
            beyond = np.maximum(-struck[:, ::2], struck[:, ::2] - 100).max(axis=1)
            assert beyond.argmax() == turn + out and 15 <= beyond.max() < 16
            np.testing.assert_array_equal(struck[turn + 2 * out :], sound[turn : 301 - 2 * out])
            returned += 1
    assert returned > ROWS / 2


# --- what there is no more ------------------------------------------------------------------------------------


def test_faults_leave_no_reference_and_no_bound():
    bounded = dict(motion="free", search=False)
    assert has_reference(faulty()) and not has_reference(faulty("late"))
    assert why_no_bound(Scenario.named("PreDC-v0", **bounded)) is None
    assert "faults" in why_no_bound(Scenario.named("PreDC-v0", faults="stuck", **bounded))


def test_the_planner_imagines_worlds_without_faults():
    from wsn_env.agents.imagined import imagined_world

    assert imagined_world(faulty("stuck+stops"), 5, 0).scenario.faults == ()


# --- how they are told ----------------------------------------------------------------------------------------


def test_faults_by_text_by_instance_and_by_both():
    scenario = faulty("stuck,share=0.3+late", probability=0.5)
    assert scenario.faults == (Stuck(share=0.3), Late(probability=0.5))
    assert faulty([Stuck(share=0.3), "late,probability=0.5"]) == scenario
    assert faulty(Stuck()).faults == (Stuck(),) and faulty(None).faults == () == faulty("none" and []).faults
    assert scenario.override(share=0.1).faults == (Stuck(share=0.1), Late(probability=0.5))
    assert faulty("stuck,share=0.3", share=0.1).faults == (Stuck(share=0.3),)  # what stands nearer
    assert faulty("failures,share=1e-1+stops,stop_s=1e+1+late").faults[1].stop_s == 10
    assert scenario.as_dict()["faults"][0] == {"kind": "Stuck", "share": 0.3}


@pytest.mark.parametrize(
    ("faults", "words"),
    [
        ("stuk", "Scenario.faults = 'stuk': did you mean stuck?"),
        ("stuck,shares=1", "Stuck has no quantity 'shares': did you mean share?"),
        ("stuck,share=2", "Stuck.share = 2: must be a finite number at least 0 and at most 1"),
        (3, "Scenario.faults = 3: must be faults"),
        ([3], "Scenario.faults = 3: must be faults"),
        (Failures, "Scenario.faults = <class"),
        ("stuck, share=3", "Stuck.share = 3: must be"),
    ],
)
def test_what_is_no_fault_is_refused(faults, words):
    with pytest.raises(ScenarioError) as error:
        faulty(faults)
    assert words in str(error.value)


def test_a_robust_filter_that_leaves_reports_out_takes_them_one_by_one():
    for more, words in ((dict(fusion="pooled"), "allowed is 'joint'"), (dict(silent_information=True), "is False")):
        with pytest.raises(ScenarioError, match=f"{words} with gate_sds"):
            faulty(gate_sds=3.0, **more)


def test_training_takes_faults_last():

    assert world_of("nodes=81,motion=turns") == {"nodes": 81, "motion": "turns"}
    faults = "stuck,share=0.1+late,probability=0.3"
    assert world_of(f"nodes=81,faults={faults}") == {"nodes": 81, "faults": faults}


def test_kept_rows_are_stale_when_a_fault_of_ones_own_changes(tmp_path):
    (tmp_path / "deaf.py").write_text(OWN)
    found = []
    for text in (OWN, OWN.replace("misses = 1.0", "misses = 0.5")):
        (tmp_path / "deaf.py").write_text(text)
        scenario = faulty(f"{tmp_path}/deaf.py:Deaf", periods=10)
        found.append(evaluate(["nearest2"], scenario, episodes=3, keep=tmp_path / "kept").rows[0]["energy_mj"])
    assert found[0] != found[1]


def test_faults_that_do_not_fit_are_refused():
    with pytest.raises(ScenarioError, match="what a Beacon hears is drawn or recorded before"):
        Scenario.named("Ble-v0", faults="biased")
    with pytest.raises(ScenarioError, match="ends_outside = True ends an episode then"):
        faulty("excursion", ends_outside=True)
    with pytest.raises(ScenarioError, match="scenario has no quantity 'bias_m'"):
        faulty("stuck", bias_m=3)


OWN = '''
from dataclasses import dataclass
from wsn_env.models import Fault, quantity


@dataclass(frozen=True)
class Deaf(Fault):
    """Nodes left of a line sense nothing."""

    of_sensing = True
    line_m: float = quantity(50.0, "x of the line")

    @staticmethod
    def strike(f, stream, positions, condition):
        for node in range(len(condition)):
            if positions[node, 0] < f.line_m:
                condition[node].misses = 1.0
'''


def test_a_fault_of_ones_own(tmp_path):
    (tmp_path / "deaf.py").write_text(OWN)
    scenario = faulty(f"{tmp_path}/deaf.py:Deaf,line_m=30", **SURE)
    assert scenario.faults == (class_in(tmp_path / "deaf.py", "Deaf")(line_m=30),)
    for state, _ in play(scenario):
        for row in range(ROWS):
            assert told(state, row).keys() == set(np.flatnonzero(state.network.positions[row, :, 0] >= 30).tolist())


def test_a_fault_that_does_nothing_is_refused():
    class Idle(Fault):
        pass

    with pytest.raises(ScenarioError, match=r"Idle has no strike\(...\): a fault must have it, or change_track"):
        faulty([Idle()])


def test_a_fault_may_not_take_the_scenarios_names():
    @dataclass(frozen=True)
    class Wet(Stuck):
        radius_m: float = quantity(50.0, "of a pond")

    with pytest.raises(ScenarioError, match="Wet.radius_m: is the scenario's; must have another name"):
        faulty([Wet()])


# --- filters that know ----------------------------------------------------------------------------------------


def weighed(scenario, values, sd_m=3.0):
    """Particles and log weights after one period with reports (n, 2) of as many nodes about the middle."""
    tracker, n = ParticleTracker(scenario), len(values)
    belief = Belief.zeros(rows=1, particles=tracker.particles)
    network, reports = Network.zeros(rows=1, nodes=n, cells=2), Reports.zeros(rows=1, reports=n)
    network.positions[0], network.battery[0] = np.linspace((40, 44), (58, 54), n), 1.0
    belief.row["mean"], belief.row["cov"] = (50, 0, 50, 0), np.diag([sd_m**2, 0.01, sd_m**2, 0.01])
    belief.row["predicted_mean"], belief.row["predicted_cov"] = belief.row["mean"], belief.row["cov"]
    keys = np.array([9], np.uint64)
    tracker.start(keys, np.array([0]), np.ones(1, bool), belief)
    reports.count[0], reports.node[0], reports.value[0] = n, np.arange(n), values
    tracker.correct(keys, np.array([1]), belief, network, reports, np.zeros(1, bool))
    return belief


@pytest.mark.parametrize("fusion", ["joint", "pooled"])
def test_the_mixture_is_that_of_plain_numpy(fusion):
    share, node_sd_m = 0.2, 1.5
    values = np.array([[51.0, 49.0], [75.0, 50.0], [48.0, 52.0]])
    settings = dict(particles=600, resample_below=0.0, filter_q=0.0, fusion=fusion)
    scenario = faulty(outlier_share=share, node_sd_m=node_sd_m, **settings)
    belief = weighed(scenario, values)
    x, y = belief.particles[0, 0].astype(float), belief.particles[0, 2].astype(float)
    temper = 4 / (4 + node_sd_m**2)
    # Of an outlier, whose numbers are uniform over 20 m each, over the peak of a good report.
    density = 2 * np.pi * (4 + node_sd_m**2) / 20**2
    log_weights = np.zeros(600)
    for j, (zx, zy) in enumerate(values):
        good = np.exp(-temper * ((x - zx) ** 2 + (y - zy) ** 2) / (2 * 4))
        part = slice(j, None, 3) if fusion == "pooled" else slice(None)
        log_weights[part] += np.log((1 - share) * good + share * density)[part]
    np.testing.assert_allclose(belief.log_weights[0], log_weights - log_weights.max(), atol=2e-5)


def test_the_gate_refuses_what_is_farther_off_than_said_and_nothing_else():
    """A prediction of 3 m and noise of 2 m: sds of 13^(1/2) m in each coordinate."""
    settings = dict(particles=400, resample_below=0.0, filter_q=0.0)
    near, far = [50 + 2.9 * 13**0.5, 50.0], [50.0, 50 - 3.1 * 13**0.5]
    gated = weighed(faulty(gate_sds=3.0, **settings), np.array([near, far]))
    alone = weighed(faulty(**settings), np.array([near]))
    both = weighed(faulty(gate_sds=3.2, **settings), np.array([near, far]))
    np.testing.assert_allclose(gated.log_weights, alone.log_weights, atol=1e-5)
    assert abs(both.log_weights - alone.log_weights).max() > 1


def test_a_filter_that_reckons_with_outliers_outlives_false_alarms():
    errors = []
    for more in ({}, {"outlier_share": 0.05}, {"gate_sds": 3.0}):
        scenario = Scenario.named("PreDC-v0", faults="false_alarms,probability=0.1", particles=300, **more)
        world, policy = World(scenario, threads=1), make_policy("nearest2", scenario)
        state, squares = world.reset(keys_of(8, 100)), 0
        for _ in range(scenario.periods):
            state, outcome = world.step(state, policy.act(View.of(state)), donate=True)
            squares = squares + outcome.error_m**2
        errors.append(np.minimum(np.sqrt(squares / scenario.periods), 5.0))  # some are lost for good
    plain, mixture, gate = errors
    for robust in (mixture, gate):
        saved = plain - robust
        assert saved.mean() > 4 * saved.std() / len(saved) ** 0.5


def test_a_robust_filter_is_refused_where_it_would_do_nothing():
    with pytest.raises(ScenarioError, match="allowed is None, 0, 0 with Binary, which weighs a period at once"):
        Scenario.named("Binary-v0", tracker="particle", gate_sds=3.0)
    with pytest.raises(ScenarioError, match="Tracking.outlier_share = 0.1: allowed is 0.0 with the tracker 'ekf'"):
        faulty(tracker="ekf", outlier_share=0.1)


@pytest.mark.parametrize(("measurement", "steepness"), [("position", 1.0), ("rssi", None)])
def test_what_is_expected_of_a_report_knows_that_its_node_may_stand_elsewhere(measurement, steepness):
    """Its variance grows by node_sd_m^2 H H'."""
    place, mean, cov = np.array([[46.0, 47.0]]), (50, 0, 50, 0), np.diag([0.01, 0.01, 0.01, 0.01])
    sure, unsure = (expected(faulty(measurement=measurement, node_sd_m=sd), place, mean, cov)[0] for sd in (0.0, 3.0))
    for k in range(sure["numbers"]):
        slope = sure["slope_x"][k] ** 2 + sure["slope_y"][k] ** 2
        assert slope > 0 and (steepness is None or slope == steepness)
        assert unsure["variance"][k] == pytest.approx(sure["variance"][k] + 9 * slope)


def test_draws_of_faults_have_purposes_of_their_own():
    purposes = {name: value for name, value in vars(draws).items() if name.isupper() and isinstance(value, int)}
    new = [purposes[name] for name in ("FAULT", "MISS", "FALSE_ALARM", "CHANNEL", "LATE")]
    assert len(set(new)) == 5 and all(list(purposes.values()).count(value) == 1 for value in new)


def test_plain_python_has_the_bits_of_what_is_compiled():
    program = """
import hashlib, numpy as np
from wsn_env import Scenario, View, World, make_policy
faults = "failures,share=0.4+regional_failure+stuck+biased+misplaced+missed+bursts+stops,stop_s=3+excursion".split("+")
faults += ["false_alarms,probability=0.2", "late,probability=0.4"]
robust = dict(gate_sds=4.0, outlier_share=0.1, node_sd_m=1.0)
small = dict(particles=40, nodes=40, periods=12, crossing_m=10.0)
scenario = Scenario.named("PreDC-v0", faults=faults, start="search", **robust, **small)
world, policy, digest = World(scenario, threads=1), make_policy("nearest3", scenario), hashlib.sha256()
state = world.reset([5, 6])
for _ in range(scenario.periods):
    state, outcome = world.step(state, policy.act(View.of(state)))
    digest.update(outcome.error_m.tobytes() + state.residual_j.tobytes() + state.belief.particles.tobytes())
print(digest.hexdigest())
"""
    command = [sys.executable, "-c", program]
    said = [
        subprocess.run(command, env=os.environ | jit, capture_output=True, text=True, check=True).stdout
        for jit in ({"NUMBA_DISABLE_JIT": "0"}, {"NUMBA_DISABLE_JIT": "1"})
    ]
    assert len(said[0]) == 65 and said[0] == said[1]
