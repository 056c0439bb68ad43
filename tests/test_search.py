"""When the network searches for a lost target, and what it then believes."""

import numpy as np
import pytest

from wsn_env import Cluster, Scenario, World

CROWD = [(80 + 2 * i, 80 + 2 * j) for i in range(6) for j in range(6)]
SURE = dict(start_sd_m=0.01, start_sd_ms=1e-4, filter_q=0.0)  # a belief that stays put, well inside the head's reach


def waiting(rows=1, others=(), **overrides):
    """A head and the belief at (20, 20), `others`, and a crowd about the target at (85, 85)."""
    scenario = Scenario.named(
        "PreDC-v0",
        **(
            dict(positions=((20, 20), *others, *CROWD), motion="straight", from_m=20, velocity_ms=0.0)
            | SURE
            | overrides
        ),
    )
    world = World(scenario, threads=1)
    state = world.reset(np.arange(rows))
    state.track[:, :, ::2] = 85.0
    return world, state


def first_search(world, state, members=()):
    """The period of the first search in each row."""
    rows = state.rows
    cluster = Cluster(np.zeros(rows, int), np.tile(np.array(members, int), (rows, 1)))
    first = np.zeros(rows, int)
    while (first == 0).any() and state.period[0] < world.scenario.periods:
        state, outcome = world.step(state, cluster)
        first[(outcome.searched > 0) & (first == 0)] = state.period[0]
    return first


@pytest.mark.parametrize(
    ("members", "overrides", "period"),
    [
        ((), {}, 8),  # 0.4^7 = 1.6e-3, 0.4^8 = 6.6e-4
        ((1,), {}, 4),  # 0.16^3 = 4.1e-3, 0.16^4 = 6.6e-4
        ((1, 2), {}, 3),  # 0.064^2 = 4.1e-3, 0.064^3 = 2.6e-4
        ((1,), dict(packet_success=0.5, retries=0), 6),  # (0.4 x 0.7)^5 = 1.7e-3, ^6 = 4.8e-4
        ((), dict(packet_success=0.5, retries=0, receiver="sink"), 20),  # 0.7^19 = 1.1e-3, 0.7^20 = 8e-4
        ((), dict(search_miss=0.05), 4),  # 0.4^3 = 0.064, 0.4^4 = 0.026
        ((), dict(ceiling=1.0), 1),  # a sure node's silence is enough
    ],
)
def test_silence_triggers_a_search_at_the_hand_computed_period(members, overrides, period):
    world, state = waiting(rows=3, others=((21, 20), (20, 21)), **overrides)
    assert (first_search(world, state, members) == period).all()


def test_who_cannot_be_heard_adds_nothing():
    """A head 80 m from the belief is silent without telling anything."""
    world, state = waiting(periods=40)
    state.track[:, :, ::2] = 20.0
    away = Cluster(np.array([len(CROWD)]), np.zeros((1, 0), int))
    for _ in range(40):
        state, outcome = world.step(state, away)
        assert outcome.searched[0] == 0
    assert state.log_miss[0] == pytest.approx(0, abs=1e-9)


def test_a_report_ends_the_silence():
    world, state = waiting()
    target = state.track.copy()
    state.track[:, 3, ::2] = 20.0  # near the head in period 3, where it is heard (this key) or not
    cluster = Cluster(np.zeros(1, int), np.zeros((1, 0), int))
    heard = []
    for k in range(1, 12):
        state, outcome = world.step(state, cluster)
        if outcome.delivered[0] and not outcome.searched[0]:
            heard.append(k)
            assert state.log_miss[0] == 0
        if outcome.searched[0]:
            break
    assert target.shape == state.track.shape
    assert k == (8 if not heard else heard[-1] + 8)


@pytest.mark.parametrize(("sd", "searched"), [(9.5, 0), (10.5, 1)])
def test_a_belief_wider_than_the_sensing_radius_triggers_a_search(sd, searched):
    """The head is out of everybody's reach, so that the belief keeps its sd (to 1 % with 5000 particles)."""
    world, state = waiting(start_sd_m=sd)
    state.track[:, :, ::2] = 20.0
    state, outcome = world.step(state, Cluster(np.array([len(CROWD)]), np.zeros((1, 0), int)))
    assert outcome.searched[0] == searched


@pytest.mark.parametrize("gap", [1, 3, 5])
def test_searches_keep_their_gap(gap):
    """Nobody can find a target that is out of everybody's reach: the network tries again and again, but not at once."""
    world, state = waiting(rows=2, start_sd_m=30, search_gap=gap, periods=40)
    state.track[:, :, 0], state.track[:, :, 2] = 5.0, 95.0
    cluster = Cluster(np.zeros(2, int), np.zeros((2, 0), int))
    searched = []
    for _ in range(40):
        before = state
        state, outcome = world.step(state, cluster)
        searched.append(outcome.searched)
        if outcome.searched[0]:  # in vain: charged, but nothing is believed anew
            assert outcome.delivered[0] == 0
            assert outcome.energy_j[0, 5] == pytest.approx(len(state.network.battery[0]) * 128 * 100e-9, rel=1e-9)
            assert state.belief.cov[0, 0, 0] > 100 < before.belief.cov[0, 0, 0]
    periods = np.flatnonzero(np.array(searched)[:, 0])
    assert periods[0] == 0 and (np.diff(periods) == gap).all()


def test_the_belief_restarts_at_the_centroid_of_the_detecting_nodes():
    world, state = waiting(rows=20, others=((21, 20),))
    state.belief.particles[:, 1] += np.float32(0.3)  # a velocity to be kept
    state.belief.particles[:, 3] -= np.float32(0.2)
    cluster = Cluster(np.zeros(20, int), np.ones((20, 1), int))
    for _ in range(4):
        before = state
        state, outcome = world.step(state, cluster)
    assert (outcome.searched == 1).all()  # 0.16^4 < 1e-3
    assert before.belief.mean[0, 0] < 30
    belief, particles, farther = state.belief, world.scenario.tracking.particles, []
    for b in range(20):
        n = state.reports.count[b]
        nodes = state.reports.node[b, :n]
        assert n > 3 and (nodes >= 2).all() and outcome.delivered[b] == n
        np.testing.assert_allclose(belief.mean[b, ::2], state.network.positions[b, nodes].mean(axis=0), rtol=1e-12)
        np.testing.assert_allclose(belief.cov[b, [0, 2], [0, 2]], 10**2 / n, rtol=1e-12)
        assert belief.cov[b, 0, 2] == belief.cov[b, 0, 1] == belief.cov[b, 2, 3] == 0
        np.testing.assert_allclose(belief.mean[b, 1::2], [0.3, -0.2], atol=1e-3)
        cloud = belief.particles[b].astype(float)
        for axis in (0, 2):
            assert abs(cloud[axis].mean() - belief.mean[b, axis]) < 5 * 10 / (n * particles) ** 0.5
            assert abs(cloud[axis].std() / (10 / n**0.5) - 1) < 5 / (2 * particles) ** 0.5
        np.testing.assert_array_equal(cloud[1::2], before.belief.particles[b, 1::2])  # q = 0
        # The head is the detecting node with the strongest signal: near, but not always the nearest, for strengths
        # (25 log10 of the distance) have a noise of 3 dB.
        distance = np.linalg.norm(state.network.positions[b, nodes] - 85, axis=1)
        place = list(nodes).index(state.network.head[b])
        assert 25 * np.log10(distance[place] / max(distance.min(), 1.0)) < 4 * 3 * 2**0.5
        farther.append(distance[place] > distance.min())
        assert state.network.n_members[b] == 0
        # The period's error is taken after the search.
        assert outcome.error_m[b] == pytest.approx(np.linalg.norm(belief.mean[b, ::2] - 85), rel=1e-12)
        np.testing.assert_allclose(state.belief.predicted_mean[b, 0], belief.mean[b, 0] + belief.mean[b, 1], rtol=1e-12)
    assert (state.log_miss == 0).all()
    assert 0 < sum(farther) < 15  # of 20


@pytest.mark.parametrize("measurement", ["rssi", "rssi_power"])
def test_strength_decides_on_the_new_head(measurement):
    world, state = waiting(measurement=measurement, others=((21, 20),))
    cluster = Cluster(np.zeros(1, int), np.ones((1, 1), int))
    outcome = None
    while outcome is None or not outcome.searched[0]:
        state, outcome = world.step(state, cluster)
    n = state.reports.count[0]
    assert n > 3
    assert state.network.head[0] == state.reports.node[0, state.reports.value[0, :n, 0].argmax()]


@pytest.mark.parametrize("tracker", ["ekf", "snapshot"])
def test_every_tracker_is_relocated(tracker):
    world, state = waiting(tracker=tracker, others=((21, 20),))
    cluster, outcome = Cluster(np.zeros(1, int), np.ones((1, 1), int)), None
    while outcome is None or not outcome.searched[0]:
        state, outcome = world.step(state, cluster)
    assert outcome.error_m[0] < 10


def test_no_search_when_turned_off():
    world, state = waiting(search=False, periods=30)
    assert (first_search(world, state) == 0).all()


def test_an_episode_may_start_with_a_search():
    world, _ = waiting(start="search", rows=1)
    blank = world.reset(np.arange(50))
    state, outcome = world.restart(blank, np.ones(50, bool), np.arange(50))
    assert (outcome.searched == 1).all()
    found = state.reports.count > 0
    assert 0 < found.sum()
    truth = state.track[:, 0, ::2]
    np.testing.assert_allclose(outcome.error_m, np.linalg.norm(state.belief.mean[:, ::2] - truth, axis=1), rtol=1e-12)
    blind = ~found
    np.testing.assert_allclose(state.belief.mean[blind][:, ::2], 50.0)
    assert (outcome.energy_j[:, :5] == 0).all() and (outcome.energy_j[:, 5] > 0).all()


def test_a_restart_touches_the_marked_rows_only():
    world, state = waiting(rows=4, start="search")
    rows = np.array([False, True, False, True])
    again, outcome = world.restart(state, rows, np.array([9, 10, 11, 12]))
    assert outcome.searched.tolist() == [0, 1, 0, 1]
    assert (outcome.spent_j[~rows] == 0).all()
    np.testing.assert_array_equal(again.network.battery[~rows], state.network.battery[~rows])
    np.testing.assert_array_equal(again.belief.particles[~rows], state.belief.particles[~rows])
    np.testing.assert_array_equal(again.key, [0, 10, 2, 12])


def test_nobody_alive_searches_nothing():
    world, state = waiting(start_sd_m=30)
    state.network.battery[:] = state.residual_j[:] = 0.0
    state.network.alive[:] = state.living[:] = 0
    state, outcome = world.step(state, Cluster(np.zeros(1, int), np.ones((1, 1), int)))
    assert outcome.searched[0] == 0 and outcome.energy_j.sum() == 0
    assert state.network.head[0] == -1 and np.isfinite(outcome.error_m[0])
