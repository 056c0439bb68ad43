"""Reports that do not say of which target they are: events, densities, what nodes report, what heads make of it."""

from dataclasses import dataclass
from datetime import datetime
from itertools import permutations, product

import gymnasium as gym
import numpy as np
import pytest
from numba import njit

from wsn_env import Cluster, Scenario, ScenarioError, View, World, evaluate, make_policy
from wsn_env.compiled import draws
from wsn_env.evaluation.correspondence import Correspondence
from wsn_env.models.association.base import Association, heard_of_target
from wsn_env.models.association.events import weights_of_others
from wsn_env.models.association.fit import false_density
from wsn_env.models.association.unknown import Unknown
from wsn_env.models.measurement.base import node_at
from wsn_env.models.state import Reports, reports_at, state_at
from wsn_env.scenario.constants import constants
from wsn_env.simulation.messages import Episode
from wsn_env.simulation.unnamed import sensed_thing

SMALL = dict(particles=300, periods=30)
CONFUSED = dict(association="unknown", clutter=0.3, **SMALL)


def keys(fields, targets=1, seed=0):
    return np.repeat([draws.key_of_seed(seed + i) for i in range(fields)], targets)


def play(scenario, policy="nearest3", fields=4, **more):
    """State and outcome after every period."""
    world, chooser = World(scenario, **more), make_policy(policy, scenario)
    state = world.reset(keys(fields, scenario.targets))
    for _ in range(scenario.periods):
        state, outcome = world.step(state, chooser.act(View.of(state)), donate=True)
        yield state, outcome


# --- joint events -----------------------------------------------------------------------------------------------


def by_enumeration(chances, fits, false):
    """The same sums, event by event."""
    targets, n = fits.shape
    rest = np.zeros((targets, n + 1))
    for event in product(range(n + 1), repeat=targets):  # which measurement each target has made; n: none
        taken = [j for j in event if j < n]
        if len(set(taken)) < len(taken):
            continue
        others = np.prod([false[j] for j in range(n) if j not in taken])
        for s in range(targets):
            parts = [1 - chances[v] if j == n else chances[v] * fits[v, j] for v, j in enumerate(event) if v != s]
            rest[s, event[s]] += others * np.prod(parts)
    return rest


@pytest.mark.parametrize(("targets", "n"), [(1, 1), (1, 4), (2, 1), (2, 2), (2, 5), (3, 3), (4, 2), (4, 5), (5, 4)])
def test_weights_are_those_of_all_joint_events(targets, n):
    rng = np.random.default_rng(targets * 10 + n)
    for _ in range(20):
        chances, false = rng.uniform(0, 1, targets), rng.uniform(0, 0.01, n)
        fits = rng.uniform(0, 0.05, (targets, n)) * (rng.random((targets, n)) < 0.7)
        found = weights_of_others(chances, fits, false)
        np.testing.assert_allclose(found, by_enumeration(chances, fits, false), rtol=1e-12)


def test_probabilities_are_those_of_stone_soups_jpda():
    """Marginal probabilities of random tracks and measurements, to 1e-6."""
    pytest.importorskip("stonesoup")
    from stonesoup.dataassociator.probability import JPDA
    from stonesoup.hypothesiser.probability import PDAHypothesiser
    from stonesoup.models.measurement.linear import LinearGaussian
    from stonesoup.models.transition.linear import LinearGaussianTimeInvariantTransitionModel
    from stonesoup.predictor.kalman import KalmanPredictor
    from stonesoup.types.detection import Detection
    from stonesoup.types.numeric import Probability
    from stonesoup.types.state import GaussianState
    from stonesoup.types.track import Track
    from stonesoup.updater.kalman import KalmanUpdater

    now, rng = datetime(2025, 1, 1), np.random.default_rng(0)
    standing = LinearGaussianTimeInvariantTransitionModel(
        transition_matrix=np.eye(2), covariance_matrix=1e-12 * np.eye(2)
    )
    updater = KalmanUpdater(LinearGaussian(2, (0, 1), 4.0 * np.eye(2)))
    seen, density = 0.6, 0.002
    for targets, n in [(1, 3), (2, 2), (2, 4), (3, 3), (3, 4)]:
        places, values = rng.normal(0, 4, (targets, 2)), rng.normal(0, 4, (n, 2))
        covs = np.eye(2) + rng.uniform(0.5, 3, (targets, 1, 1)) * np.ones((2, 2))
        tracks = [Track([GaussianState(x.reshape(2, 1), cov, now)]) for x, cov in zip(places, covs)]
        model = updater.measurement_model
        detections = [Detection(z.reshape(2, 1), timestamp=now, measurement_model=model) for z in values]
        settings = dict(prob_detect=Probability(seen), prob_gate=Probability(1.0), include_all=True)
        hypothesiser = PDAHypothesiser(KalmanPredictor(standing), updater, density, **settings)
        theirs = JPDA(hypothesiser).associate(set(tracks), set(detections), now)

        fits = np.empty((targets, n))
        for s in range(targets):
            spread = covs[s] + 4.0 * np.eye(2)
            off = values - places[s]
            squares = np.einsum("ni,ij,nj->n", off, np.linalg.inv(spread), off)
            fits[s] = np.exp(-0.5 * squares) / (2 * np.pi * np.sqrt(np.linalg.det(spread)))
        ours = weights_of_others(np.full(targets, seen), fits, np.full(n, density))
        ours *= np.hstack([seen * fits, np.full((targets, 1), 1 - seen)])
        ours /= ours.sum(axis=1, keepdims=True)
        for s, track in enumerate(tracks):
            told = {id(h.measurement): float(h.probability) for h in theirs[track] if h}
            missed = next(float(h.probability) for h in theirs[track] if not h)
            expected = [told.get(id(each), 0.0) for each in detections] + [missed]
            np.testing.assert_allclose(ours[s], expected, atol=1e-6)


@njit
def _false_densities(cs, places, values, out):
    node = node_at(places, 0)
    for i in range(len(values)):
        out[i] = false_density(node, values[i], cs[0])


@pytest.mark.parametrize("measurement", ["position", "rssi"])
def test_the_density_of_false_measurements_is_one(measurement):
    """It integrates to 1; of positions it is that of the disc where the node detects."""
    scenario = Scenario.named("PreDC-v0", association="unknown", measurement=measurement)
    place = np.array([[50.0, 50.0]])
    if measurement == "position":
        axis = np.arange(25.0, 75.0, 0.25)
        values, cell = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2), 0.25**2
    else:
        values = np.zeros((4000, 2))
        values[:, 0] = np.linspace(-140, 0, 4000)
        cell = 140 / 3999
    out = np.empty(len(values))
    _false_densities(constants(scenario), place, values, out)
    assert out.sum() * cell == pytest.approx(1.0, abs=0.01) and (out >= 0).all()
    if measurement == "position":
        middle = out[np.hypot(*(values - place).T) < 3.0]
        assert middle.mean() == pytest.approx(middle.max(), rel=0.1)  # smooth where points lie apart


# --- what nodes report --------------------------------------------------------------------------------------


@pytest.mark.parametrize("association", ["unknown", "nearest"])
@pytest.mark.parametrize(
    "more",
    [{}, dict(search_miss=0.9, search_gap=3), dict(start="search", receiver="sink", packet_success=0.4)],
    ids=str,
)
def test_one_target_without_clutter_is_as_known_to_the_bit(association, more):
    """Nothing else can have made a report; nor after a search."""
    (*_, (one, _)), (*_, (other, _)) = (
        play(Scenario.named("PreDC-v0", association=each, **SMALL, **more)) for each in ("known", association)
    )
    for (name, ours), (_, theirs) in zip(one.belief.leaves(), other.belief.leaves(), strict=True):
        assert (ours == theirs).all(), name
    assert (one.residual_j == other.residual_j).all()


def test_both_heads_hear_the_same_list_of_a_node():
    """What a node measures it reports to whoever leads: in no order that tells of whom it is."""
    scenario = Scenario.named("PreDC-v0", targets=2, motion="meeting", search=False, **CONFUSED)
    world, chooser = World(scenario), make_policy("nearest3", scenario)
    state, longest = world.reset(keys(6, 2)), 0
    for _ in range(scenario.periods):
        cluster = chooser.act(View.of(state))
        together = np.repeat(cluster.members.reshape(6, -1), 2, axis=0)
        state, outcome = world.step(state, Cluster(np.repeat(cluster.head[::2], 2), together))
        reports = state.reports
        assert (reports.count[::2] == reports.count[1::2]).all()
        for row in range(0, 12, 2):
            n = reports.count[row]
            assert (reports.value[row, :n] == reports.value[row + 1, :n]).all()
            nodes, values = reports.node[row, :n], reports.value[row, :n, 0]
            assert (np.diff(nodes) >= 0).all() and (np.diff(values)[np.diff(nodes) == 0] >= 0).all()
            longest = max(longest, np.bincount(nodes, minlength=1).max())
            assert outcome.delivered[row] == len(set(nodes)) <= outcome.detections[row]
            shares = np.array([reports.share[row : row + 2, :n][:, nodes == node].sum(axis=1) for node in set(nodes)])
            assert n == 0 or (shares.max() <= 1 + 1e-9 and shares.min() >= 0)
    assert longest >= 3


def test_a_list_is_as_many_packets_long_as_it_has_measurements():
    scenario = Scenario.named("PreDC-v0", search=False, association="unknown", clutter=2.0, **SMALL)
    world = World(scenario)
    state = world.reset(keys(30))
    state.track[:, 1:, 0] = 1e4  # the target is elsewhere: all is clutter
    node = np.full((30, 1), 3, np.int32)
    head = np.full(30, 5, np.int64)
    state, outcome = world.step(state, Cluster(head, node))
    report_j = outcome.row["energy_j"][:, 3]
    count = np.array([(state.reports.node[b, : state.reports.count[b]] == 3).sum() for b in range(30)])
    apart = np.linalg.norm(state.network.positions[:, 3] - state.network.positions[:, 5], axis=1)
    r = scenario.radio
    bit_j = 1e-9 * (r.tx_nj_per_bit + r.rx_nj_per_bit) + 1e-12 * r.amplifier_pj_per_bit_m2 * apart**2
    assert report_j == pytest.approx(count * r.report_bits * bit_j) and len(set(count)) > 3


def test_clutter_is_poissons():
    """Mean and variance of a node's false measurements over 20,000 node-periods, within four standard errors."""
    mean, scenario = 0.7, Scenario.named("PreDC-v0", association="unknown", clutter=0.7, search=False, **SMALL)
    world = World(scenario)
    state = world.reset(keys(40))
    state.track[:, 1:, 0] = 1e4
    everyone = np.tile(np.arange(20, dtype=np.int32), (40, 1))
    counts = []
    for _ in range(25):
        state, _ = world.step(state, Cluster(np.zeros(40, np.int64), everyone))
        for b in range(40):
            counts.append(np.bincount(state.reports.node[b, : state.reports.count[b]], minlength=20))
    counts = np.concatenate(counts)
    assert abs(counts.mean() - mean) < 4 * np.sqrt(mean / counts.size)
    assert abs(counts.var() - mean) < 4 * np.sqrt((mean + 2 * mean**2) / counts.size)


@njit
def _joined(targets, cs, handle, found):
    state = state_at(handle)
    for k in range(targets):
        sensor, episode = node_at(state.network.positions[0], 0), Episode(state, 0, 0, 0, targets)
        found[k] = sensed_thing(k, sensor, False, episode, cs[0])[0]


@pytest.mark.parametrize("order", list(permutations((0.0, 2.0, 4.0))), ids=str)
def test_a_chain_of_near_targets_is_one_whatever_their_numbers(order):
    scenario = Scenario.named("PreDC-v0", targets=4, association="unknown", resolution_m=3.0, **SMALL)
    world = World(scenario)
    state = world.reset(keys(1, 4))
    state.track[:, :, 0], state.track[:, :, 2] = np.array([*order, 9.0])[:, None], 50.0
    found = np.zeros(4, bool)
    _joined(4, constants(scenario), state.handle, found)
    assert found.tolist() == [True, False, False, True]


def test_targets_too_near_to_each_other_are_one():
    """Within the resolution a node makes one measurement, about their middle; beyond it two."""
    found = {}
    for apart_m in (1.0, 5.0):
        settings = dict(targets=2, association="unknown", resolution_m=3.0, search=False, ceiling=1.0, softness=0.01)
        scenario = Scenario.named("PreDC-v0", **settings, **SMALL)
        world = World(scenario)
        state = world.reset(keys(60, 2))
        state.track[:, 1, 0], state.track[:, 1, 2] = 50.0, 50.0
        state.track[1::2, 1, 0] += apart_m
        near = np.argsort(np.linalg.norm(state.network.positions - [50.0, 50.0], axis=2), axis=1)[:, :3]
        state, _ = world.step(state, Cluster(near[:, 0], near.astype(np.int32)))
        most = [np.bincount(state.reports.node[b, : state.reports.count[b]]).max() for b in range(0, 120, 2)]
        values = np.concatenate([state.reports.value[b, : state.reports.count[b]] for b in range(0, 120, 2)])
        found[apart_m] = max(most), values.mean(axis=0), 2.0 / np.sqrt(len(values))
    assert (found[1.0][0], found[5.0][0]) == (1, 2)
    for apart_m, (_, mean, error) in found.items():
        assert mean == pytest.approx([50.0 + apart_m / 2, 50.0], abs=4 * max(error, apart_m / 100))


def test_the_bits_do_not_depend_on_batch_or_threads():
    scenario = Scenario.named("PreDC-v0", targets=3, motion="meeting", **CONFUSED)
    *_, (whole, _) = play(scenario, fields=9, threads=2)
    for fields in (4, 1):
        *_, (part, _) = play(scenario, fields=fields, threads=1)
        assert (part.belief.particles == whole.belief.particles[: 3 * fields]).all()
        assert (part.reports.count == whole.reports.count[: 3 * fields]).all()


def test_what_has_not_arrived_stands_nowhere():
    """A sink that hears nothing: its list is empty, also behind its end, whatever nodes have measured and tried."""
    scenario = Scenario.named("PreDC-v0", targets=2, receiver="sink", packet_success=0.0, **CONFUSED)
    searches = detections = 0
    for state, outcome in play(scenario, "nearest8"):
        detections, searches = detections + outcome.detections.sum(), searches + outcome.searched.sum()
        for values in (state.reports.value, state.reports.share, state.reports.count):
            assert (values == 0).all()
    assert detections > 100 and searches > 5


def test_views_have_what_is_probably_the_targets():
    scenario = Scenario.named("PreDC-v0", targets=2, motion="meeting", **CONFUSED)
    others = 0
    for state, _ in play(scenario):
        view, share = View(state.knowledge), state.reports.share
        assert view.detected.shape == state.network.battery.shape
        for b in range(8):
            n = state.reports.count[b]
            nodes, values = state.reports.node[b, :n], state.reports.value[b, :n]
            heard = [node for node in sorted(set(nodes.tolist())) if share[b, :n][nodes == node].sum() >= 0.5]
            assert np.flatnonzero(view.detected[b]).tolist() == heard
            for node in heard:
                likeliest = share[b, :n][nodes == node].argmax()
                assert (view.measured[b, node] == values[nodes == node][likeliest]).all()
            others += n - len(heard)
    assert others > 50
    again = View.from_arrays(view.as_arrays())
    assert (again.detected == view.detected).all() and (again.row["targets"] == 2).all()


# --- what heads make of it ------------------------------------------------------------------------------------


def test_joint_association_keeps_tracks_that_the_nearest_neighbour_loses():
    """Two targets that meet among clutter, 60 episodes; the paired difference beside its standard error."""
    squares, lost = {}, {}
    for association in ("known", "unknown", "nearest"):
        more = dict(association=association) | ({} if association == "known" else dict(clutter=0.3))
        scenario = Scenario.named("PreDC-v0", targets=2, motion="meeting", particles=500, **more)
        found = evaluate("nearest3", scenario, 4.0, 60)
        squares[association] = found.values("nearest3", 4.0, "gospa_m") ** 2
        lost[association] = found.values("nearest3", 4.0, "lost_tracks")
    gap = squares["nearest"] - squares["unknown"]
    assert gap.mean() > 3 * gap.std() / np.sqrt(len(gap)) and squares["known"].mean() < squares["unknown"].mean()
    assert lost["known"].sum() == 0 and lost["unknown"].mean() < 0.3 < lost["nearest"].mean()


@njit
def _heard(handle, b):
    return heard_of_target(reports_at(handle), b)


@pytest.mark.parametrize(
    ("nodes", "shares", "heard"),
    [
        ([4, 4], [0.3, 0.3], 1),  # one of both, whichever it is
        ([4, 9], [0.3, 0.3], 1),  # 1 - 0.7 * 0.7 = 0.51
        ([4, 9], [0.2, 0.2], 0),
        ([4], [0.5], 1),
        ([], [], 0),
    ],
)
def test_a_target_is_heard_if_any_node_has_probably_measured_it(nodes, shares, heard):
    reports = Reports.zeros(rows=1, reports=5, unnamed=5)
    n = reports.count[0] = len(nodes)
    reports.node[0, :n], reports.share[0, :n] = nodes, shares
    assert _heard(reports.handle, 0) == heard


@pytest.mark.parametrize("receiver", ["head", "sink"])
def test_a_search_finds_a_lost_target_among_others_and_clutter(receiver):
    """Its estimate is put far away: after a search it is near its target, not near another or near clutter."""
    scenario = Scenario.named("PreDC-v0", targets=3, receiver=receiver, **(CONFUSED | dict(clutter=0.05)))
    world, chooser = World(scenario), make_policy("nearest3", scenario)
    state = world.reset(keys(40, 3))
    for _ in range(5):
        state, _ = world.step(state, chooser.act(View.of(state)), donate=True)
    lost = np.arange(120) % 3 == 1
    for name in ("mean", "predicted_mean"):
        getattr(state.belief, name)[lost] = [95.0, 0.0, 95.0, 0.0]
    for name in ("cov", "predicted_cov"):
        getattr(state.belief, name)[lost] = np.diag([400.0, 1.0, 400.0, 1.0])
    state.belief.particles[lost, 0], state.belief.particles[lost, 2] = 95.0, 95.0
    world.tracker.relocate(state.key, state.period.copy(), lost, state.belief)
    state, outcome = world.step(state, chooser.act(View.of(state)))
    assert outcome.searched[lost].all()
    for b in np.flatnonzero(lost):
        n = state.reports.count[b]
        assert set(state.reports.share[b, :n]) <= {0.0, 1.0}
        own = state.reports.node[b, :n][state.reports.share[b, :n] == 1.0]
        if receiver == "sink" and len(own):  # which knows what it has heard
            apart = np.linalg.norm(state.network.positions[b, own] - state.belief.mean[b, ::2], axis=1)
            assert apart[own == state.network.head[b]] == pytest.approx(apart.min())
        assert np.bincount(state.reports.node[b, :n], weights=state.reports.share[b, :n]).max(initial=0.0) <= 1.0
    error = outcome.error_m[lost]
    assert np.median(error) < 5.0 and (error < scenario.radius_m).mean() > 0.75
    assert (outcome.error_m[~lost] < 5.0).mean() > 0.95


def test_an_association_of_ones_own():
    """One that uses no report at all only predicts."""

    @dataclass(frozen=True)
    class Deaf(Association):
        """Hears nothing."""

        @staticmethod
        def weigh_reports(a, head, c, maps, scratch):
            pass

    scenario = Scenario.named("PreDC-v0", search=False, association=Deaf(), **SMALL)
    heard = 0
    for state, _ in play(scenario):
        heard += state.reports.count.sum()
        assert (state.belief.log_weights == 0).all()
    assert heard > 100 and scenario.association.names_targets


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (dict(scenario="Binary-v0"), "measurement = Binary: allowed are reports of a position or a strength"),
        (dict(faults="stuck"), "faults = .*: allowed are those of the motion"),
        (dict(tracker="ekf"), "tracker = 'ekf': allowed is 'particle'"),
        (dict(fusion="pooled"), "fusion = 'pooled': allowed is 'joint'"),
        (dict(silent_information=True), "silent_information = True: allowed is False"),
        (dict(gate_sds=3.0), "gate_sds, outlier_share, node_sd_m = 3.0, 0.0, 0.0: allowed are None, 0, 0"),
        (dict(targets=9), "targets = 9: allowed are up to 8"),
        (dict(association="guessed"), "guessed"),
        (dict(clutter=-1.0), r"clutter = -1.0: must be"),
    ],
    ids=str,
)
def test_what_does_not_fit_says_so(settings, words):
    name = settings.pop("scenario", "PreDC-v0")
    with pytest.raises(ScenarioError, match=words):
        Scenario.named(name, **{"association": "unknown", **settings})
    with pytest.raises(ScenarioError, match="has no quantity 'clutter': it is one of association='nearest' and"):
        Scenario.named("PreDC-v0", clutter=0.1)


def test_environments_take_it():
    env = gym.make("wsn_env/Multi-v0", targets=2, clutter=0.2, association="unknown", **SMALL)
    assert isinstance(env.unwrapped.scenario.association, Unknown)
    env.reset(seed=0)
    total = sum(env.step([12, 12])[1] for _ in range(SMALL["periods"]))
    assert -300 < total < 0
    scenario = Scenario.of(env.unwrapped.scenario.as_dict())
    assert scenario == env.unwrapped.scenario
    for name in ("greedy", "adaptive", "pre_dc", "ppo", "planner"):
        policy = make_policy(name, scenario)
        env.reset(seed=1)
        for _ in range(3):
            env.step(policy.act(env.unwrapped.view))
    assert evaluate("nearest1", scenario, 4.0, 2).values("nearest1", 4.0, "reference_m").tolist() == ["", ""]


# --- GOSPA, swaps, lost tracks --------------------------------------------------------------------------------


def test_gospa_is_stone_soups():
    pytest.importorskip("stonesoup")
    from stonesoup.metricgenerator.ospametric import GOSPAMetric
    from stonesoup.types.state import State

    metric, rng = GOSPAMetric(p=2.0, c=10.0), np.random.default_rng(0)
    for targets in (1, 2, 3, 5):
        for _ in range(10):
            tracks, truth = rng.uniform(0, 30, (2, targets, 2))
            measured = Correspondence(1, targets, 10.0)
            measured.note(tracks, truth)
            states = [[State(place.reshape(2, 1), datetime(2025, 1, 1)) for place in each] for each in (tracks, truth)]
            theirs = metric.compute_gospa_metric(*states)[0].value["distance"]
            assert measured.gospa_m[0] == pytest.approx(theirs)


def test_swaps_and_lost_tracks():
    """Two tracks that exchange their targets, of which one is lost in the end; beside a field where all is well."""
    measured = Correspondence(2, 2, 5.0)
    truth = np.array([[0.0, 0.0], [20.0, 0.0]])
    well = [truth, truth]
    measured.note(np.concatenate([truth, truth]), np.concatenate(well))
    assert measured.gospa_m.tolist() == [0.0, 0.0]
    measured.note(np.concatenate([truth[::-1], truth + 1.0]), np.concatenate(well))
    assert measured.swaps.tolist() == [2, 0] and measured.lost_tracks.tolist() == [0, 0]
    measured.note(np.concatenate([truth[::-1], truth]), np.concatenate(well))
    assert measured.swaps.tolist() == [2, 0]  # they keep them
    measured.note(np.concatenate([truth[::-1] + [[0.0, 0.0], [30.0, 0.0]], truth]), np.concatenate(well))
    assert measured.swaps.tolist() == [2, 0] and measured.lost_tracks.tolist() == [1, 0]
    squares = np.array([0.0, 0.0]), np.array([0.0, 4.0]), np.zeros(2), np.array([25.0, 0.0])
    np.testing.assert_allclose(measured.gospa_m, np.sqrt(np.mean(squares, axis=0)))
    measured.note(np.concatenate([truth, truth]), np.concatenate(well))
    assert measured.swaps.tolist() == [4, 0] and measured.lost_tracks.tolist() == [0, 0]
