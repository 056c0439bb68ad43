"""Where the nodes stand."""

from __future__ import annotations

from dataclasses import dataclass
from math import isqrt
from typing import Any, Literal

import numpy as np

from wsn_env.compiled import draws
from wsn_env.compiled.kernels import lean_kernel, lean_piece, piece
from wsn_env.models.quantity import ScenarioError, Section, described, quantity


@dataclass(frozen=True)
class Field(Section):
    """Where the nodes stand: drawn in a square, anew in every episode unless fixed."""

    nodes: int = quantity(225, "number of sensor nodes S", at_least=1, at_most=10_000_000, whole=True)
    side_m: float = quantity(100.0, "side of the square field", at_least=1e-3, at_most=100_000)
    depth_m: float | None = quantity(
        None,
        "depth of the room along y, whose width is side_m; None: a square",
        at_least=1e-3,
        at_most=100_000,
        optional=True,
    )
    layout: Literal["uniform", "grid"] = quantity(
        "uniform",
        "uniform: anywhere; grid: each within a square cell of its own (a square number of nodes)",
        choices=("uniform", "grid"),
    )
    jitter: float = quantity(
        0.25, "grid: uniform offset from the cell's middle, in cells either way", at_least=0, at_most=0.5
    )
    field_seed: int | None = quantity(
        None,
        "one fixed field drawn from this seed; None: a new one each episode",
        at_least=0,
        whole=True,
        optional=True,
    )
    positions: tuple[tuple[float, float], ...] | None = described(
        None, "where the nodes stand, pairs (x, y) [m]; None: they are drawn"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.depth_m is not None and self.positions is None:
            raise ScenarioError(f"Field.depth_m = {self.depth_m}: must be None where nodes are drawn")
        if self.positions is not None:
            if self.field_seed is not None:
                raise ScenarioError(f"Field.field_seed = {self.field_seed}: must be None where positions are given")
            try:
                array = np.asarray(self.positions, dtype=float)
            except (TypeError, ValueError):
                raise ScenarioError(f"Field.positions = {self.positions!r}: must be finite pairs (x, y) in m") from None
            if array.ndim != 2 or array.shape[1] != 2 or not len(array) or not np.isfinite(array).all():
                raise ScenarioError(f"Field.positions has shape {array.shape}: must be finite pairs (x, y) in m")
            for axis, (places, extent) in zip("xy", zip(array.T, self.room_m)):
                if places.min() < 0 or places.max() > extent:
                    raise ScenarioError(
                        f"Field.positions spans {axis} = {places.min()}..{places.max()}: must lie in 0..{extent} m"
                    )
            if self.nodes not in (type(self).nodes, len(array)):
                raise ScenarioError(f"Field.nodes = {self.nodes}: must be {len(array)}, as many as there are positions")
            object.__setattr__(self, "positions", tuple(map(tuple, array.tolist())))
            object.__setattr__(self, "nodes", len(array))
        elif self.layout == "grid" and isqrt(self.nodes) ** 2 != self.nodes:
            raise ScenarioError(f"Field.nodes = {self.nodes}: must be a square number (1, 4, 9, ...) on a grid")

    @property
    def room_m(self) -> tuple[float, float]:
        """Extent along x and y."""
        return self.side_m, self.side_m if self.depth_m is None else self.depth_m


@piece
def scatter(stream: Any, side_m: float, positions: np.ndarray) -> None:
    """Draw the positions (S, 2) uniformly in the square [m]."""
    for i in range(len(positions)):
        positions[i, 0] = side_m * draws.uniform(stream, 2 * i)
        positions[i, 1] = side_m * draws.uniform(stream, 2 * i + 1)


@piece
def lay_out(stream: Any, side_m: float, jitter: float, positions: np.ndarray) -> None:
    """Draw the positions (S, 2), S a square number: each within `jitter` cells of the middle of its own cell [m]."""
    across = int(np.round(np.sqrt(len(positions))))
    cell = side_m / across
    for i in range(len(positions)):
        positions[i, 0] = cell * (i % across + 0.5 + jitter * (2.0 * draws.uniform(stream, 2 * i) - 1.0))
        positions[i, 1] = cell * (i // across + 0.5 + jitter * (2.0 * draws.uniform(stream, 2 * i + 1) - 1.0))


def fixed_positions(field: Field) -> np.ndarray | None:
    """Where the nodes stand in every episode alike: (S, 2) m, or None where each episode draws its own."""
    if field.positions is not None:
        return np.array(field.positions)
    if field.field_seed is None:
        return None
    positions = np.empty((field.nodes, 2))
    _place_by_key(draws.key_of_seed(field.field_seed), field.side_m, field.layout == "grid", field.jitter, positions)
    return positions


@lean_kernel
def _place_by_key(key, side_m, in_grid, jitter, positions):
    stream = draws.stream(key, 0, draws.FIELD)
    if in_grid:
        lay_out(stream, side_m, jitter, positions)
    else:
        scatter(stream, side_m, positions)


@lean_piece
def squared_distance(positions: np.ndarray, i: int, x: float, y: float) -> float:
    """Squared distance of node i to (x, y) [m^2]."""
    dx = positions[i, 0] - x
    dy = positions[i, 1] - y
    return dx * dx + dy * dy
