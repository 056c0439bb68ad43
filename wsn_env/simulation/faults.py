"""What faults do in an episode: they strike at its start, and here alone the world acts on what they have done.

Without faults `state.condition` is (B, 0), and everything is as it is.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from wsn_env.compiled import draws
from wsn_env.compiled.elementary import HALF_PI, log, sincos
from wsn_env.compiled.kernels import lean_kernel, lean_piece, over_rows
from wsn_env.models.fault.base import strike
from wsn_env.models.kinds import made_constants
from wsn_env.models.measurement.base import Occasion, tells
from wsn_env.models.state import State, state_at
from wsn_env.scenario import Scenario

NOWHERE_M = 1e9  # a target so far away is sensed by nobody
TRIES = 50  # to sense a target that is not there
DRAWS = 3 * TRIES  # of random numbers for that
LONGEST = 1e12  # periods without a turn


class Faults:
    """A scenario's faults of nodes."""

    def __init__(self, scenario: Scenario) -> None:
        faults = enumerate(scenario.faults)
        self._constants = [(made_constants(fault, scenario), number) for number, fault in faults if fault.strikes]
        self.any: bool = bool(self._constants)

    def strike(self, rows: np.ndarray, state: State, threads: int) -> None:
        """Begin episodes in the rows marked (B,), whose keys and positions are there."""
        if self.any:
            state.condition[rows] = 0
        for made, number in self._constants:
            over_rows(_strike, len(rows), threads, made, number, rows, state.handle)


@lean_kernel
def _strike(start: int, stop: int, cs: Any, number: int, rows: np.ndarray, handle: np.ndarray) -> None:
    state = state_at(handle)
    for b in range(start, stop):
        if rows[b]:
            stream = draws.stream(state.key[b], number, draws.FAULT)
            strike(cs[0], stream, state.network.positions[b], state.condition[b])


@lean_piece
def fail_nodes(state: Any, b: int) -> None:
    """The nodes whose time has come lose what they have left; nobody hears of it."""
    condition, residual_j, period = state.condition[b], state.residual_j[b], state.row[b].period
    for node in range(len(condition)):
        if condition[node].fails_at == period and period > 0 and residual_j[node] > 0.0:
            residual_j[node] = 0.0
            state.living[b] -= 1


@lean_piece
def what_is_sensed(state: Any, b: int, sensor: Any, asked: bool, target: Any, c: Any) -> Any:
    """What an awake node senses, if it detects it.

    Args:
        sensor: its Node.
        asked: whether the head is looking for a lost target.
        target: the true position (x, y) [m].

    Returns: an Occasion, and a target's position (x, y) [m]: those that there are, unless something is wrong.
    """
    key, period, x, y = state.key[b], state.row[b].period, target[0], target[1]
    occasion = Occasion(key, period, asked, period)
    if state.condition.shape[1] == 0:
        return occasion, x, y
    own = state.condition[b, sensor.number]
    if own.stuck_at > 0 and period >= own.stuck_at:
        return Occasion(key, own.stuck_at, asked, period), own.stuck_x, own.stuck_y
    x, y = x + own.off_x, y + own.off_y
    if own.misses > 0.0 and draws.uniform(draws.stream(key, period, draws.MISS), sensor.number) < own.misses:
        x = NOWHERE_M
    if own.false_alarms > 0.0 and not tells(c.measurement, occasion, sensor, x, y, c):
        stream = draws.stream(key, period, draws.FALSE_ALARM)
        first = sensor.number * (DRAWS + 1)
        if draws.uniform(stream, first) < own.false_alarms:
            found, other, false_x, false_y = target_not_there(stream, first + 1, sensor, asked, period, c)
            if found:
                return other, false_x, false_y
    return occasion, x, y


@lean_piece
def target_not_there(stream: Any, first: int, sensor: Any, asked: bool, period: int, c: Any) -> Any:
    """A target that a node senses though it is not there: of uniform points within the sensing radius the first that it
    detects.

    Args:
        first: of DRAWS random numbers.
        sensor: its Node.

    Returns: whether there is one, an Occasion, and where it seems to be (x, y) [m].
    """
    occasion, x, y = Occasion(np.uint64(0), period, asked, period), 0.0, 0.0
    for attempt in range(TRIES):
        draw = first + 3 * attempt
        occasion = Occasion(draws.bits(stream, draw), period, asked, period)
        far = c.radius_m * np.sqrt(draws.uniform(stream, draw + 1))
        sin, cos = sincos(4.0 * HALF_PI * draws.uniform(stream, draw + 2))
        x, y = sensor.x + far * cos, sensor.y + far * sin
        if tells(c.measurement, occasion, sensor, x, y, c):
            return True, occasion, x, y
    return False, occasion, x, y


@lean_piece
def hold_back(state: Any, b: int, node: Any, report: Any, is_heads: bool) -> Any:
    """What a node sends in this period, of a report that it has just made and of one that may be waiting.

    Args:
        report: the two numbers of its value, and how many packets long it is.
        is_heads: it need not be sent, and is never late.

    Returns: whether it sends any, and which: the new one, or if that is late the one that was late in the last period.
    """
    if state.condition.shape[1] == 0:
        return True, report
    own, period = state.condition[b, node], state.row[b].period
    was_late, older = own.waiting == period - 1, (own.value[0], own.value[1], own.packets)
    own.waiting = 0
    if is_heads or own.late <= 0.0 or draws.uniform(draws.stream(state.key[b], period, draws.LATE), node) >= own.late:
        return True, report
    own.waiting = period
    own.value[0], own.value[1], own.packets = report
    return was_late and period > 1, older


@lean_piece
def try_success(state: Any, b: int, node: Any, usual: float) -> float:
    """Probability that one try of a node's report arrives in this period.

    Args:
        usual: that of the radio.
    """
    if state.condition.shape[1] == 0 or state.condition[b, node].to_bad <= 0.0:
        return usual
    own, period = state.condition[b, node], state.row[b].period
    while own.until <= period:
        if own.turns > 0:
            own.bad = 1 - own.bad
        leaves = own.to_good if own.bad else own.to_bad
        stays = 1.0
        if leaves < 1.0:  # a geometric number of periods
            uniform = draws.uniform(draws.stream(state.key[b], own.turns, draws.CHANNEL), node)
            stays = 1.0 + min(np.floor(log(1.0 - uniform) / min(log(1.0 - leaves), -1e-15)), LONGEST)
        own.until += np.int64(stays)
        own.turns += 1
    return own.bad_success if own.bad else usual
