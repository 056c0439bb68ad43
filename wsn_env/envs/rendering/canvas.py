"""A picture in the making: shapes and words on an image. Nothing here knows of sensors."""

from __future__ import annotations

from functools import lru_cache
from math import ceil
from typing import Any

import numpy as np

from wsn_env.envs.rendering import strokes

Colour = tuple[int, int, int]
TURN = np.linspace(0.0, 2.0 * np.pi, 65)
CIRCLE = np.column_stack([np.cos(TURN), np.sin(TURN)])


class Canvas:
    """Draws into an image, within its clip. Coordinates are pixels, x to the right and y downward."""

    def __init__(self, image: np.ndarray) -> None:
        """Take an image.

        Args:
            image: (H, W, 3) uint8, drawn into.
        """
        self.image = image
        self.height: int = image.shape[0]
        self.width: int = image.shape[1]
        self.clip: tuple[int, int, int, int] = (0, 0, self.width, self.height)  # left, top, right, bottom
        self._most = np.zeros(image.shape[:2], np.float32)
        self._steps = np.zeros(self.width + 1, np.float32)

    def discs(self, centres: Any, radius: float, colour: Any, hole: float = -10.0, square: bool = False) -> None:
        """Discs, rings or squares of one size.

        Args:
            centres: (N, 2).
            radius: of all; half the side of a square.
            colour: (3,), or (N, 3) of each.
            hole: radius of what is left out.
            square: not round.
        """
        colours = _as_floats(colour).reshape(-1, 3)
        strokes.draw_discs(self.image, self.clip, _as_points(centres), float(radius), float(hole), square, colours)

    def lines(self, starts: Any, ends: Any, width: Any, colour: Colour, opacity: Any = 1.0) -> None:
        """Lines with round ends; where they meet they do not darken each other.

        Args:
            starts, ends: (N, 2).
            width: a number, or (N,) of each.
            colour: (3,).
            opacity: a number, or (N,) of each.
        """
        starts, ends = _as_points(starts), _as_points(ends)
        widths, opacities = (np.full(len(starts), value, np.float64) for value in (width, opacity))
        lines = starts, ends, widths, opacities
        strokes.draw_lines(self.image, self._most, self.clip, lines, _as_floats(colour))

    def cloud(self, x: np.ndarray, y: np.ndarray, weights: Any, colour: Colour) -> None:
        """Points (P,); where they are many, or their weights large, the colour is deeper."""
        strokes.draw_cloud(self.image, self._most, self.clip, *map(_as_floats, (x, y, weights, colour)))

    def shade(self, centres: Any, radius: float, tints: Any) -> None:
        """Areas within a radius of any of the centres (N, 2), in the n-th tint (K, 3) where n overlap."""
        strokes.draw_shade(self.image, self._steps, self.clip, _as_points(centres), float(radius), _as_floats(tints))

    def box(self, left: int, top: int, right: int, bottom: int, colour: Colour) -> None:
        """A filled rectangle, right and bottom left out."""
        self.image[top:bottom, left:right] = colour

    def text(self, x: int, y: int, words: str, size: int, colour: Colour, ground: Colour = (255, 255, 255)) -> int:
        """Words on their ground from the left at x, with their line's upper edge at y; returns where they end."""
        if not words:
            return x
        line = _draw_words(words, size, colour, ground)
        area = self.image[y : y + line.shape[0], x : x + line.shape[1]]
        area[:] = line[: area.shape[0], : area.shape[1]]
        return x + line.shape[1]


def text_width(words: str, size: int) -> int:
    """What `Canvas.text` takes."""
    return sum(_draw_letter(letter, size).shape[1] for letter in words)


def ellipse(centre: Any, axes: Any) -> np.ndarray:
    """(65, 2) points on an outline; the last is the first.

    Args:
        centre: (2,).
        axes: (2, 2), which takes the unit circle to it.
    """
    return np.asarray(centre) + CIRCLE @ np.asarray(axes).T


def _as_floats(values) -> np.ndarray:
    return np.ascontiguousarray(values, np.float64)


def _as_points(values) -> np.ndarray:
    return _as_floats(values).reshape(-1, 2)


@lru_cache(maxsize=256)
def _draw_words(words: str, size: int, colour: Colour, ground: Colour) -> np.ndarray:
    """(height, width, 3) uint8: letters side by side."""
    share = np.concatenate([_draw_letter(letter, size) for letter in words], axis=1)[:, :, None]
    return (ground + share * (np.array(colour) - ground) + 0.5).astype(np.uint8)


@lru_cache(maxsize=1024)
def _draw_letter(letter: str, size: int) -> np.ndarray:
    """(height, advance) float32: the share of each pixel that it covers."""
    from PIL import Image, ImageDraw

    font = _load_font(size)
    width = 0.3 * size if letter == " " else font.getlength(letter) - 0.3
    image = Image.new("L", (ceil(width), ceil(1.3 * size)))
    ImageDraw.Draw(image).text((0, 0), letter, fill=255, font=font)
    return np.asarray(image, np.float32) / 255


@lru_cache(maxsize=16)
def _load_font(size: int):
    from PIL import ImageFont

    return ImageFont.load_default(size)
