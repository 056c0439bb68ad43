"""Positions from one period's strengths, many at once: least squares by its reference, nearest fingerprints, GRNN."""

from __future__ import annotations

from typing import Any

import numpy as np

from wsn_env.filters.fingerprint import FingerprintMap, Training, trained_network, training_of
from wsn_env.filters.trilateration import FARTHEST
from wsn_env.models.field import fixed_positions
from wsn_env.papers.grnn.systems import scenario_as_read

REFERENCES = ("first anchor", "last anchor", "all pairs")
USUAL_K, MOST_K = 4, 60


def least_squares(strengths: np.ndarray, reference: str) -> np.ndarray:
    """Linear least squares (eq. 9), whose equations are differences of two anchors' circles.

    Args:
        strengths: (..., S) dBm of all anchors.
        reference: whose circle is taken from the others': that of the "first anchor" or of the "last anchor"; or "all
            pairs" of anchors give an equation each. The text does not say.

    Returns: (..., 2) m; at most FARTHEST sides from the field.
    """
    scenario = scenario_as_read("trilateration")
    measurement: Any = scenario.measurement
    nodes, side_m = np.asarray(fixed_positions(scenario.field)), scenario.field.side_m
    far = FARTHEST * side_m
    squared = measurement.squared_ranges(strengths, far)[0]
    one = np.eye(len(nodes))
    taken = {"first anchor": one[0], "last anchor": one[-1], "all pairs": np.full(len(nodes), 1 / len(nodes))}[
        reference
    ]
    differences = one - taken  # all pairs: the same normal equations as differences from the mean
    gain = np.linalg.pinv(2 * differences @ nodes) @ differences
    points = ((nodes**2).sum(axis=1) - squared) @ gain.T
    return np.clip(points, -far, side_m + far)


def nearest_fingerprints(distances: np.ndarray, points: np.ndarray, k: int) -> np.ndarray:
    """The mean of the k points that sound most alike, weighted with 1 / distance of the strengths.

    Bahl & Padmanabhan (2000), with weights.

    Args:
        distances: (..., G) squared, to each point of the map; points: (G, 2) m.

    Returns: (..., 2) m.
    """
    chosen = np.argpartition(distances, k - 1, axis=-1)[..., :k]
    weights = 1 / np.sqrt(np.maximum(np.take_along_axis(distances, chosen, axis=-1), 1e-12))
    weights /= weights.sum(axis=-1, keepdims=True)
    return (weights[..., None] * points[chosen]).sum(axis=-2)


def best_k(training: Training) -> int:
    """The k with the least error at the points by which the network's width is chosen, too."""

    def error(k: int) -> float:
        offset = nearest_fingerprints(training.distances, training.map.points, k) - training.points
        return float((offset**2).sum(axis=1).mean())

    return min(range(1, MOST_K + 1), key=error)


def by_fingerprints(strengths: np.ndarray, k: int) -> np.ndarray:
    """`nearest_fingerprints` of all anchors' strengths (R, K, S): (R, K, 2) m."""
    known: FingerprintMap = training_of(scenario_as_read("grnn")).map
    everyone = np.arange(strengths.shape[-1])
    return np.stack([nearest_fingerprints(known.distances(everyone, run), known.points, k) for run in strengths])


def by_network(strengths: np.ndarray) -> np.ndarray:
    """The network's fixes of all anchors' strengths (R, K, S): (R, K, 2) m."""
    network = trained_network(scenario_as_read("grnn"))
    everyone = np.arange(strengths.shape[-1])
    return np.stack([network.fixes(everyone, run) for run in strengths])
