"""What is true in the present period, of which a network knows nothing but through reports."""

from typing import Any

from wsn_env.compiled.kernels import lean_piece
from wsn_env.models.measurement.base import Memory


@lean_piece
def target_of(state: Any, b: int) -> tuple[float, float]:
    """The true position (x, y) of a row's target [m]."""
    return target_at(state, b, state.row[b].period)


@lean_piece
def target_at(state: Any, b: int, period: int) -> tuple[float, float]:
    """That of a period."""
    k = min(period, state.track.shape[1] - 1)
    return state.track[b, k, 0], state.track[b, k, 2]


@lean_piece
def memory_of(state: Any, b: int) -> Any:
    """What a row's nodes and their head keep of states and packets."""
    instant = min(state.row[b].period, state.packets.shape[1] - 1)
    return Memory(state.sensed[b], state.reports.bitmap[b], state.packets[b, instant])
