"""The orders of merit that the menu draws from."""

import numpy as np
import pytest
from scipy import stats

from tests.worlds import expected, expected_gain
from wsn_env import Scenario, View, World
from wsn_env.envs.actions import MenuAction
from wsn_env.models.state import KEEP_CLUSTER

MOVE_WITH_ALL = 18  # the best node leads, the next eight follow


def view_of(scenario, mean, cov):
    """A view of one row whose prediction is given."""
    state = World(scenario, threads=1).reset([1])
    state.belief.predicted_mean[:] = mean
    state.belief.predicted_cov[:] = cov
    return View.of(state)


def order(scenario, by, mean, cov):
    """The nodes in the order `by`."""
    cluster = MenuAction(scenario, by, 12).cluster(np.array([MOVE_WITH_ALL]), view_of(scenario, mean, cov))
    assert cluster.head[0] != KEEP_CLUSTER
    return list(dict.fromkeys((int(cluster.head[0]), *(int(node) for node in cluster.members[0] if node >= 0))))


def test_information_is_greedy_in_the_trace_of_the_posterior():
    scenario = Scenario.named("Anchors-v0")
    m = scenario.measurement
    mean, cov = np.array([60.0, 0, 130, 0]), np.diag([90.0, 1, 40, 1])
    cov[0, 2] = cov[2, 0] = 25.0
    positions = np.array(scenario.field.positions)
    p, left, best_first = cov[::2, ::2].copy(), list(range(8)), []
    while left:
        after = {}
        for node in left:
            d = mean[::2] - positions[node]
            h = -10 * m.exponent / np.log(10) * d / (d @ d + 0.5 * np.trace(cov[::2, ::2]))
            after[node] = p - np.outer(p @ h, h @ p) / (h @ p @ h + m.noise_db**2)
        best = min(left, key=lambda node: np.trace(after[node]))
        p = after[best]
        best_first.append(best)
        left.remove(best)
    assert order(scenario, "information", mean, cov) == best_first


def test_value_takes_the_cheaper_of_two_that_tell_the_same():
    """Nodes 0 and 1 see the target from opposite sides; the sink stands at (100, 100)."""
    scenario = Scenario.named(
        "Anchors-v0", positions=((20.0, 100.0), (80.0, 100.0), (50.0, 10.0)), receiver="sink", lam=10.0
    )
    mean, cov = np.array([50.0, 0, 100, 0]), np.diag([30.0, 1, 30, 1])
    assert order(scenario, "value", mean, cov)[0] == 1
    assert order(scenario.override(lam=0.0), "value", mean, cov) == order(scenario, "information", mean, cov)
    # So dear that the near one comes first though the far one tells more, and free again without lam.
    far_tells_more = scenario.override(positions=((50.0, 85.0), (99.0, 101.0)))
    assert order(far_tells_more, "information", mean, cov) == [0, 1]
    assert order(far_tells_more.override(lam=1e5), "value", mean, cov) == [1, 0]


@pytest.mark.parametrize("offset", [0.0, 2.0, -3.0, 8.0])
def test_a_bit_is_worth_the_variance_that_it_takes_away(offset):
    """Seen from far, a disc's edge is a line: E[var(x | side)] of a normal x by quadrature."""
    radius, sd = 5000.0, 3.0
    scenario = Scenario.named(
        "Binary-v0", side_m=20_000.0, radius_m=radius, edge_m=1e-4, positions=((5000.0, 10_000.0),)
    )
    mean, cov = np.array([10_000.0 + offset, 0, 10_000, 0]), np.diag([sd**2, 1.0, 4.0, 1.0])
    x = np.linspace(-10 * sd, 10 * sd, 200_001)
    density = stats.norm.pdf(x, 0, sd)
    kept = 0.0
    for side in (x < -offset, x >= -offset):
        mass = density[side].sum()
        middle = (x[side] * density[side]).sum() / mass
        kept += ((x[side] - middle) ** 2 * density[side]).sum()
    (node,) = expected(scenario, scenario.field.positions, mean, cov)
    drop, p00, p01, p11 = expected_gain(node, 1.0, cov)
    assert drop == pytest.approx(sd**2 - kept * (x[1] - x[0]), rel=2e-3)
    assert p00 == pytest.approx(sd**2 - drop) and p11 == pytest.approx(4.0) and abs(p01) < 1e-9
