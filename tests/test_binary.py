"""Binary sensors in the world: who reports, what the sink knows, what it costs; the particle filter on the bitmap."""

from dataclasses import replace

import numba
import numpy as np
import pytest

from wsn_env import Cluster, Scenario, View, World
from wsn_env.models.detection.base import known_radius
from wsn_env.models.detection.unequal import own_radius
from wsn_env.models.measurement.base import AtHead, node_at, weigh, weigh_period
from wsn_env.models.quantity import ScenarioError
from wsn_env.models.state import state_at
from wsn_env.scenario.constants import constants
from wsn_env.scenario.tracking import BOUNDARY_TRACKERS

REPORT, SEARCH = 3, 5


def scene(**overrides):
    """A target that crosses a field of a hundred nodes, some of which it meets twice."""
    scene = dict(
        nodes=100,
        side_m=200.0,
        radius_m=40.0,
        motion="legs",
        start_m=(20, 20),
        legs=((10, 12, 8), (10, -6, 6), (10, 10, -12)),
        periods=30,
        particles=20,
        search=False,
    )
    return Scenario.named("Binary-v0", **(scene | overrides))


def play(scenario, choose=None, key=1):
    """Yields (awake (S,), state, outcome) each period; `choose(period)` gives who is awake, all by default."""
    world, nodes = World(scenario, threads=1), scenario.field.nodes
    state = world.reset([key])
    for k in range(scenario.periods):
        awake = np.ones(nodes, bool) if choose is None else choose(k)
        state, outcome = world.step(state, Cluster.of([awake.argmax()], awake[None]))
        yield awake, state, outcome


def truth(state):
    """(S,) bool: who is within reach of the target now."""
    offset = state.network.positions[0] - state.track[0, state.period[0], ::2]
    return (offset**2).sum(axis=1) < 40.0**2


def told(state):
    """{node: (state, whether it has changed)} of the period's reports."""
    n = state.reports.count[0]
    return {int(i): tuple(v) for i, v in zip(state.reports.node[0, :n], state.reports.value[0, :n], strict=True)}


def some(k):
    """Half of the nodes, others in every period."""
    return np.random.default_rng(k).random(100) < 0.5


# --- who reports --------------------------------------------------------------------------------------------


def test_those_report_whose_state_has_changed_and_the_sink_knows_all():
    before = np.zeros(100, bool)
    for _, state, outcome in play(scene()):
        now = truth(state)
        assert told(state) == {i: (now[i], 1) for i in np.flatnonzero(now != before)}
        assert outcome.detections[0] == outcome.delivered[0] == (now != before).sum()
        np.testing.assert_array_equal(state.reports.bitmap[0], now)
        np.testing.assert_array_equal(state.sensed[0], now)
        before = now


def test_who_has_slept_compares_with_what_it_sensed_last():
    """Before it has ever sensed that is 0: its first report is a 1."""
    last, first_ones, late_zeros = np.zeros(100, bool), 0, 0
    ever, awake_before = np.zeros(100, bool), np.zeros(100, bool)
    for awake, state, _ in play(scene(), some):
        now = truth(state)
        changed = awake & (now != last)
        assert told(state) == {i: (now[i], 1) for i in np.flatnonzero(changed)}
        first_ones += (changed & ~ever).sum()
        late_zeros += (changed & ~now & ~awake_before).sum()
        last, ever, awake_before = np.where(awake, now, last), ever | awake, awake
        np.testing.assert_array_equal(state.sensed[0], last)
        np.testing.assert_array_equal(state.reports.bitmap[0], last)
        np.testing.assert_array_equal(View.of(state).sees[0], awake & now)
    assert first_ones > 3 and late_zeros > 3


def test_presence_is_reported_in_every_period():
    for awake, state, _ in play(scene(reports="presence"), some):
        now = truth(state)
        assert told(state).keys() == set(np.flatnonzero(awake & now))
        assert {value[0] for value in told(state).values()} <= {1}
        np.testing.assert_array_equal(state.reports.bitmap[0, awake], now[awake])


def test_a_refresh_asks_all_who_are_awake():
    last = np.zeros(100, bool)
    for awake, state, _ in play(scene(refresh=4), some):
        now, period = truth(state), state.period[0]
        changed = awake & (now != last)
        reporting = awake if period % 4 == 0 else changed
        assert told(state) == {i: (now[i], changed[i]) for i in np.flatnonzero(reporting)}
        last = np.where(awake, now, last)


def test_a_refresh_heals_what_losses_have_spoilt():
    """Then a bit stays wrong only if its report is lost, too; else those stay wrong that do not change."""
    wrong, spoilt, healed = {0: [], 5: []}, 0, 0
    for refresh, shares in wrong.items():
        for key in range(8):
            bitmap = np.zeros(100)
            for _, state, _ in play(scene(refresh=refresh, packet_success=0.7, retries=0), key=key):
                before, bitmap, now = bitmap, state.reports.bitmap[0].copy(), truth(state)
                shares.append((bitmap != now).mean())
                if refresh and state.period[0] % refresh == 0:
                    spoilt += (before != now).sum()
                    healed += ((before != now) & (bitmap == now)).sum()
    assert abs(healed / spoilt - 0.7) < 4 * (0.7 * 0.3 / spoilt) ** 0.5 < 0.1
    often, never = (np.reshape(wrong[refresh], (8, 30)).mean(axis=1) for refresh in (5, 0))
    assert (often < never).all()


def test_misread_states():
    """Each with its probability, drawn anew for every node and period."""
    misread = [
        (state.sensed[0] != truth(state)) for key in range(10) for _, state, _ in play(scene(flip=0.05), key=key)
    ]
    n = np.size(misread)
    assert abs(np.mean(misread) - 0.05) < 4 * (0.05 * 0.95 / n) ** 0.5
    again = np.mean(np.array(misread)[1:] & np.array(misread)[:-1])
    assert abs(again - 0.05**2) < 4 * (0.05**2 / n) ** 0.5


# --- radii that differ --------------------------------------------------------------------------------------


@numba.njit
def _radii(cs, own, known):
    for number in range(len(own)):
        own[number], known[number] = own_radius(cs[0].detection, number), known_radius(cs[0].detection, number)


def radii_of(scenario):
    """(S,) m: within which each node senses, and what its tracker takes that for."""
    own, known = np.empty((2, scenario.field.nodes))
    _radii(constants(scenario), own, known)
    return own, known


def unequal(radius_spread, **overrides):
    return scene(detection="unequal", radius_spread=radius_spread, **overrides)


def test_every_node_senses_within_a_radius_of_its_own_the_same_in_every_episode():
    scenario = unequal(0.5, nodes=400)
    radii_m, mean_m = radii_of(scenario)
    assert (mean_m == 40).all() and radii_m.min() >= 20 and radii_m.max() <= 60
    uniform = np.sort(radii_m - 20) / 40  # Kolmogorov and Smirnov's distance
    assert abs(uniform - (np.arange(400) + 0.5) / 400).max() < 1.9 / 400**0.5
    for key in (1, 2):
        for _, state, _ in play(scenario, key=key):
            offset = state.network.positions[0] - state.track[0, state.period[0], ::2]
            np.testing.assert_array_equal(state.sensed[0], np.hypot(*offset.T) <= radii_m)


def test_trackers_know_the_radii_or_take_the_mean():
    own, known = radii_of(unequal(0.5, radii_known=True))
    np.testing.assert_array_equal(own, known)
    np.testing.assert_array_equal(own, radii_of(unequal(0.5))[0])


@pytest.mark.parametrize("tracker", ["boundary_raw", "boundary_mid", "boundary_ekf", "particle"])
@pytest.mark.parametrize("known", [True, False])
def test_radii_without_a_spread_are_equal(tracker, known):
    more = dict(nodes=300, tracker=tracker)
    disc = scene(softness=1e-9, ceiling=1.0, **more)
    for (_, one, _), (_, other, _) in zip(play(disc), play(unequal(0.0, radii_known=known, **more)), strict=True):
        np.testing.assert_array_equal(one.belief.mean, other.belief.mean)


@pytest.mark.parametrize("tracker", ["boundary_raw", "boundary_mid", "boundary_ekf", "particle"])
def test_who_knows_the_radii_errs_less(tracker):
    """In the median: some fixes are almost singular."""
    errors = [
        np.median([outcome.error_m for key in range(5) for *_, outcome in play(unequal(0.3, **more), key=key)])
        for known in (True, False)
        for more in (dict(nodes=600, particles=500, tracker=tracker, radii_known=known),)
    ]
    assert errors[0] < errors[1]


# --- what it costs ------------------------------------------------------------------------------------------


def test_a_report_to_the_sink_by_hand():
    """64 bits over 30 m and 50 m to the middle of the field; who receives is on mains."""
    scenario = scene(nodes=3, positions=((130, 100), (100, 150), (0, 0)), start_m=(115, 115), legs=((40, 0, 0),))
    for awake, state, outcome in play(scenario):
        first = state.period[0] == 1
        joules = [64 * (50e-9 + 150e-12 * d**2) for d in (30, 50)] if first else [0, 0]
        np.testing.assert_allclose(outcome.spent_j[0], [*joules, 0], rtol=1e-9, atol=1e-18)
        assert outcome.energy_j[0, REPORT] == pytest.approx(sum(joules))
        assert awake.all() and outcome.members[0] == 3


def test_a_search_asks_everybody():
    scenario = scene(start="search", wakeup_bits=128)
    world = World(scenario, threads=1)
    state, outcome = world.restart(world.reset([4]), np.ones(1, bool), np.array([4], np.uint64))
    now = truth(state)
    assert told(state).keys() == set(np.flatnonzero(now)) and outcome.members[0] == 100
    np.testing.assert_array_equal(state.sensed[0], now)
    np.testing.assert_array_equal(state.reports.bitmap[0], now)
    np.testing.assert_array_equal(View.of(state).sees[0], now)
    squared = ((state.network.positions[0, now] - 100) ** 2).sum(axis=1)
    joules = 100 * 128 * 100e-9 + (64 * (50e-9 + 150e-12 * squared)).sum()
    assert outcome.energy_j[0, SEARCH] == pytest.approx(joules, rel=1e-9)
    state, _ = world.step(state, Cluster.of([0], np.ones((1, 100), bool)))
    assert told(state).keys() == set(np.flatnonzero(truth(state) != now))


def test_one_bit_has_no_strength_so_that_the_head_after_a_search_tells_nothing_further():
    """Else whoever stands nearest to the target would lead, and be seen to."""
    state = World(scene(start="search"), threads=1).reset(np.arange(20))
    target = state.track[:, 0, ::2]
    away = np.linalg.norm(state.network.positions - target[:, None], axis=2)
    for row in range(20):
        assert state.network.head[row] == np.flatnonzero(away[row] <= 40.0)[0]


# --- the particle filter on the bitmap ----------------------------------------------------------------------


NOBODY = ()  # has reported


def weigh_states(x, log_weights, state, bitmap, nodes, cs):
    """The weights (P,) by a bitmap (S,) of which some nodes have just reported."""
    reports = state.reports.copy()
    reports.bitmap[0], reports.count[0], reports.node[0, : len(nodes)] = bitmap, len(nodes), nodes
    belief = replace(state.belief, particles=x[None].copy(), log_weights=log_weights[None].copy())
    heard = replace(state, reports=reports, belief=belief)
    _weigh_period(heard.handle, cs, np.zeros((0, 0, 0), np.float32), np.empty_like(log_weights))
    log_weights[:] = belief.log_weights[0]


@numba.njit
def _weigh_period(handle, cs, maps, scratch):
    state, c = state_at(handle), cs[0]
    weigh_period(c.measurement, AtHead(state.belief, state.network, state.reports, 0), c, maps, scratch)


@numba.njit
def weigh_state(x, log_weights, positions, node, value, cs):
    weigh(cs[0].measurement, x[0], x[2], log_weights, node_at(positions, node), value)


def cloud(width=30.0, n=500):
    x = np.random.default_rng(0).normal(100, width, (4, n)).astype(np.float32)
    return x, np.zeros(n, np.float32)


@pytest.mark.parametrize("detects", [True, False])
@pytest.mark.parametrize(
    ("overrides", "wrong"),
    [
        ({}, 1e-6),
        (dict(flip=0.02), 0.02),
        (dict(packet_success=0.7, retries=0), 0.3),
        (dict(packet_success=0.0), 0.5),
        (dict(ceiling=0.6), 1e-6),
    ],
)
def test_a_state_weighs_like_plain_numpy(detects, overrides, wrong):
    """A lost report leaves a bit as wrong as a misreading does; one that arrived is only misread."""
    for reported in (False, True):
        x, log_weights = cloud()
        scenario = scene(edge_m=2.0, **overrides).override(positions=((120.0, 90.0),))
        state = World(scenario).reset([0])
        state.network.row["head"] = 0
        weigh_states(x, log_weights, state, [detects], [0] if reported else NOBODY, constants(scenario))
        f = max(overrides.get("flip", 0.0), 1e-6) if reported else wrong
        distance = np.hypot(x[0].astype(float) - 120, x[2].astype(float) - 90)
        p = f + (1 - 2 * f) * scenario.detection.ceiling / (1 + np.exp((distance - 40) / 2))
        np.testing.assert_allclose(log_weights, np.log(p if detects else 1 - p), rtol=2e-4, atol=2e-5)


@pytest.mark.parametrize("width", [0.5, 5.0, 30.0])
def test_nodes_that_are_left_out_would_have_told_all_particles_the_same(width):
    scenario = scene(particles=500)
    *_, (awake, state, _) = play(scenario, some)
    cs = constants(scenario)
    x, log_weights = cloud(width)
    weigh_states(x, log_weights, state, state.reports.bitmap[0], NOBODY, cs)
    everyone = np.zeros(500)
    for node in np.flatnonzero(awake):
        one = np.zeros(500, np.float32)
        value = np.array([state.reports.bitmap[0, node], 0.0])
        weigh_state(x, one, state.network.positions[0], node, value, cs)
        everyone += one
    difference = everyone - log_weights
    np.testing.assert_allclose(difference, difference[0], atol=2e-3)


def test_who_sleeps_or_is_dead_tells_nothing():
    scenario = scene(particles=500)
    *_, (awake, state, _) = play(scenario, some)
    cs, (x, ours), (_, theirs) = constants(scenario), cloud(5.0), cloud(5.0)
    weigh_states(x, ours, state, state.reports.bitmap[0], NOBODY, cs)
    dead = np.flatnonzero(awake)[3:9]
    bitmap = np.where(awake, state.reports.bitmap[0], 1 - state.reports.bitmap[0])
    weigh_states(x, theirs, state, bitmap, NOBODY, cs)
    np.testing.assert_array_equal(ours, theirs)
    state.network.battery[0, dead] = 0.0
    ours[:], theirs[:] = 0, 0
    weigh_states(x, ours, state, bitmap, NOBODY, cs)
    bitmap[dead] = 1 - bitmap[dead]
    weigh_states(x, theirs, state, bitmap, NOBODY, cs)
    np.testing.assert_array_equal(ours, theirs)


# --- who can read one bit -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("overrides", "says"),
    [
        (
            dict(measurement="binary", tracker="ekf"),
            "tracker = 'ekf': cannot read Binary reports; .* position and rssi",
        ),
        (dict(measurement="binary", tracker="snapshot"), "tracker = 'snapshot': cannot read Binary"),
        (dict(measurement="rssi", tracker="boundary"), "'boundary': cannot read Rssi reports; .* measurement binary"),
        (
            dict(measurement="binary", reports="presence", tracker="boundary_ekf"),
            "reports = 'presence': allowed is 'ch",
        ),
        (dict(measurement="binary", silent_information=True), "silent_information = True: allowed is False"),
        (dict(detection="unequal", radii_known=True), "radii_known = True: allowed is False with Position reports"),
        (dict(detection="unequal", radius_spread=1.0), "radius_spread = 1.0: must be .* at least 0 and below 1"),
        (dict(detection="unequal", radii_known=2), "radii_known = 2: allowed are True, False"),
        (dict(measurement="binary", gate_m=0), "Tracking.gate_m = 0: must be a finite number above 0"),
    ],
)
def test_what_does_not_fit_together_is_refused(overrides, says):
    with pytest.raises(ScenarioError, match=says):
        Scenario.named("PreDC-v0", **overrides)


def test_a_tracker_and_its_measurement_may_change_together():
    binary = Scenario.named("Binary-v0", tracker="boundary")
    assert binary.override(measurement="rssi", tracker="ekf").tracking.tracker == "ekf"
    for name in BOUNDARY_TRACKERS:
        assert Scenario.named("PreDC-v0", measurement="binary", tracker=name).measurement.reports_state
