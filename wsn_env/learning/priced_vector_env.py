"""Rows in which energy has the price that its scarcity gives it."""

from __future__ import annotations

from typing import Any

import numpy as np

from wsn_env.envs.multi_env import TargetRows
from wsn_env.envs.scarcity import energy_prices
from wsn_env.models.quantity import check_quantity
from wsn_env.simulation.view import View


class PricedVectorEnv(TargetRows):
    """The native vector environment with another lam in every period: `energy_prices` at the episode's own.

    Thousands of periods lie between spending and its consequence, too many for a discounted return; a price brings it
    into the period. Rewards and observations are of the price, and what is learned so acts well at any: as the rule of
    `budget` at the price that makes energy last.

    Args:
        steering: of the price.
        The rest: as TargetRows, of a scenario with `scarce_energy`; lam is the price where there is just what is
            typical.
    """

    def __init__(self, *args: Any, steering: float = 1.0, **settings: Any) -> None:
        super().__init__(*args, **settings)
        if not self.scenario.scarce_energy:
            raise ValueError(f"scarce_energy = False of {self.scenario.name}: must be True for a price of scarcity")
        check_quantity("Scenario", "lam", self.scenario.lam_range[0], above=0)  # the price that is steered
        check_quantity("PricedVectorEnv", "steering", steering, at_least=0, at_most=100)
        self._steering = steering
        self._price = np.zeros(self.num_envs)

    def _restart(self, rows: np.ndarray) -> dict[str, np.ndarray]:
        info = super()._restart(rows)
        self._price[rows] = self._state.lam[rows]
        return info

    def _observe(self, rows: np.ndarray | None = None) -> Any:
        lam = energy_prices(View(self._state.knowledge), self.scenario, self._price, self._steering)
        self._state.row["lam"] = lam
        return super()._observe(rows)
