"""What is left of energy and time, and what energy is worth where it is scarce."""

from typing import Any

import numpy as np

from wsn_env.compiled.elementary import exp, log
from wsn_env.compiled.kernels import kernel, lean_piece
from wsn_env.envs.feature import Feature, share
from wsn_env.models.state import knowledge_at
from wsn_env.scenario import Scenario
from wsn_env.scenario.constants import common_constants
from wsn_env.simulation.geometry import energy_about
from wsn_env.simulation.view import View

ENERGY_FEATURES = {  # behind those of the belief
    "time_left": share("time steps left, as a share of the horizon"),
    "energy_left": share("energy left in all nodes, as a share of their batteries"),
    "supply": Feature("energy left over what a typical schedule spends in the time left", "ln / 4"),
    "supply_near": Feature("the same of nodes about the prediction and of the target's time there", "ln / 4"),
    "supply_ahead": Feature("the same where it will be 15 time steps on, if it keeps its velocity", "ln / 4"),
}
FAR_AHEAD = 15.0
LEAST_SUPPLY = 1e-6
LEAST, MOST = 1e-3, 1e3  # prices [m/mJ]


@lean_piece
def describe_energy(known: Any, b: int, c: Any, f: np.ndarray) -> None:
    """Fill f with ENERGY_FEATURES of row b.

    Args:
        known: what the network knows (Knowledge).
        c: the common constants of a scenario with scarce energy.
    """
    row, network, mean = known.row[b], known.network, known.belief[b].predicted_mean
    left_j, ahead = network.row[b].left_j, FAR_AHEAD * c.period_s
    f[0] = (c.periods - row.period) / c.periods
    f[1] = left_j / (row.full_j * network.battery.shape[1])
    f[2] = 0.25 * log(max(1e3 * left_j / _typical_mj(row, c), LEAST_SUPPLY))
    f[3] = 0.25 * log(supply_about(known, b, mean[0], mean[2], c))
    f[4] = 0.25 * log(supply_about(known, b, mean[0] + ahead * mean[1], mean[2] + ahead * mean[3], c))


@lean_piece
def _typical_mj(row, c):
    """What a typical schedule spends in the time left, for all targets [mJ]."""
    return c.typical_energy_mj * max(c.periods - row.period, 1.0) * max(row.targets, 1)


@lean_piece
def supply_about(known: Any, b: int, x: float, y: float, c: Any) -> float:
    """Energy about a point, over what a typical schedule spends while the target is about there in the time left."""
    last = c.presence.shape[0] - 1
    column, line = min(max(int(x / c.cell_m[0]), 0), last), min(max(int(y / c.cell_m[1]), 0), last)
    energy_mj = 1e3 * energy_about(known.network, b, x, y, c.neighbourhood_m)
    return max(energy_mj / (c.presence[column, line] * _typical_mj(known.row[b], c)), LEAST_SUPPLY)


def energy_prices(view: View, scenario: Scenario, price: Any, steering: float) -> np.ndarray:
    """(B,) what a mJ is worth now [m/mJ]: price * supply^-steering, with the supply about the prediction.

    Args:
        scenario: the view's, with `scarce_energy`.
        price: where there is just what is typical, for all or (B,) [m/mJ].
    """
    prices = np.array(np.broadcast_to(price, len(view.row)), dtype=float)
    _steer(0, len(prices), common_constants(scenario), view.knowledge.handle, steering, prices)
    return prices


@kernel
def _steer(start: int, stop: int, cs: Any, handle: np.ndarray, steering: float, prices: np.ndarray) -> None:
    """Multiply prices (B,) by supply^-steering."""
    known = knowledge_at(handle)
    for b in range(start, stop):
        mean = known.belief[b].predicted_mean
        steered = log(prices[b]) - steering * log(supply_about(known, b, mean[0], mean[2], cs[0]))
        prices[b] = exp(min(max(steered, log(LEAST)), log(MOST)))
