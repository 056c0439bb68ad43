"""Joules by hand, after eq. 5 with the paper's constants."""

import numpy as np
import pytest

from wsn_env import Cluster, Scenario, World
from wsn_env.models.state import PURPOSES

SENSING, HANDOVER, INVITATION, REPORT, BROADCAST, SEARCH = range(6)
PLACES = ((50, 50), (60, 50), (50, 70), (50, 80))  # 10, 20 and 30 m from node 0
TINY = 1e-15  # rounding of a battery of 1 J


def tx(bits, metres):
    return bits * (50e-9 + 150e-12 * metres**2)


def rx(bits):
    return bits * 100e-9


class Talk:
    """A world whose nodes all detect, always, and never resample unless asked; choices are given as lists."""

    def __init__(self, rows=1, **overrides):
        quiet = dict(
            positions=PLACES,
            motion="straight",
            from_m=50,
            velocity_ms=0.0,
            radius_m=500,
            softness=0.01,
            ceiling=1,
            particles=50,
            resample_below=0,
            search=False,
        )
        self.world = World(Scenario.named("PreDC-v0", **(quiet | overrides)), threads=1)
        self.state = self.world.reset(np.arange(rows))
        self.rows = rows

    def step(self, head, *members):
        """One period; returns the outcome after checking the books."""
        before = self.state.residual_j.copy()
        cluster = Cluster(np.full(self.rows, head), np.tile(np.array(members, int), (self.rows, 1)))
        self.state, outcome = self.world.step(self.state, cluster)
        balanced(before, self.state, outcome)
        return outcome


def balanced(before, state, outcome):
    np.testing.assert_allclose(before - state.residual_j, outcome.spent_j, rtol=0, atol=TINY)
    np.testing.assert_allclose(outcome.energy_j.sum(axis=1), outcome.spent_j.sum(axis=1), rtol=1e-12)


def near(joules):
    return pytest.approx(joules, rel=0, abs=TINY)


def test_purposes_are_in_the_order_of_the_kernels():
    assert PURPOSES == ("sensing", "handover", "invitation", "report", "broadcast", "search")


@pytest.mark.interpreted
def test_a_report_over_ten_metres():
    talk = Talk()
    talk.step(0, 1)
    outcome = talk.step(0, 1)
    assert outcome.spent_j[0, 1] == near(512 * (50e-9 + 150e-12 * 100))
    assert outcome.spent_j[0, 0] == near(512 * 100e-9)
    assert outcome.spent_j[0, 2:].tolist() == [0, 0]
    assert outcome.energy_j[0, REPORT] == near(tx(512, 10) + rx(512))
    assert outcome.delivered[0] == 2 and outcome.detections[0] == 2  # the head's own is free
    assert outcome.energy_mj[0] == pytest.approx(1e3 * (tx(512, 10) + rx(512)), rel=1e-9)


def test_invitations_of_the_first_period():
    outcome = Talk().step(0, 1, 2)
    assert outcome.energy_j[0, INVITATION] == near(tx(128, 10) + tx(128, 20) + 2 * rx(128))
    assert outcome.energy_j[0, HANDOVER] == 0 and outcome.handover[0] == 0
    assert outcome.spent_j[0, 2] == near(rx(128) + tx(512, 20))
    assert outcome.members[0] == 3


@pytest.mark.interpreted
def test_only_new_members_are_invited():
    talk = Talk()
    talk.step(0, 1, 2)
    assert talk.step(0, 2, 1).energy_j[0, INVITATION] == 0
    assert talk.step(0, 1, 2, 3).energy_j[0, INVITATION] == near(tx(128, 30) + rx(128))
    assert talk.step(0, 3).energy_j[0, INVITATION] == 0  # leaving costs nothing
    assert talk.step(0, 1, 3).energy_j[0, INVITATION] == near(tx(128, 10) + rx(128))
    assert talk.step(0).energy_j[0].sum() == 0  # the head alone talks to nobody


def test_a_handover_and_invitations_to_all():
    talk = Talk()
    talk.step(0, 1, 2)
    outcome = talk.step(1, 0, 2)
    apart = 500**0.5  # nodes 1 and 2
    assert outcome.energy_j[0, HANDOVER] == near(tx(448, 10) + rx(448))
    assert outcome.energy_j[0, INVITATION] == near(tx(128, 10) + tx(128, apart) + 2 * rx(128))
    assert outcome.energy_j[0, REPORT] == near(tx(512, 10) + tx(512, apart) + 2 * rx(512))
    assert outcome.handover[0] == 1
    assert outcome.spent_j[0, 0] == near(tx(448, 10) + rx(128) + tx(512, 10))
    assert outcome.spent_j[0, 1] == near(rx(448) + tx(128, 10) + tx(128, apart) + 2 * rx(512))


@pytest.mark.parametrize("receiver", ["sink", "target"])
def test_a_sink_and_the_target_call_those_that_have_slept(receiver):
    talk = Talk(receiver=receiver)
    assert talk.step(0, 1).energy_j[0, INVITATION] == near(2 * rx(128))
    assert talk.step(1, 0, 2).energy_j[0, INVITATION] == near(rx(128))
    outcome = talk.step(3, 2)
    assert outcome.energy_j[0, INVITATION] == near(rx(128))
    assert outcome.energy_j[0, HANDOVER] == 0 and outcome.handover[0] == 0


def test_the_head_among_the_members_and_minus_one_to_keep_it():
    talk = Talk()
    assert talk.step(0, 0, 1).members[0] == 2
    outcome = talk.step(-1, 1, 0)
    assert (outcome.members[0], outcome.dropped[0], outcome.energy_j[0, INVITATION]) == (2, 0, 0)
    assert talk.state.network.head[0] == 0


def test_the_handover_of_every_particle():
    talk = Talk(handover="particles")
    talk.step(0)
    assert talk.step(1).energy_j[0, HANDOVER] == near(tx(5 * 32 * 50, 10) + rx(5 * 32 * 50))


def test_the_resampling_broadcast_reaches_the_farthest_member():
    talk = Talk(resample_below=1)
    outcome = talk.step(0, 1, 2)
    assert outcome.resampled[0] == 1
    assert outcome.energy_j[0, BROADCAST] == near(tx(32, 20) + 2 * rx(32))
    assert outcome.spent_j[0, 1] == near(rx(128) + tx(512, 10) + rx(32))
    assert talk.step(0).energy_j[0, BROADCAST] == 0  # nobody to tell


def test_no_broadcast_without_resampling():
    outcome = Talk().step(0, 1, 2)
    assert outcome.resampled[0] == 0 and outcome.energy_j[0, BROADCAST] == 0


def test_sensing_is_charged_to_the_awake():
    outcome = Talk(sensing_nj=2000).step(0, 1)
    assert outcome.energy_j[0, SENSING] == near(2 * 2e-6)
    assert outcome.spent_j[0, 2] == 0


@pytest.mark.interpreted
def test_a_search_wakes_everybody_at_the_receivers_cost():
    talk = Talk(start="search", search=True)
    fresh = talk.world.reset([0])
    state, outcome = talk.world.restart(fresh, [True], [3])
    assert outcome.searched[0] == 1
    reports = tx(512, 10) + tx(512, 20) + tx(512, 30) + 3 * rx(512)  # node 0 stands where the target is
    assert state.network.head[0] == 0
    assert outcome.energy_j[0, SEARCH] == near(4 * rx(128) + reports)
    assert outcome.energy_j[0].sum() == near(4 * rx(128) + reports)
    np.testing.assert_allclose(outcome.spent_j[0, 1], rx(128) + tx(512, 10), atol=TINY)
    np.testing.assert_allclose(1 - state.residual_j, outcome.spent_j, atol=TINY)


def test_a_search_under_a_sink_calls_everybody_once():
    talk = Talk(receiver="sink", search=True, noise_m=1e4, start_sd_m=5000)
    outcome = talk.step(3)
    assert outcome.searched[0] == 1 and talk.state.network.head[0] == 0
    assert outcome.energy_j[0, INVITATION] == near(rx(128))  # node 3's, before
    reports = sum(tx(512, d) for d in (0, 10, 20, 30))
    assert outcome.energy_j[0, SEARCH] == near(4 * rx(128) + reports)


def test_a_search_hands_over_from_the_old_head():
    talk = Talk(search=True, noise_m=1e4, start_sd_m=5000)  # a belief wider than the radius is lost at once
    outcome = talk.step(3)
    assert outcome.searched[0] == 1 and talk.state.network.head[0] == 0
    assert outcome.handover[0] == 1
    assert outcome.energy_j[0, HANDOVER] == near(tx(448, 30) + rx(448))


def test_every_try_of_a_lost_report_is_charged():
    talk = Talk(packet_success=0)
    outcome = talk.step(0, 1)
    assert outcome.energy_j[0, REPORT] == near(4 * (tx(512, 10) + rx(512)))
    assert outcome.spent_j[0, 0] == near(tx(128, 10) + 4 * rx(512))
    assert outcome.delivered[0] == 1 and outcome.detections[0] == 2  # the head's own arrives
    assert Talk(packet_success=0, retries=0).step(0, 1).energy_j[0, REPORT] == near(tx(512, 10) + rx(512))


def test_tries_are_geometric():
    rows, success = 4000, 0.4
    talk = Talk(rows, packet_success=success)
    outcome = talk.step(0, 1)
    tries = outcome.energy_j[:, REPORT] / (tx(512, 10) + rx(512))
    np.testing.assert_allclose(tries, np.round(tries), atol=1e-9)
    expected = np.array([success, success * 0.6, success * 0.36, 0.6**3])
    counts = np.bincount(np.round(tries).astype(int), minlength=5)[1:]
    assert (np.abs(counts - rows * expected) < 4 * (rows * expected * (1 - expected)) ** 0.5).all()
    assert (outcome.delivered[tries < 3.5] == 2).all()
    lost = 0.6**4
    assert abs((outcome.delivered == 1).mean() - lost) < 4 * (lost * (1 - lost) / rows) ** 0.5
    assert talk.world.scenario.radio.delivery == pytest.approx(1 - lost)


def test_a_sender_that_cannot_pay_is_emptied_and_sends_nothing():
    talk = Talk(battery_j=3e-5, invitation_bits=0)  # a report over 10 m takes 3.3e-5 J
    outcome = talk.step(0, 1)
    assert outcome.spent_j[0].tolist() == [0, 3e-5, 0, 0]
    assert talk.state.network.battery[0, 1] == 0
    assert outcome.delivered[0] == 1 and outcome.alive[0] == 3
    assert talk.state.network.n_members[0] == 0


def test_a_receiver_that_cannot_pay_is_emptied_and_hears_nothing():
    talk = Talk(battery_j=4e-5, invitation_bits=0)  # hearing a report takes 5.1e-5 J
    outcome = talk.step(0, 1)
    assert outcome.spent_j[0] == pytest.approx([4e-5, tx(512, 10), 0, 0], rel=1e-12)
    assert talk.state.network.head[0] == -1 and outcome.alive[0] == 3
    assert outcome.delivered[0] == 1  # its own


def test_who_cannot_pay_for_the_invitation_does_not_join():
    talk = Talk(battery_j=1e-5)  # hearing an invitation takes 1.28e-5 J
    outcome = talk.step(0, 1)
    assert outcome.members[0] == 1 and talk.state.network.battery[0, 1] == 0
    assert outcome.delivered[0] == 1


def test_the_dead_take_no_part():
    talk = Talk(battery_j=3e-5, invitation_bits=0)
    talk.step(0, 1)
    outcome = talk.step(1, 1, 2)  # node 1 is dead: node 0 keeps the lead
    assert outcome.dropped[0] == 2
    assert talk.state.network.head[0] == 0
    assert outcome.spent_j[0, 1] == 0


def test_a_headless_network_chooses_the_living_node_nearest_to_the_prediction():
    talk = Talk(battery_j=4e-5, invitation_bits=0)
    talk.step(0, 1)
    talk.step(0)
    assert talk.state.network.head[0] == 1


def test_a_cluster_of_another_batch_is_refused():
    talk = Talk(2)
    with pytest.raises(ValueError, match=r"cluster has head \(1,\).*must be \(2,\)"):
        talk.world.step(talk.state, Cluster(np.array([0]), np.array([[1]])))
    with pytest.raises(ValueError, match="members"):
        talk.world.step(talk.state, Cluster(np.array([0, 0]), np.array([1, 1])))
    with pytest.raises(ValueError, match="rows"):
        talk.world.restart(talk.state, [True], [1, 2])


def test_a_sink_hears_reports_at_the_senders_price_only():
    talk = Talk(receiver="sink", invitation_bits=40, positions=((50, 50), (60, 50), (50, 70), (90, 80)))
    outcome = talk.step(0, 1, 3)
    calls = np.array([rx(40), rx(40), 0, rx(40)])
    reports = np.array([tx(512, 0), tx(512, 10), 0, tx(512, 50)])  # from the middle of 100 m x 100 m
    np.testing.assert_allclose(outcome.spent_j[0], calls + reports, rtol=0, atol=TINY)
    assert outcome.delivered[0] == 3 and not outcome.handover[0]
    outcome = talk.step(1, 0, 2)  # another leads: nothing is handed over, and who was awake need not be called
    np.testing.assert_allclose(
        outcome.spent_j[0], [tx(512, 0), tx(512, 10), rx(40) + tx(512, 20), 0], rtol=0, atol=TINY
    )
    assert not outcome.handover[0] and outcome.energy_j[0, HANDOVER] == 0


@pytest.mark.interpreted
def test_beacons_go_as_far_as_the_target_is_predicted_and_so_tell_nothing():
    talk = Talk(receiver="target", rows=2)
    predicted = talk.state.belief.predicted_mean.copy()
    far = talk.state.copy()
    far.track[:, :, 0] = 99.0
    outcome = talk.step(0, 3)
    for row in range(2):
        way = np.hypot(predicted[row, 0] - 50, predicted[row, 2] - 80)
        assert outcome.spent_j[row, 3] == near(rx(128) + tx(512, way))
    _, elsewhere = talk.world.step(far, Cluster(np.zeros(2, int), np.full((2, 1), 3)))
    np.testing.assert_array_equal(elsewhere.spent_j, outcome.spent_j)


@pytest.mark.interpreted
def test_under_a_sink_a_cluster_outlives_its_head():
    """Its head is a node like the others; with a head that receives, the cluster ends with it."""
    for receiver, left in (("sink", (1, [2, 3])), ("head", (-1, []))):
        talk = Talk(receiver=receiver, sensing_nj=1000.0)
        talk.step(0, 1, 2, 3)
        talk.state.residual_j[0, 0] = talk.state.network.battery[0, 0] = 1e-9
        talk.step(0, 1, 2, 3)
        network = talk.state.network
        assert (network.head[0], network.members[0, : network.n_members[0]].tolist()) == left
