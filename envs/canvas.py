"""Drawing by pygame: an off-screen canvas in meters, pictures side by side, and a window that shows them."""

from __future__ import annotations

import copy
import math
import os
from collections.abc import Sequence
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Color = tuple[int, int, int]
Points = NDArray[np.float64]
"""(n, 2): positions in the plane of the arms (m)."""

WHITE, INK = (255, 255, 255), (60, 60, 60)

_OVERSAMPLING = 2
_FURTHEST = 10  # pictures' sides away: pygame would go through every pixel of an arm of any measure


class View(NamedTuple):
    """What part of the plane a picture shows."""

    center: tuple[float, float]
    """Its middle (m)."""
    half: tuple[float, float]
    """Half its width and half its height (m)."""

    def size(self, height: int) -> tuple[int, int]:
        """Return width and height (pixels) of a picture that is ``height`` high: an even width where that is even."""
        unit = 2 - height % 2
        return unit * round(height * self.half[0] / (unit * self.half[1])), height


class Canvas:
    """An off-screen surface drawn on in meters, antialiased by oversampling.

    Line widths are in pixels of a picture that is 480 high.

    Args:
        view: what is shown.
        height: height of the picture (pixels).
        background: surface of another canvas of the same view to begin with; white by default.
    """

    def __init__(self, view: View, height: int, background: Any = None) -> None:
        self._pygame, self._size, self._view = _pygame(), view.size(height), view
        self._scale = _OVERSAMPLING * height / (2 * view.half[1])
        self._furthest = _FURTHEST * _OVERSAMPLING * height
        self._origin, self._outward = (0.0, 0.0), 1.0
        if background is None:
            # A depth of its own, so that an open window's pixel format changes nothing.
            background = self._pygame.Surface([_OVERSAMPLING * side for side in self._size], depth=32)
            background.fill(WHITE)
        self.surface = background.copy()

    @property
    def left(self) -> float:
        """Where the picture begins (m), in the frame of the whole."""
        return self._view.center[0] - self._view.half[0]

    @property
    def right(self) -> float:
        """Where it ends at the right (m), in the frame of the whole."""
        return self._view.center[0] + self._view.half[0]

    @property
    def bottom(self) -> float:
        """Where it ends below (m)."""
        return self._view.center[1] - self._view.half[1]

    @property
    def top(self) -> float:
        """Where it ends above (m)."""
        return self._view.center[1] + self._view.half[1]

    def frame(self, x: float, outward: float) -> Canvas:
        """Return the same picture, to be drawn on in a frame with its origin at (``x``, 0).

        Args:
            x: the origin (m).
            outward: 1, or -1 where x grows to the left: what is drawn is mirrored, but for writing.
        """
        framed = copy.copy(self)
        framed._origin, framed._outward = (x, 0.0), outward
        return framed

    def inside(self, points: ArrayLike) -> Points:
        """Return points (n, 2) of the frame of the whole in this canvas's own frame."""
        return np.asarray(np.subtract(points, self._origin) * (self._outward, 1.0))

    def outside(self, points: ArrayLike) -> Points:
        """Return points (n, 2) of this canvas's own frame in the frame of the whole."""
        return np.asarray(np.multiply(points, (self._outward, 1.0)) + self._origin)

    def room(self, base: Points, along: Points, margin: float) -> float:
        """Return how far from ``base`` (2,) a ray along (2,) comes as close as ``margin`` to the picture's edge (m)."""
        center = self.inside(self._view.center)
        with np.errstate(divide="ignore", invalid="ignore"):
            distances = (np.sign(along) * np.subtract(self._view.half, margin) - (base - center)) / along
        return float(np.nanmin(np.where(along != 0, distances, np.inf)))

    def polygon(self, points: Points, fill: Color, edge: Color | None = None) -> None:
        """Fill a polygon with corners (n, 2), and draw its outline if it has a color."""
        pixels = self._pixels(points)
        self._pygame.draw.polygon(self.surface, fill, pixels)
        if edge is not None:
            self._pygame.draw.lines(self.surface, edge, True, pixels, self._width(1))

    def line(self, points: Points, color: Color, width: float = 1) -> None:
        """Draw a line through points (n, 2)."""
        self._pygame.draw.lines(self.surface, color, False, self._pixels(points), self._width(width))

    def disc(self, center: ArrayLike, radius: float, fill: Color | None, edge: Color) -> None:
        """Draw a disc of ``radius`` (m) with an outline; without a fill, that alone."""
        pixel, pixels = self._pixels(center), min(radius * self._scale, self._furthest)
        if fill is not None:
            self._pygame.draw.circle(self.surface, fill, pixel, pixels)
        self._pygame.draw.circle(self.surface, edge, pixel, pixels, self._width(1.2))

    def text(self, position: ArrayLike, text: str, color: Color = INK, centered: bool = True) -> None:
        """Write around a position, or to the right of it, with a white halo; kept inside the picture."""
        # A font does not outlive pygame.quit(), which any other user of pygame may call: none is kept.
        self._pygame.font.init()
        font = self._pygame.font.Font(None, _OVERSAMPLING * max(12, round(17 * self._size[1] / 480)))
        image, halo = font.render(text, True, color), font.render(text, True, WHITE)
        x, y = self._pixels(position)
        box = image.get_rect(center=(x, y)) if centered else image.get_rect(midleft=(x, y))
        box.clamp_ip(self.surface.get_rect())
        for shift in ((-3, 0), (3, 0), (0, -3), (0, 3), (-2, -2), (-2, 2), (2, -2), (2, 2)):
            self.surface.blit(halo, box.move(shift))
        self.surface.blit(image, box)

    def picture(self) -> NDArray[np.uint8]:
        """Return the picture (h, w, 3), RGB."""
        small = self._pygame.transform.smoothscale(self.surface, self._size)
        flat = np.frombuffer(self._pygame.image.tobytes(small, "RGB"), dtype=np.uint8)
        return flat.reshape(*self._size[::-1], 3).copy()

    def _pixels(self, points: ArrayLike) -> Any:
        pixels = self._scale * ((self.outside(points) - self._view.center) * (1, -1) + self._view.half)
        return np.clip(pixels, -self._furthest, self._furthest).tolist()

    def _width(self, width: float) -> int:
        return max(1, round(width * _OVERSAMPLING * self._size[1] / 480))


def tile(frames: Sequence[NDArray[np.uint8]], columns: int | None = None) -> NDArray[np.uint8]:
    """Return pictures (h, w, 3) as a grid, near-square or of ``columns``, row by row; empty cells are white.

    Raises:
        ValueError: no picture.
    """
    if not len(frames):
        raise ValueError("tile needs at least one picture.")
    columns = columns or math.ceil(math.sqrt(len(frames)))
    rows = math.ceil(len(frames) / columns)
    height, width, channels = frames[0].shape
    grid = np.full((rows * columns, height, width, channels), 255, dtype=np.uint8)
    grid[: len(frames)] = frames
    grid = grid.reshape(rows, columns, height, width, channels).swapaxes(1, 2)
    return grid.reshape(rows * height, columns * width, channels)


class Window:
    """A window that shows pictures; the first :meth:`show` opens it. Closed by hand, it stays closed.

    Args:
        title: the window's title.
        fps: largest number of pictures shown in a second.
    """

    def __init__(self, title: str, fps: float) -> None:
        self._title, self._fps = title, fps
        self._clock: Any = None
        self._closed_by_hand = False

    def show(self, frame: NDArray[np.uint8]) -> None:
        """Show a picture (h, w, 3), shrunk where the screen is smaller, and wait until the next one is due."""
        if self._closed_by_hand:
            return
        pygame = _pygame()
        height, width = frame.shape[:2]
        screen = self._open(width, height)
        picture = pygame.image.frombuffer(np.ascontiguousarray(frame), (width, height), "RGB")
        screen.blit(pygame.transform.smoothscale(picture, screen.get_size()), (0, 0))
        pygame.display.flip()
        self._clock.tick(self._fps)
        if any(event.type == pygame.QUIT for event in pygame.event.get()):
            self._closed_by_hand = True
            self.close()

    def close(self) -> None:
        """Close the window, if it is open."""
        if self._clock is not None:
            # Not pygame.quit(): the program may use pygame's other parts.
            _pygame().display.quit()
            self._clock = None

    def _open(self, width: int, height: int) -> Any:
        """The program's one pygame window, opened anew where another user of pygame closed or resized it."""
        pygame = _pygame()
        self._clock = self._clock or pygame.time.Clock()
        pygame.display.init()
        desktop = pygame.display.get_desktop_sizes()[0]
        shrink = min(1.0, 0.9 * desktop[0] / width, 0.9 * desktop[1] / height)
        size = (round(width * shrink), round(height * shrink))
        screen = pygame.display.get_surface()
        if screen is None or screen.get_size() != size:
            screen = pygame.display.set_mode(size)
            pygame.display.set_caption(self._title)
        return screen


def _pygame() -> ModuleType:
    """Import pygame where it is first used: the environments work without it until something is drawn."""
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    try:
        import pygame
    except ImportError as error:
        raise ImportError("Drawing the arm needs pygame: pip install pygame") from error
    return pygame
