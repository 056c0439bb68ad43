"""What an environment with a render mode owns: the trail of its rows, and in "human" mode a window."""

from __future__ import annotations

from importlib.util import find_spec
from math import ceil
from typing import Any, Literal

import gymnasium as gym
import numpy as np
import numpy.typing as npt

from wsn_env.envs.rendering.frame import frame
from wsn_env.envs.rendering.plan import SIZE, SMALLEST
from wsn_env.envs.rendering.trail import Trail
from wsn_env.models.quantity import whole_number
from wsn_env.models.state import Outcome, State
from wsn_env.scenario import Scenario

RenderMode = Literal["human", "rgb_array"]
RENDER_MODES = ("human", "rgb_array")
FPS = 10
WIDEST = 1200  # px of a window that shows several rows


class Camera:
    """Takes frames of the rows of a state.

    Args:
        scenario: what the rows play.
        render_mode: "rgb_array", or "human" for a window.
        frame_px: side of a row's frame.
        fps: frames a second in the window.

    Raises:
        ValueError: an unknown mode, or a frame that is too small.
    """

    def __init__(
        self, scenario: Scenario, render_mode: RenderMode = "rgb_array", frame_px: int = SIZE, fps: int = FPS
    ) -> None:
        if render_mode not in RENDER_MODES:
            raise ValueError(f"render_mode = {render_mode!r}: allowed are None, {', '.join(RENDER_MODES)}")
        self.scenario: Scenario = scenario
        self.frame_px: int = whole_number("frame_px", frame_px, SMALLEST)
        self._trail: Trail = None  # type: ignore[assignment]  # until episodes have begun
        self._window = Window(f"wsn_env {scenario.name}", fps) if render_mode == "human" else None

    def begin(self, state: State, outcome: Outcome, rows: npt.ArrayLike) -> None:
        """Episodes have begun in the rows marked (B,)."""
        if self._trail is None:
            self._trail = Trail.of(state, self.scenario.unscored)
        self._trail.begin(state, outcome, np.asarray(rows))

    def add(self, state: State, outcome: Outcome) -> None:
        """A period has passed."""
        self._trail.add(state, outcome)

    def frames(self, state: State, size: int | None = None) -> tuple[np.ndarray, ...]:
        """(size, size, 3) uint8 of each field; size: frame_px unless given."""
        trail, size, fields = self._trail, size or self.frame_px, range(0, state.rows, self.scenario.targets)
        return tuple(frame(state, self.scenario, trail, row, size) for row in fields)

    def show(self, state: State) -> None:
        """Show all rows in the window, if it is to have one."""
        if self._window is not None:
            columns = ceil((state.rows // self.scenario.targets) ** 0.5)
            size = self.frame_px if columns == 1 else max(min(self.frame_px, WIDEST // columns), SMALLEST)
            self._window.show(tile_frames(self.frames(state, size)))

    def close(self) -> None:
        """Close the window."""
        if self._window is not None:
            self._window.close()


def tile_frames(frames: tuple[np.ndarray, ...], gap: int = 2) -> np.ndarray:
    """Frames (H, W, 3) row by row in one picture, about as many across as down."""
    columns = ceil(len(frames) ** 0.5)
    high, wide = frames[0].shape[:2]
    lines = ceil(len(frames) / columns)
    picture = np.full((lines * (high + gap) - gap, columns * (wide + gap) - gap, 3), 200, np.uint8)
    for k, one in enumerate(frames):
        top, left = k // columns * (high + gap), k % columns * (wide + gap)
        picture[top : top + high, left : left + wide] = one
    return picture


class Window:
    """A window of pygame's, for good: closed by hand, it stays closed. pygame has one for all: who shows last has it.
    Without a screen set SDL_VIDEODRIVER=dummy.
    """

    def __init__(self, title: str, fps: int) -> None:
        if find_spec("pygame") is None:
            raise gym.error.DependencyNotInstalled(
                "render_mode = 'human' needs pygame: pip install pygame-ce (or 'wsn_env[render]')"
            )
        self.title: str = title
        self.fps: int = fps
        self._screen: Any = None
        self._clock: Any = None
        self._closed = False

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.title, self.fps)  # a copy opens a window of its own

    def show(self, picture: np.ndarray) -> None:
        """Show a picture (H, W, 3), not sooner than a frame's time after the last."""
        if self._closed:
            return
        import pygame

        size: Any = picture.shape[1::-1]
        if not self._is_shown() or self._screen.get_size() != size:
            pygame.display.init()
            pygame.display.set_caption(self.title)
            self._screen, self._clock = pygame.display.set_mode(size), pygame.time.Clock()
        pixels: Any = np.ascontiguousarray(picture)
        self._screen.blit(pygame.image.frombuffer(pixels, size, "RGB"), (0, 0))
        pygame.display.flip()
        self._clock.tick(self.fps)
        if any(event.type == pygame.QUIT for event in pygame.event.get()):
            self.close()

    def _is_shown(self) -> bool:
        """Whether the only window that pygame has is this one."""
        if self._screen is None:
            return False
        import pygame

        return pygame.display.get_surface() is self._screen

    def close(self) -> None:
        """Close it; it stays closed."""
        if self._is_shown():
            import pygame

            pygame.display.quit()
        self._screen = self._clock = None
        self._closed = True
