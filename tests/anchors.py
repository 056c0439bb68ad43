"""Eight anchors round a square that hear a target everywhere: the network of the fingerprint system."""

import numpy as np

from wsn_env import Cluster, Scenario, World
from wsn_env.models.measurement.rssi import Rssi

RING = ((0, 0), (100, 0), (200, 0), (0, 100), (200, 100), (0, 200), (100, 200), (200, 200))


def ring_scenario(**overrides):
    """A target that walks straight legs among them at 10 m/s."""
    ring = dict(
        positions=RING,
        side_m=200.0,
        radius_m=360.0,
        ceiling=1.0,
        measurement=Rssi(exponent=3.0),
        battery_j=1e6,
        motion="legs",
        start_m=(20, 15),
        legs=((12.5, 10, 5), (12.5, 2, 6), (12.5, -8, 2), (12.5, -3, -9)),
        period_s=0.5,
        periods=20,
        filter_q=6**0.5,
        rest_sd_ms=10.0,
        search=False,
        particles=100,
    )
    return Scenario.named("PreDC-v0", **(ring | overrides))


def everyone(rows):
    """The cluster of all anchors."""
    return Cluster.of(np.zeros(rows, int), np.ones((rows, len(RING)), bool))


def play_subsets(scenario, keys, seed=0, world=None):
    """Random subsets of the anchors report, sometimes none but the head; yields the states after each period."""
    world = world or World(scenario, threads=1)
    state = world.reset(keys)
    yield state
    rng, nodes = np.random.default_rng(seed), scenario.field.nodes
    for _ in range(scenario.periods):
        chosen = rng.random((len(keys), nodes)) < rng.random((len(keys), 1))
        state, _ = world.step(state, Cluster.of(rng.integers(nodes, size=len(keys)), chosen))
        yield state


def tell(state, row=0):
    """(positions, values) of a row's reports."""
    n = state.reports.count[row]
    nodes = state.reports.node[row, :n]
    return state.network.positions[row, nodes], state.reports.value[row, :n]
