"""Pictures of the arm, drawn with pygame off screen, and a window that shows them."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bilateral_rl.envs.arm.parameters import MUSCLE_NAMES, ArmParameters

Color = tuple[int, int, int]
Points = NDArray[np.float64]

VIEW_MARGIN = 1.13
"""Half the picture's side over the arm's reach; the shoulder is at the center."""

_OVERSAMPLING = 2
_FLEXION, _EXTENSION = 1.0, -1.0
_TRUNK = -0.13 * np.array((math.cos(math.radians(15)), math.sin(math.radians(15))))  # where the shoulder girdle begins
_LOAD_SCALE, _LOAD_MAX_LENGTH = 0.01, 0.2  # m/N, m
_MAX_PATH_SEGMENTS = 400
_FURTHEST = 10  # pictures' sides away: pygame would go through every pixel of an arm of any measure
_LINE_SPACING = 0.05  # of the caption (m)

_WHITE, _INK, _FAINT, _WORKSPACE = (255, 255, 255), (60, 60, 60), (212, 216, 222), (247, 248, 250)
_BONE, _BONE_EDGE, _TENDON, _MUSCLE_EDGE = (235, 231, 222), (140, 136, 128), (150, 125, 120), (110, 70, 65)
_GOAL, _GOAL_FILL, _LOAD = (0, 95, 160), (218, 234, 246), (0, 125, 90)
_PATH_OLD, _PATH_NEW = (205, 215, 225), (45, 65, 95)
_ACTIVATION_COLORS = ((255, 245, 240), (252, 187, 161), (251, 106, 74), (203, 24, 29), (103, 0, 13))
"""ColorBrewer's Reds at activation 0, 0.25, … 1: lightness falls all the way, so it reads in grey too."""


class _Route(NamedTuple):
    """How a muscle runs: from attachment to attachment, passing the joints between them at its moment arms."""

    side: float
    attachments: tuple[tuple[int, float, float], ...]
    """Bone (0 shoulder girdle, 1 upper arm, 2 forearm), fraction of its length, distance beside its axis (m)."""
    belly: tuple[float, float]  # where it begins and ends, as fractions of the route
    half_width: float  # of the belly (m)


_ROUTES = {
    "pectoralis": _Route(_FLEXION, ((0, 0.03, 0.008), (1, 0.4, 0.006)), (0.04, 0.94), 0.017),
    "deltoid": _Route(_EXTENSION, ((0, 0.15, 0.008), (1, 0.44, 0.006)), (0.04, 0.94), 0.016),
    "brachioradialis": _Route(_FLEXION, ((1, 0.64, 0.008), (2, 0.8, 0.01)), (0.2, 0.8), 0.016),
    "triceps lateral": _Route(_EXTENSION, ((1, 0.42, 0.008), (1, 0.72, 0.022), (2, 0.08, 0.006)), (0.04, 0.8), 0.014),
    "biceps": _Route(_FLEXION, ((0, 0.8, 0.01), (1, 0.52, 0.044), (2, 0.17, 0.008)), (0.26, 0.82), 0.018),
    "triceps long": _Route(_EXTENSION, ((0, 0.75, 0.01), (1, 0.5, 0.05), (2, 0.12, 0.008)), (0.22, 0.78), 0.016),
}


class Scene(NamedTuple):
    """What one picture shows."""

    angles: NDArray[Any]  # (2,) shoulder, elbow (rad)
    activation: NDArray[Any]  # (6,) muscle activations in [0, 1]
    target: NDArray[Any]  # (2,) m
    path: NDArray[Any]  # (k, 2) hand positions so far (m), k may be 0
    threshold: float  # radius of the goal (m)
    load: NDArray[Any]  # (2,) force on the hand (N)
    caption: str = ""  # one or several lines


def draw(arm: ArmParameters, scene: Scene, size: int = 480) -> NDArray[np.uint8]:
    """The scene as a (``size``, ``size``, 3) RGB picture, y up, showing the whole reach around the shoulder."""
    angles, load = np.asarray(scene.angles, dtype=float), np.asarray(scene.load, dtype=float)
    joints = np.stack((_TRUNK, np.zeros(2), *_elbow_and_hand(arm, angles)))
    canvas = _Canvas(arm, size, _background(arm, size))
    canvas.disc(scene.target, scene.threshold, _GOAL_FILL, _GOAL)
    _draw_path(canvas, np.asarray(scene.path, dtype=float))
    _draw_bones(canvas, joints)
    colors, moment_arms = _activation_colors(np.asarray(scene.activation)), _moment_arms(arm, angles)
    for name, color, moment_arm in zip(MUSCLE_NAMES, colors, moment_arms, strict=True):
        _draw_muscle(canvas, _ROUTES[name], _course(joints, _ROUTES[name], moment_arm), color)
    for center, radius in zip(joints[1:], (0.017, 0.016, 0.013), strict=True):
        canvas.disc(center, radius, _WHITE, _INK)
    for offset in ((0.01, 0.0), (0.0, 0.01)):
        canvas.line(np.stack((np.subtract(scene.target, offset), np.add(scene.target, offset))), _GOAL, 1.5)
    if load.any():
        _draw_load(canvas, joints[-1], load)
    for i, line in enumerate(scene.caption.splitlines()):
        canvas.text((0.03 - canvas.half, canvas.half - 0.045 - i * _LINE_SPACING), line, centered=False)
    return canvas.picture()


def tile(frames: Sequence[NDArray[np.uint8]], columns: int | None = None) -> NDArray[np.uint8]:
    """Pictures of one shape (h, w, 3) in a grid, near-square or of ``columns``, row by row; empty cells are white."""
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
        title: of the window.
        fps: pictures a second at most.
    """

    def __init__(self, title: str, fps: int) -> None:
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


class _Canvas:
    """An off-screen square surface drawn on in meters around the shoulder, antialiased by oversampling.

    Line widths are in pixels of a picture of size 480.
    """

    def __init__(self, arm: ArmParameters, size: int, background: Any = None) -> None:
        self._pygame, self._size = _pygame(), size
        self.half = VIEW_MARGIN * sum(arm.link_length)
        self._scale = _OVERSAMPLING * size / (2 * self.half)
        self._furthest = _FURTHEST * _OVERSAMPLING * size
        if background is None:
            # A depth of its own, so that an open window's pixel format changes nothing.
            background = self._pygame.Surface((_OVERSAMPLING * size, _OVERSAMPLING * size), depth=32)
            background.fill(_WHITE)
        self.surface = background.copy()

    def polygon(self, points: Points, fill: Color, edge: Color | None = None) -> None:
        pixels = self._pixels(points)
        self._pygame.draw.polygon(self.surface, fill, pixels)
        if edge is not None:
            self._pygame.draw.lines(self.surface, edge, True, pixels, self._width(1))

    def line(self, points: Points, color: Color, width: float = 1) -> None:
        self._pygame.draw.lines(self.surface, color, False, self._pixels(points), self._width(width))

    def disc(self, center: ArrayLike, radius: float, fill: Color, edge: Color) -> None:
        pixel, pixels = self._pixels(center), min(radius * self._scale, self._furthest)
        self._pygame.draw.circle(self.surface, fill, pixel, pixels)
        self._pygame.draw.circle(self.surface, edge, pixel, pixels, self._width(1.2))

    def text(self, position: ArrayLike, text: str, color: Color = _INK, centered: bool = True) -> None:
        """Text around a position, or to the right of it, with a white halo; kept inside the picture."""
        # A font does not outlive pygame.quit(), which any other user of pygame may call: none is kept.
        self._pygame.font.init()
        font = self._pygame.font.Font(None, _OVERSAMPLING * max(12, round(17 * self._size / 480)))
        image, halo = font.render(text, True, color), font.render(text, True, _WHITE)
        x, y = self._pixels(position)
        box = image.get_rect(center=(x, y)) if centered else image.get_rect(midleft=(x, y))
        box.clamp_ip(self.surface.get_rect())
        for shift in ((-3, 0), (3, 0), (0, -3), (0, 3), (-2, -2), (-2, 2), (2, -2), (2, 2)):
            self.surface.blit(halo, box.move(shift))
        self.surface.blit(image, box)

    def picture(self) -> NDArray[np.uint8]:
        small = self._pygame.transform.smoothscale(self.surface, (self._size, self._size))
        flat = np.frombuffer(self._pygame.image.tobytes(small, "RGB"), dtype=np.uint8)
        return flat.reshape(self._size, self._size, 3).copy()

    def _pixels(self, points: ArrayLike) -> Any:
        pixels = self._scale * (np.multiply(points, (1, -1)) + self.half)
        return np.clip(pixels, -self._furthest, self._furthest).tolist()

    def _width(self, width: float) -> int:
        return max(1, round(width * _OVERSAMPLING * self._size / 480))


def _pygame() -> ModuleType:
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    try:
        import pygame
    except ImportError as error:
        raise ImportError("Drawing the arm needs pygame: pip install pygame") from error
    return pygame


def _direction(angle: ArrayLike) -> Points:
    return np.stack((np.cos(angle), np.sin(angle)), axis=-1)


def _elbow_and_hand(arm: ArmParameters, angles: Points) -> tuple[Points, Points]:
    """Positions (..., 2) at postures (..., 2) (m)."""
    elbow = arm.link_length[0] * _direction(angles[..., 0])
    return elbow, elbow + arm.link_length[1] * _direction(angles.sum(axis=-1))


def _moment_arms(arm: ArmParameters, angles: Points) -> Points:
    """Magnitudes (6, 2) of each muscle's moment arms at shoulder and elbow (m)."""
    linear = np.array((arm.path_linear_shoulder, arm.path_linear_elbow)).T
    quadratic = np.array((arm.path_quadratic_shoulder, arm.path_quadratic_elbow)).T
    return np.abs(linear + 2 * quadratic * (angles - arm.path_reference_angle))


def _activation_colors(activation: NDArray[Any]) -> list[Color]:
    """Pale for 0 to deep red for 1."""
    at = np.linspace(0, 1, len(_ACTIVATION_COLORS))
    channels = [np.interp(activation, at, channel).round() for channel in zip(*_ACTIVATION_COLORS, strict=True)]
    return [(int(r), int(g), int(b)) for r, g, b in zip(*channels, strict=True)]


@lru_cache(maxsize=4)
def _background(arm: ArmParameters, size: int) -> Any:
    """The surface with what every picture shows: the workspace, the scale bar and the color bar."""
    canvas = _Canvas(arm, size)
    _draw_workspace(canvas, arm)
    left, right, bottom = 0.03 - canvas.half, canvas.half - 0.03, 0.03 - canvas.half
    canvas.line(np.array([(left, bottom), (left + 0.1, bottom)]), _INK, 2)
    canvas.text((left + 0.05, bottom + 0.03), "10 cm")
    edges = np.linspace(right - 0.27, right, 65)
    for (start, end), color in zip(pairwise(edges), _activation_colors(np.linspace(0, 1, 64)), strict=True):
        canvas.polygon(_box(start, end, bottom, bottom + 0.022), color)
    canvas.line(_box(right - 0.27, right, bottom, bottom + 0.022), _INK)
    canvas.text((right - 0.135, bottom + 0.05), "activation 0 … 1")
    return canvas.surface


def _box(left: float, right: float, bottom: float, top: float) -> Points:
    return np.array([(left, bottom), (right, bottom), (right, top), (left, top), (left, bottom)])


def _draw_workspace(canvas: _Canvas, arm: ArmParameters) -> None:
    """The hand positions within the joint limits, and the circle of the stretched arm."""
    canvas.disc((0, 0), sum(arm.link_length), _WHITE, _FAINT)
    (q1_min, q2_min), (q1_max, q2_max) = arm.joint_lower_limit, arm.joint_upper_limit
    corners = _box(q1_min, q1_max, q2_min, q2_max)
    along = np.linspace(0, 1, 40)[:, None]
    postures = np.concatenate([a + along * (b - a) for a, b in pairwise(corners)])
    canvas.polygon(_elbow_and_hand(arm, postures)[1], _WORKSPACE, _FAINT)


def _draw_path(canvas: _Canvas, path: Points) -> None:
    """Fading from the newest position back to the oldest."""
    path = path[:: -(len(path) // _MAX_PATH_SEGMENTS + 1)][::-1]
    colors = np.linspace(_PATH_OLD, _PATH_NEW, max(len(path) - 1, 0)).astype(int).tolist()
    for (start, end), color in zip(pairwise(path), colors, strict=True):
        canvas.line(np.stack((start, end)), color, 2)


def _draw_bones(canvas: _Canvas, joints: Points) -> None:
    along = np.linspace(0, 1, 24)[:, None]
    half_width = 0.007 + 0.005 * np.abs(2 * along - 1) ** 4
    for start, end in pairwise(joints):
        canvas.polygon(_ribbon(start + along * (end - start), half_width), _BONE, _BONE_EDGE)


def _draw_muscle(canvas: _Canvas, route: _Route, course: Points, color: Color) -> None:
    canvas.line(course, _TENDON, 1.5)
    first, last = (round(fraction * (len(course) - 1)) for fraction in route.belly)
    along = np.linspace(0, 1, last + 1 - first)[:, None]
    canvas.polygon(_ribbon(course[first : last + 1], route.half_width * np.sin(np.pi * along)), color, _MUSCLE_EDGE)


def _draw_load(canvas: _Canvas, hand: Points, load: Points) -> None:
    """An arrow from the hand, longer for a stronger force, with its magnitude."""
    force = float(np.linalg.norm(load))
    along = load / force
    across = along[::-1] * (-1, 1)
    barb = hand + (0.013 + min(_LOAD_SCALE * force, _LOAD_MAX_LENGTH)) * along
    tip = barb + 0.024 * along
    canvas.line(np.stack((hand + 0.013 * along, barb)), _LOAD, 2.5)
    canvas.polygon(np.stack((tip, barb + 0.012 * across, barb - 0.012 * across)), _LOAD)
    canvas.text(tip + (0.055, 0.03) * along, f"{force:.1f} N", _LOAD)


def _course(joints: Points, route: _Route, moment_arm: Points) -> Points:
    """The muscle's smooth course (64, 2) from origin to insertion, evenly spaced (m)."""
    bones = np.diff(joints, axis=0)
    angle = np.arctan2(bones[:, 1], bones[:, 0])
    points: list[Points] = []
    reached = route.attachments[0][0]
    for bone, fraction, distance in route.attachments:
        for joint in range(reached + 1, bone + 1):
            around = _around_joint(angle[joint - 1], angle[joint], route.side, moment_arm[joint - 1])
            points.extend(joints[joint] + around)
        outward = route.side * _direction(angle[bone] + np.pi / 2)
        points.append(joints[bone] + fraction * bones[bone] + distance * outward)
        reached = bone
    return _resample(_smooth(np.stack(points)), 64)


def _around_joint(proximal: float, distal: float, side: float, radius: float) -> Points:
    """Points (n, 2) by which a muscle passes a joint at 0, ``radius`` off both bones (angles in rad).

    An extensor is wrapped around a flexed joint; a flexor spans its inside.
    """
    flexion = (distal - proximal + np.pi) % (2 * np.pi) - np.pi
    if side == _EXTENSION and flexion > 0:
        return -radius * _direction(np.linspace(proximal, proximal + flexion, 5) + np.pi / 2)
    # Bounded, as the point that far off both bones recedes without end when they fold onto each other.
    distance = radius / max(math.cos(flexion / 2), 0.5)
    return side * distance * _direction(np.array([proximal + flexion / 2 + np.pi / 2]))


def _smooth(points: Points) -> Points:
    """The quadratic B-spline of control points (n, 2), by Chaikin's corner cutting; both ends stay."""
    for _ in range(3):
        start, end = points[:-1], points[1:]
        cut = np.stack((0.75 * start + 0.25 * end, 0.25 * start + 0.75 * end), axis=1).reshape(-1, 2)
        points = np.concatenate((points[:1], cut, points[-1:]))
    return points


def _resample(points: Points, n: int) -> Points:
    """Evenly spaced points (n, 2) along a line."""
    length = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))))
    return np.stack([np.interp(np.linspace(0, length[-1], n), length, axis) for axis in points.T], axis=1)


def _ribbon(course: Points, half_width: Points) -> Points:
    """Outline (2 n, 2) of a band around a line (n, 2), of half width (n, 1)."""
    tangent = np.gradient(course, axis=0)
    outward = tangent[:, ::-1] * (-1, 1) / np.linalg.norm(tangent, axis=1, keepdims=True)
    return np.concatenate((course + half_width * outward, (course - half_width * outward)[::-1]))
