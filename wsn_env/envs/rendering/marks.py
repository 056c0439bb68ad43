"""Marks that stand both on the field and in the legend."""

from __future__ import annotations

from typing import Any

import numpy as np

from wsn_env.envs.rendering.canvas import ellipse
from wsn_env.envs.rendering.palette import CROSS, GREEN, INK, PURPLE


def draw_crosses(canvas: Any, centres: Any, reach: float, width: float) -> None:
    """Crosses at (N, 2)."""
    for way in (np.array((reach, reach)), np.array((reach, -reach))):
        canvas.lines(centres - way, centres + way, width, CROSS)


def draw_arrow(canvas: Any, start: Any, end: Any, width: float, barb: float) -> None:
    """From (2,) to (2,), its head beyond the middle, where no node covers it."""
    along = (end - start) / max(np.hypot(*(end - start)), 1e-9)
    across = np.array((-along[1], along[0]))
    tip = start + 0.62 * (end - start)
    starts = np.stack([start, tip, tip])
    ends = np.stack([end, tip - barb * (along + 0.55 * across), tip - barb * (along - 0.55 * across)])
    canvas.lines(starts, ends, width, PURPLE)


def draw_target(canvas: Any, centre: Any, unit: float) -> None:
    """A ring."""
    radius = max(6.0 * unit, 3.2)
    canvas.discs(centre, radius, GREEN, hole=radius - max(2.6 * unit, 1.4))


def draw_estimate(canvas: Any, centre: Any, unit: float, axes: Any) -> None:
    """A plus in an ellipse, to which `axes` (2, 2) take the unit circle."""
    outline = ellipse(centre, axes)
    arm = max(5.0 * unit, 2.6)
    ends = np.array(((arm, 0.0), (0.0, arm)))
    width = np.repeat((max(1.0, 1.5 * unit), max(1.2, 1.8 * unit)), (len(outline) - 1, 2))
    starts, ends = np.concatenate([outline[:-1], centre - ends]), np.concatenate([outline[1:], centre + ends])
    canvas.lines(starts, ends, width, INK)
