"""A measurement about a point, for filters that are not compiled: what is expected, its slope, its variance."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from wsn_env.compiled.kernels import kernel
from wsn_env.models.measurement.base import at_point, linearise, node_at, unwrap
from wsn_env.scenario import Scenario
from wsn_env.scenario.constants import constants


class Lines(NamedTuple):
    """n reports of k numbers each, linearised about a point."""

    value: np.ndarray  # (n, k) what was reported, told near what is expected
    expected: np.ndarray  # (n, k)
    slope: np.ndarray  # (n, k, 2) of the expected value by x and y [per m]
    variance: np.ndarray  # (n, k) of the noise


class LinearModel:
    """The measurement of a scenario."""

    def __init__(self, scenario: Scenario) -> None:
        self._constants = constants(scenario)
        self.values: int = scenario.measurement.values

    def lines(self, x: float, y: float, places: np.ndarray, values: np.ndarray) -> Lines:
        """About a target at (x, y).

        Args:
            places: (n, 2) where the nodes stand [m].
            values: (n, 2) what they reported.
        """
        n, k = len(places), self.values
        made = np.empty((n, k)), np.empty((n, k)), np.empty((n, k, 2)), np.empty((n, k))
        places, values = np.ascontiguousarray(places, float), np.ascontiguousarray(values, float)
        _linearise(self._constants, float(x), float(y), places, values, made)
        return Lines(*made)

    def near(self, values: np.ndarray, about: Any) -> np.ndarray:
        """Values (n, k), told near others (n, k)."""
        told = np.empty(values.shape)
        _unwrap(self._constants, values, about, told)
        return told

    def expected(self, points: np.ndarray, places: np.ndarray) -> np.ndarray:
        """(G, n) the first number that nodes (n, 2) are expected to measure of targets at points (G, 2)."""
        return np.stack([lines.expected[:, 0] for lines in self._at(points, places)])

    def slopes(self, points: np.ndarray, places: np.ndarray) -> np.ndarray:
        """(G, n, 2) how it changes with the target's x and y."""
        return np.stack([lines.slope[:, 0] for lines in self._at(points, places)])

    def _at(self, points, places) -> list[Lines]:
        nothing = np.zeros((len(places), 2))
        return [self.lines(x, y, places, nothing) for x, y in points]

    @property
    def noise(self) -> float:
        """sd of the first of a value's numbers, in its unit; at a distance of 1 m where that matters."""
        return float(np.sqrt(self.lines(1.0, 0.0, np.zeros((1, 2)), np.zeros((1, 2))).variance[0, 0]))


@kernel
def _linearise(cs, x, y, places, values, lines):
    """Fill in the arrays of `lines`: the fields of Lines."""
    told, expected, slopes, variances = lines
    for i in range(len(places)):
        k = 0
        for line in linearise(cs[0].measurement, node_at(places, i), at_point(x, y)):
            expected[i, k], variances[i, k] = line.expected, line.variance
            slopes[i, k, 0], slopes[i, k, 1] = line.slope_x, line.slope_y
            told[i, k] = unwrap(cs[0].measurement, values[i, k], line.expected)
            k += 1


@kernel
def _unwrap(cs, values, about, told):
    for i in range(values.shape[0]):
        for k in range(values.shape[1]):
            told[i, k] = unwrap(cs[0].measurement, values[i, k], about[i, k])
