"""What observations tell of a field's other targets, where they are asked to."""

from typing import Any

import numpy as np

from wsn_env.compiled.elementary import exp
from wsn_env.compiled.kernels import lean_piece
from wsn_env.envs.feature import Feature, amount

OTHER_FEATURES = {  # behind those of the belief
    "others_near": amount("other targets about: each counts exp(-d^2 / 2), d radii between the predictions"),
    "other_ahead": Feature("where the nearest other target is predicted, from here, along the velocity", "radius"),
    "other_left": Feature("the same across it, to the left", "radius"),
}
ENTRY_FEATURES = {  # behind those of an action
    "shared": amount("nodes of the cluster that stand in the cluster of another target", "4 nodes"),
}


@lean_piece
def rows_of_field(known: Any, b: int) -> tuple[int, int]:
    """First row of a row's field, and the row after its last; of a view of some rows only, the row itself."""
    targets = max(known.row[b].targets, 1)
    first = b - b % targets
    if first + targets > len(known.row):
        return b, b + 1
    return first, first + targets


@lean_piece
def describe_others(known: Any, b: int, heading: Any, radius_m: float, f: np.ndarray) -> None:
    """Fill f with OTHER_FEATURES of row b; zeros where it is alone.

    Args:
        known: what the network knows (Knowledge).
        heading: the direction of the predicted velocity.
    """
    f[:] = 0.0
    mean, nearest = known.belief[b].predicted_mean, np.inf
    first, stop = rows_of_field(known, b)
    for row in range(first, stop):
        if row != b:
            other = known.belief[row].predicted_mean
            dx, dy = (other[0] - mean[0]) / radius_m, (other[2] - mean[2]) / radius_m
            squared = dx * dx + dy * dy
            f[0] += exp(-0.5 * min(squared, 1400.0))
            if squared < nearest:
                nearest = squared
                f[1] = dx * heading.x + dy * heading.y
                f[2] = dy * heading.x - dx * heading.y


@lean_piece
def mark_elsewhere(known: Any, b: int, nodes: Any) -> None:
    """Mark which nodes (EXPECTED) stand in the clusters of the other targets."""
    first, stop = rows_of_field(known, b)
    for k in range(len(nodes)):
        nodes[k].elsewhere = 0
        for row in range(first, stop):
            if row != b and nodes[k].node >= 0:
                nodes[k].elsewhere |= nodes[k].node == known.network.row[row].head
                for j in range(known.network.row[row].n_members):
                    nodes[k].elsewhere |= nodes[k].node == known.network.members[row, j]
