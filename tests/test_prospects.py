"""What the menu's entries promise is what comes, on average over the targets that the belief holds possible."""

import numba
import numpy as np
import pytest

from wsn_env import Scenario, View, World
from wsn_env.compiled import draws
from wsn_env.envs.actions import MENU_ENTRIES
from wsn_env.envs.features import BELIEF_FEATURES, MOTION_FEATURES
from wsn_env.envs.interface import Interface, Settings
from wsn_env.envs.prospects import ENTRY_FEATURES
from wsn_env.models.measurement.base import PositionBelief, chance, node_at
from wsn_env.scenario.constants import constants

ROWS = 4000
ENTRIES = (0, 1, 3, 6, 10, 12, 15, 19, 22)  # as it is; head kept, moved to the best, moved ahead


def prospects(scenario, view, order="nearest"):
    """(B, 28) of each feature by name."""
    observation = Interface(scenario, Settings(observation="menu", order=order)).observation
    entries = observation.encode(view)[:, len(BELIEF_FEATURES | MOTION_FEATURES) :].reshape(
        len(view.row), MENU_ENTRIES, -1
    )
    return dict(zip(ENTRY_FEATURES, np.moveaxis(entries, 2, 0)))


def possible_worlds(scenario, sd_m=0.3):
    """One network and cluster in all rows; a belief about one point, and targets drawn from it."""
    world = World(scenario, threads=1)
    state = world.reset([draws.key_of_seed(5)])
    interface = Interface(scenario, Settings(order="information"))
    for action in (11, 1, 4):
        state, _ = world.step(state, interface.action.cluster(np.array([action]), View.of(state)))
    rows = world.reset([draws.key_of_seed(100 + i) for i in range(ROWS)])
    for mine, one in ((rows.network, state.network), (rows.belief, state.belief)):
        for (_, array), (_, value) in zip(mine.leaves(), one.leaves(), strict=True):
            array[:] = value[0]
    rng = np.random.default_rng(0)
    rows.row[:] = state.row[0]
    cov = np.diag([sd_m**2, 1e-4, sd_m**2, 1e-4])
    rows.belief.predicted_cov[:] = cov
    rows.track[:, state.period[0] + 1] = rows.belief.predicted_mean + rng.normal(size=(ROWS, 4)) * np.sqrt(np.diag(cov))
    return world, rows, interface


@pytest.mark.parametrize("sd_m", [0.3, 5.0])
@pytest.mark.parametrize("name", ["PreDC-v0", "Rssi-v0"])
def test_energy_silence_and_detections_come_as_promised(name, sd_m):
    scenario = Scenario.named(name, particles=16, resample_below=0.0, search=False, packet_success=0.8)
    world, state, interface = possible_worlds(scenario, sd_m)
    promised = prospects(scenario, View.of(state), "information")
    for entry in ENTRIES:
        cluster = interface.action.cluster(np.full(ROWS, entry), View.of(state))
        _, outcome = world.step(state, cluster)
        assert outcome.resampled.sum() == 0  # a broadcast is no part of the promise
        detections = 4 * promised["detections"][0, entry]
        energy = scenario.typical_energy_mj * promised["energy"][0, entry] ** 2
        pairs = [(outcome.detections, detections), (outcome.energy_mj, energy)]
        if sd_m < 1:  # nodes are taken to be silent independently, which they are not where the target may be far
            pairs.append((outcome.delivered == 0, promised["silence"][0, entry]))
        for values, expected in pairs:
            se = values.std() / ROWS**0.5
            # Each node's chance is within .01 (rms) for such beliefs, and a cluster has up to nine.
            assert abs(values.mean() - expected) < 4 * se + 0.03 * abs(expected) + 1e-6, (entry, expected)


@numba.njit
def chance_of(cs, positions, node, x, y, xx, xy, yy):
    return chance(cs[0].measurement, node_at(positions, node), PositionBelief(x, y, xx, xy, yy), cs[0])


def test_the_expected_sd_is_that_of_a_kalman_filter_whose_reports_may_be_missed():
    scenario = Scenario.named("PreDC-v0", lam=3.0)
    state = World(scenario, threads=1).reset([draws.key_of_seed(3)])
    promised = prospects(scenario, View.of(state))
    p = state.belief.predicted_cov[0][::2, ::2]
    view, cs = View.of(state), constants(scenario)
    for n in range(9):
        after = p.copy()
        for node in view.nearest(12)[0][0, : n + 1]:
            heard = chance_of(cs, view.positions[0], node, *view.prediction[0], p[0, 0], p[0, 1], p[1, 1])
            noise = scenario.measurement.noise_m**2 * np.eye(2)
            after = after - heard * after @ np.linalg.inv(after + noise) @ after
        assert promised["sd"][0, 10 + n] == pytest.approx(0.5 * np.log(np.trace(after)), abs=1e-5)
        assert promised["sd_drop"][0, 10 + n] == pytest.approx(0.5 * np.log(np.trace(after) / np.trace(p)), abs=1e-5)
        mean_error = promised["error_cost"][0, 10 + n] * scenario.typical_cost(3.0)
        assert mean_error == pytest.approx(np.sqrt(np.pi * np.trace(after)) / 2, rel=3e-3)  # a round belief


def test_a_head_ahead_holds_longer():
    scenario = Scenario.named("PreDC-v0")
    world = World(scenario, threads=1)
    state = world.reset([draws.key_of_seed(i) for i in range(200)])
    promised = prospects(scenario, View.of(state))
    best, ahead = promised["head_ahead"][:, 10], promised["head_ahead"][:, 19]
    assert ahead.mean() > best.mean() + 0.15  # sensing radii
    assert (promised["head_distance"][:, 10] <= promised["head_distance"][:, 19] + 1e-6).all()
