"""Straight legs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from wsn_env.models.motion.recorded import RecordedMotion
from wsn_env.models.quantity import ScenarioError, described

if TYPE_CHECKING:
    from wsn_env.scenario import Scenario


@dataclass(frozen=True)
class Legs(RecordedMotion):
    """Straight legs, each at a velocity of its own, without noise; after the last the target stands still.

    The track is exact at every instant, wherever the periods fall: a turn within a period cuts no corner. At the
    instant of a turn the velocity is still that of the leg that ends. `fitting_q` suits walkers; a target that turns
    at 10 m/s needs a `filter_q` of 1 m/s^2 or more.
    """

    fitting_q: ClassVar[float] = 0.2
    start_m: tuple[float, float] = described((5.0, 5.0), "where it begins, (x, y) [m]")
    legs: tuple[tuple[float, float, float], ...] = described(
        ((100.0, 0.9, 0.9),), "each leg's duration [s] and velocity along x and y [m/s]"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        start = self._finite("start_m", (2,), "a finite pair (x, y) in m")
        legs = self._finite("legs", (-1, 3), "finite triples (seconds, vx, vy) in s and m/s, at least one")
        if legs[:, 0].min() <= 0:
            raise ScenarioError(f"Legs.legs = {self.legs!r}: must last longer than 0 s each")
        object.__setattr__(self, "start_m", tuple(start.tolist()))
        object.__setattr__(self, "legs", tuple(map(tuple, legs.tolist())))

    def _finite(self, name: str, shape: tuple[int, ...], allowed: str) -> np.ndarray:
        value = getattr(self, name)
        try:
            array = np.asarray(value, dtype=float)
        except (TypeError, ValueError):
            array = np.empty(())
        fits = len(shape) == array.ndim and array.size and array.shape[-1] == shape[-1]
        if not fits or not np.isfinite(array).all():
            raise ScenarioError(f"Legs.{name} = {value!r}: must be {allowed}")
        return array

    def _track(self, scenario) -> np.ndarray:
        """The track (periods + 1, 4) of straight legs; it may touch the border, rounding errors there are cut off.

        Raises:
            ScenarioError: the track leaves the field within the horizon.
        """
        side = scenario.field.side_m
        legs = np.array(self.legs + ((np.inf, 0.0, 0.0),))  # at last it stands still
        ends = np.cumsum(legs[:, 0])
        begins = np.concatenate(([0.0], ends[:-1]))
        corners = self.start_m + np.concatenate(([[0.0, 0.0]], np.cumsum(legs[:-1, :1] * legs[:-1, 1:], axis=0)))
        time = scenario.period_s * np.arange(scenario.periods + 1)
        leg = np.searchsorted(ends, time - 1e-9 * scenario.period_s)
        points = corners[leg] + (time - begins[leg])[:, None] * legs[leg, 1:]
        outside = np.flatnonzero(~((points >= -1e-9 * side) & (points <= (1 + 1e-9) * side)).all(axis=1))
        if outside.size:
            k = outside[0]
            there = tuple(points[k].tolist())
            raise ScenarioError(
                f"Legs.legs = {self.legs!r}: lead from {self.start_m} to {there} m at {time[k]:g} s: must stay in"
                f" the field 0..{side} m for the horizon"
            )
        track = np.empty((len(time), 4))
        track[:, ::2] = np.clip(points, 0.0, side)
        track[:, 1::2] = legs[leg, 1:]
        return track

    def recorded_tracks(self, scenario: Scenario) -> np.ndarray:
        """The one."""
        return self._track(scenario)[None]
