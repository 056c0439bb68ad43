"""Nearest nodes through the grid against a look at all of them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wsn_env import Scenario, ScenarioError, World
from wsn_env.models.state import Grid, Network
from wsn_env.simulation.geometry import index, nearest


def network_of(positions, battery=None):
    """A network of one row."""
    side = Grid.side(len(positions))
    network = Network.zeros(rows=1, nodes=len(positions), cells=side * side + 1)
    network.grid.row["side"] = side
    network.positions[0] = positions
    network.battery[0] = 1.0 if battery is None else battery
    network.alive[:] = (network.battery > 0).sum(axis=1)
    index(network)
    return network


def by_looking_at_all(network, point, count):
    """(count,) nodes in order of (squared distance, number), and their distances."""
    offset = network.positions[0] - point
    squared = offset[:, 0] * offset[:, 0] + offset[:, 1] * offset[:, 1]
    order = [i for i in np.lexsort((np.arange(len(squared)), squared)) if network.battery[0, i] > 0][:count]
    missing = count - len(order)
    return order + [-1] * missing, list(np.sqrt(squared[order])) + [np.inf] * missing


def assert_nearest(network, point, count):
    nodes, distances = nearest(network, np.array([point]), count)
    expected, metres = by_looking_at_all(network, point, count)
    assert nodes[0].tolist() == expected
    assert distances[0].tolist() == metres


@settings(max_examples=300, deadline=None)
@given(
    st.integers(0, 2**32), st.integers(1, 900), st.integers(1, 20), st.booleans(), st.sampled_from([1.0, 0.5, 0.03, 0])
)
def test_the_grid_finds_what_a_look_at_all_finds(seed, nodes, count, lattice, living):
    rng = np.random.default_rng(seed)
    positions = rng.uniform(0, 100, (nodes, 2))
    if lattice:  # many at equal distances, on the borders of cells, in one place
        positions = np.round(positions / 12.5) * 12.5
    network = network_of(positions, battery=(rng.random(nodes) < living).astype(float))
    points = [rng.uniform(0, 100, 2), rng.uniform(-400, 500, 2), positions[0], [1e6, -1e9]]
    for point in points:
        assert_nearest(network, np.asarray(point, float), count)


def test_all_nodes_in_one_place_and_in_a_line():
    for positions in (np.full((50, 2), 3.0), np.stack([np.arange(50.0), np.full(50, 7.0)], axis=1)):
        for point in ([3.0, 3.0], [20.2, 7.0], [-5.0, 100.0]):
            assert_nearest(network_of(positions), np.array(point), 12)


@pytest.mark.parametrize("nodes", [1, 225, 10_000])
def test_a_grid_holds_every_node_once_in_its_cell(nodes):
    grid = network_of(np.random.default_rng(0).uniform(0, 100, (nodes, 2))).grid
    assert sorted(grid.nodes[0].tolist()) == list(range(nodes))
    assert grid.starts[0, 0] == 0 and grid.starts[0, -1] == nodes
    assert (np.diff(grid.starts[0]) >= 0).all()
    for start, stop in zip(grid.starts[0], grid.starts[0, 1:]):
        assert (np.diff(grid.nodes[0, start:stop]) > 0).all()


@pytest.mark.parametrize("jitter", [0.0, 0.25, 0.5])
def test_on_a_grid_every_node_keeps_to_its_cell(jitter):
    scenario = Scenario.named("PreDC-v0", nodes=16, layout="grid", jitter=jitter, side_m=80, particles=2)
    positions = World(scenario, threads=1).reset(np.arange(500)).network.positions
    middle = np.stack([10 + 20 * (np.arange(16) % 4), 10 + 20 * (np.arange(16) // 4)], axis=1)
    offset = (positions - middle) / 20
    assert np.abs(offset).max() <= jitter + 1e-12
    if jitter > 0:  # uniform, and independent
        n = offset.size
        assert abs(offset.mean()) < 4 * jitter / (3 * n) ** 0.5
        assert abs(offset.var() / (jitter**2 / 3) - 1) < 4 * (0.8 / n) ** 0.5
        assert abs(np.corrcoef(offset[:, 0].ravel(), offset[:, 1].ravel())[0, 1]) < 4 / 1000**0.5


def test_a_fixed_grid_is_the_same_in_every_episode():
    scenario = Scenario.named("Underwater-v0", field_seed=3, particles=2)
    positions = World(scenario, threads=1).reset([1, 2]).network.positions
    np.testing.assert_array_equal(*positions)


@pytest.mark.parametrize("nodes", [2, 8, 63, 224])
def test_a_grid_needs_a_square_number(nodes):
    with pytest.raises(ScenarioError, match=rf"Field.nodes = {nodes}: must be a square number"):
        Scenario.named("PreDC-v0", nodes=nodes, layout="grid")
