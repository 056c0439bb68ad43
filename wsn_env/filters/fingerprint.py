"""A fingerprint network: which point of a map sounds like this? General regression (Specht, 1991) over strengths.

The map is made from the strength model and the nodes' positions alone, with a seed of its own: the same for every
episode, and nothing of the target enters.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from wsn_env.filters.linear import LinearModel
from wsn_env.filters.width import fruit_flies, golden_section
from wsn_env.models.field import fixed_positions
from wsn_env.models.quantity import ScenarioError
from wsn_env.scenario import Scenario
from wsn_env.scenario.tracking import Tracking

POINTS_A_SIDE = 21  # of the square grid on which the map is made: 10 m apart in a field of 200 m
SAMPLES = 10  # strengths averaged at a point of the map
VALIDATION = 400  # random points at which a width is judged, one sample each


@dataclass(frozen=True, eq=False)
class FingerprintMap:
    """Strengths at known points; G points, S nodes."""

    points: np.ndarray  # (G, 2) m
    strengths: np.ndarray  # (G, S) in the measurement's unit
    audible: np.ndarray  # (G, S) bool: the node can hear a target there

    @classmethod
    def survey(
        cls,
        points: np.ndarray,
        nodes: np.ndarray,
        model: LinearModel,
        reach_m: float,
        samples: int,
        rng: np.random.Generator,
    ) -> FingerprintMap:
        """Strengths at (G, 2) points, means of so many noisy samples."""
        offset = points[:, None] - nodes
        noise = rng.normal(0.0, model.noise / samples**0.5, offset.shape[:2])
        strengths = model.expected(points, nodes) + noise
        return cls(points, strengths, (offset**2).sum(axis=-1) < reach_m**2)

    def distances(self, nodes: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Squared distance of each point's fingerprint to strengths (..., n) that nodes (n,) heard, over those nodes.

        Points where fewer of the nodes could hear the target than elsewhere are out of the question.

        Returns: (..., G), inf at those points.
        """
        audible = self.audible[:, nodes].sum(axis=1)
        squared = ((self.strengths[:, nodes] - values[..., None, :]) ** 2).sum(axis=-1)
        return np.where(audible == audible.max(), squared, np.inf)


@dataclass(frozen=True, eq=False)
class FingerprintNetwork:
    """General regression network: the mean of the map's points, weighted with exp(-|r - r_i|^2 / (2 width^2)).

    Specht (1991). Heard are any nodes; the others' strengths are not compared.
    """

    map: FingerprintMap
    width: float  # in the measurement's unit
    noise: float  # sd of a strength's difference from a fingerprint, in that unit
    cell_m2: float  # variance of a coordinate within a cell of the map

    def locate(self, nodes: np.ndarray, strengths: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A fix (2,) and its covariance (2, 2) [m, m^2].

        The covariance is the second moment about the fix of a target that may be anywhere on the map, given what was
        heard: the points count by their likelihood, which is a weight of the noise's width, not of the network's. So
        it holds for any nodes heard; with all of them it is on the safe side.

        Args:
            nodes, strengths: (n,) who was heard, n at least 1, and how strong.
        """
        distances = self.map.distances(nodes, strengths)
        fix = _weigh(distances, self.width) @ self.map.points
        offset = self.map.points - fix
        return fix, (offset.T * _weigh(distances, self.noise)) @ offset + self.cell_m2 * np.eye(2)

    def fixes(self, nodes: np.ndarray, strengths: np.ndarray) -> np.ndarray:
        """(..., 2) m: the fixes that `locate` finds, of strengths (..., n) that the same nodes (n,) have heard."""
        return _weigh(self.map.distances(nodes, strengths), self.width) @ self.map.points


def _weigh(distances, width: float) -> np.ndarray:
    """Weights (..., G) that sum to 1, from squared distances (..., G)."""
    nearest = distances.min(axis=-1, keepdims=True)
    weights = np.exp((nearest - distances) / (2 * width**2))
    return weights / weights.sum(axis=-1, keepdims=True)


class Training:
    """The map of a scenario, and the random points at which a width is judged; by the training seed alone."""

    def __init__(self, scenario: Scenario) -> None:
        field, reach_m, seed = scenario.field, scenario.reach_m, scenario.tracking.training_seed
        model = LinearModel(scenario)
        nodes, rng = np.asarray(fixed_positions(field)), np.random.default_rng([seed, 0])
        line = np.linspace(0.0, field.side_m, POINTS_A_SIDE)
        grid = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
        self.map: FingerprintMap = FingerprintMap.survey(grid, nodes, model, reach_m, SAMPLES, rng)
        anywhere = rng.uniform(0.0, field.side_m, (VALIDATION, 2))
        sample = FingerprintMap.survey(anywhere, nodes, model, reach_m, 1, rng)
        heard = [v for v in range(VALIDATION) if sample.audible[v].any()]
        self.points: np.ndarray = anywhere[heard]
        self.distances: np.ndarray = np.empty((len(heard), len(grid)))  # squared, point by point of the map
        for row, v in zip(self.distances, heard, strict=True):
            nodes_heard = np.flatnonzero(sample.audible[v])
            row[:] = self.map.distances(nodes_heard, sample.strengths[v, nodes_heard])
        self._cell_m2, self._noise, self._seed = line[1] ** 2 / 12, model.noise, seed
        measurement: Any = scenario.measurement  # one that has the unit: scenario.tracking.reads
        self._unit = measurement.fingerprint_unit

    def error(self, width: float) -> float:
        """Root mean square error of the fixes at the validation points [m]."""
        offset = _weigh(self.distances, width) @ self.map.points - self.points
        return float(np.sqrt((offset**2).sum(axis=1).mean()))

    def best_width(self, search: str) -> tuple[float, float, int]:
        """The width with the least error, that error [m], and how many widths were tried.

        Args:
            search: "golden" or "foa".
        """
        tried = []

        def error(width):
            tried.append(width)
            return self.error(width * self._unit)

        if search == "golden":
            width, least = golden_section(error)
        else:
            width, least = fruit_flies(error, np.random.default_rng([self._seed, 1]))
        return width * self._unit, least, len(tried)

    def network(self, width: float) -> FingerprintNetwork:
        """The network with this width."""
        return FingerprintNetwork(self.map, width, self._noise * (1 + 1 / SAMPLES) ** 0.5, self._cell_m2)


def trained_network(scenario: Scenario) -> FingerprintNetwork:
    """The network of a scenario; trained once in a process for equal fields, measurements and seeds.

    Raises:
        ScenarioError: nodes stand elsewhere in every episode, or leave the field unheard.
    """
    training = training_of(scenario)
    return _network(training, scenario.tracking.width_search)


def training_of(scenario: Scenario) -> Training:
    """What the network of a scenario is trained on; raises as `trained_network` does."""
    name = f"Tracking.tracker = {scenario.tracking.tracker!r}"
    if fixed_positions(scenario.field) is None:
        raise ScenarioError(
            f"{name}: a fingerprint map needs nodes that stand in the same places in every episode;"
            " Field.positions or Field.field_seed must be given"
        )
    training = _training(_relevant(scenario))
    if not len(training.points):
        raise ScenarioError(f"{name}: a sensing radius of {scenario.radius_m:g} m: must let nodes hear a target")
    return training


_training = lru_cache(maxsize=8)(Training)


def _relevant(scenario: Scenario) -> Scenario:
    """The scenario without what a map does not hang on, so that like ones share theirs."""
    tracking = Tracking(training_seed=scenario.tracking.training_seed)
    own: dict[str, Any] = dict(field=scenario.field, measurement=scenario.measurement, detection=scenario.detection)
    return Scenario(name="fingerprints", period_s=3600.0, tracking=tracking, **own)


@lru_cache(maxsize=16)
def _network(training: Training, search: str) -> FingerprintNetwork:
    return training.network(training.best_width(search)[0])
