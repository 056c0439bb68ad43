"""How likely nodes detect, for Python."""

import numpy as np
import numpy.typing as npt

from wsn_env.compiled.kernels import kernel
from wsn_env.models.detection.base import probability
from wsn_env.scenario.constants import constants
from wsn_env.scenario.scenario import Scenario


@kernel
def _probabilities(cs, distances, out):
    for i in range(len(distances)):
        out[i] = probability(cs[0].detection, cs[0].measurement, distances[i])


def detection_probability(distance: npt.ArrayLike, scenario: Scenario) -> np.ndarray:
    """Probability that a node detects the target, by the scenario's detection rule.

    Args:
        distance: (...,) m, target to node.

    Returns: (...,) probability.
    """
    distance = np.asarray(distance, dtype=float)
    out = np.empty(distance.size)
    _probabilities(constants(scenario), np.ascontiguousarray(distance).ravel(), out)
    return out.reshape(distance.shape)


def joint_detection_probability(probabilities: npt.ArrayLike) -> np.ndarray:
    """Probability that at least one of the nodes detects: 1 - prod(1 - p_i). Xiang & Guo (2013), eq. 4.

    Args:
        probabilities: (..., n); nodes that do not take part have 0.

    Returns: (...,), the same bits for every batch (the product runs in the order of the nodes).
    """
    missed = np.cumprod(1.0 - np.asarray(probabilities, dtype=float), axis=-1)
    return 1.0 - missed[..., -1]
