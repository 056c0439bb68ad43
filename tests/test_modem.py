"""Joules of an acoustic modem by hand, and what one hop means."""

import numpy as np
import pytest

from wsn_env import Cluster, Scenario, ScenarioError, World
from wsn_env.models.radio.modem import Modem
from wsn_env.models.radio.radio import Radio

SENSING, HANDOVER, INVITATION, REPORT, BROADCAST, SEARCH = range(6)
PLACES = ((500, 500), (600, 500), (500, 700), (500, 760))  # 100, 200 and 260 m from node 0; 2 to 3: 60 m
TX, RX = 1.5 / 640, 0.025 / 640  # J per bit
AWAKE, ASLEEP = 0.0125 * 5, 0.0002 * 5  # J per period


class Talk:
    """A world whose nodes all detect, always, and never resample unless asked."""

    def __init__(self, **overrides):
        quiet = dict(
            positions=PLACES,
            motion="straight",
            from_m=500,
            velocity_ms=0.0,
            threshold_db=0.0,
            particles=50,
            resample_below=0,
            search=False,
        )
        scenario = Scenario.named("Underwater-v0", **(quiet | overrides))
        self.world = World(scenario, threads=1)
        self.state = self.world.reset([0])

    def step(self, head, *members):
        before = self.state.residual_j.copy()
        self.state, outcome = self.world.step(self.state, Cluster(np.array([head]), np.array([members], int)))
        np.testing.assert_allclose(before - self.state.residual_j, outcome.spent_j, rtol=0, atol=5e-11)
        np.testing.assert_allclose(outcome.energy_j.sum(axis=1), outcome.spent_j.sum(axis=1), rtol=1e-12)
        return outcome


def near(joules):
    """But for the rounding of a battery of 50 kJ."""
    return pytest.approx(joules, rel=1e-12, abs=5e-11)


@pytest.mark.interpreted
def test_a_report_costs_the_same_at_any_distance():
    talk = Talk()
    first = talk.step(0, 1, 2)
    assert first.energy_j[0, INVITATION] == near(2 * 32 * (TX + RX))
    outcome = talk.step(0, 1, 2)
    assert outcome.energy_j[0, REPORT] == near(2 * 64 * (TX + RX))
    assert outcome.spent_j[0].tolist() == near([2 * 64 * RX + AWAKE, *[64 * TX + AWAKE] * 2, ASLEEP])
    assert outcome.delivered[0] == 3


def test_listening_and_sleeping_are_paid_every_period():
    talk = Talk()
    for members, awake in (((), 1), ((1,), 2), ((1, 2), 3)):
        assert talk.step(0, *members).energy_j[0, SENSING] == near(awake * AWAKE + (4 - awake) * ASLEEP)
    assert Talk(sleep_w=0.0).step(0).spent_j[0].tolist() == near([AWAKE, 0, 0, 0])


def test_the_dead_pay_nothing_for_sleep():
    talk = Talk(battery_j=1.5e-3)
    talk.step(-1)  # the head cannot even listen; the others sleep
    assert talk.state.network.battery[0].tolist() == near([0, 5e-4, 5e-4, 5e-4])
    outcome = talk.step(3)
    assert (outcome.spent_j[0] <= 5e-4 + 1e-15).all() and outcome.alive[0] == 0


def test_who_is_beyond_one_hop_is_dropped_and_counted():
    outcome = Talk().step(0, 1, 3)
    assert (outcome.members[0], outcome.dropped[0], outcome.delivered[0]) == (2, 1, 2)
    assert outcome.spent_j[0, 3] == near(ASLEEP)
    assert Talk(hop_m=260.0).step(0, 1, 3).dropped[0] == 0
    assert Talk(hop_m=99.0).step(0, 1, 2, 3).members[0] == 1


@pytest.mark.interpreted
def test_a_handover_beyond_one_hop_is_relayed_at_the_old_heads_expense():
    for hop_m, hops in ((260.0, 1), (250.0, 2), (100.0, 3)):
        talk = Talk(hop_m=hop_m)
        talk.step(0)
        outcome = talk.step(3)
        assert outcome.handover[0]
        assert outcome.energy_j[0, HANDOVER] == near(256 * hops * (TX + RX))
        assert outcome.spent_j[0, 0] == near(256 * (hops * TX + (hops - 1) * RX) + ASLEEP)
        assert outcome.spent_j[0, 3] == near(256 * RX + AWAKE)


def test_two_nodes_in_one_place_hand_over_in_one_hop():
    talk = Talk(positions=((500, 500), (500, 500)))
    talk.step(0)
    assert talk.step(1).energy_j[0, HANDOVER] == near(256 * (TX + RX))


def test_a_search_wakes_everybody_but_hears_one_hop():
    talk = Talk(start="search", search=True, noise_db=1e-6)
    state, outcome = talk.world.restart(talk.world.reset([0]), [True], [3])
    assert state.network.head[0] == 0
    assert (outcome.members[0], outcome.detections[0], outcome.delivered[0]) == (4, 4, 3)  # node 3 is 260 m away
    assert outcome.energy_j[0, SEARCH] == near(4 * (32 * RX + AWAKE) + 2 * 64 * (TX + RX))
    assert outcome.spent_j[0, 3] == near(32 * RX + AWAKE)


def test_the_word_to_resample_is_one_transmission():
    outcome = Talk(resample_below=1.0).step(0, 1, 2)
    assert outcome.resampled[0] and outcome.energy_j[0, BROADCAST] == near(32 * (TX + 2 * RX))


def test_energies_that_policies_ask_for():
    modem = Modem()
    assert modem.sending_j(64, 200.0) == near(64 * TX) and modem.receiving_j(64) == near(64 * RX)
    assert modem.sending_j(64, 600.0) == near(64 * (3 * TX + 2 * RX))
    assert modem.report_s == near(0.1 + 250 / 1500)
    radio = Radio()
    assert (radio.hop_m, radio.asleep_j(5.0), radio.awake_j(5.0)) == (np.inf, 0.0, 0.0)
    assert Radio(sensing_nj=7).awake_j(5.0) == near(7e-9)


def test_a_battery_lasts_as_long_as_its_docstring_says():
    modem = Modem()
    assert modem.battery_j / modem.listen_w / 86_400 == pytest.approx(46, abs=0.5)  # days
    assert modem.battery_j / modem.sleep_w / 86_400 / 365 == pytest.approx(8, abs=0.1)  # years


@pytest.mark.parametrize(
    ("overrides", "says"),
    [
        (dict(radio="modem", hop_m=0), "Modem.hop_m = 0: must be a finite number at least 0.001"),
        (dict(radio="modem", bit_rate=0), "Modem.bit_rate = 0"),
        (dict(radio="modem", tx_nj_per_bit=3), "no quantity 'tx_nj_per_bit'"),
        (dict(radio="modem", receiver="sink"), "Modem.receiver = 'sink': allowed are head"),
        (dict(radio="modern"), "did you mean modem"),
        (dict(radio="modem", period_s=0.2), "Scenario.period_s = 0.2: must be at least 0.267 s"),
        (dict(hop_m=250), "no quantity 'hop_m'"),
    ],
)
def test_bad_modems_are_refused(overrides, says):
    with pytest.raises(ScenarioError) as problem:
        Scenario.named("PreDC-v0", **overrides)
    assert says in str(problem.value)
