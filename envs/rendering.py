"""Pictures of the arm, drawn with pygame off screen, and a window that shows them."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
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
_TRUNK_LENGTH, _TRUNK_ANGLE = 0.13, math.radians(15.0)
_LOAD_SCALE, _LOAD_MAX_LENGTH = 0.01, 0.2  # m/N, m
_MAX_PATH_SEGMENTS = 400

_WHITE: Color = (255, 255, 255)
_INK: Color = (60, 60, 60)
_WORKSPACE: Color = (247, 248, 250)
_FAINT: Color = (212, 216, 222)
_BONE: Color = (235, 231, 222)
_BONE_EDGE: Color = (140, 136, 128)
_TENDON: Color = (165, 150, 145)
_MUSCLE_EDGE: Color = (110, 70, 65)
_GOAL, _GOAL_FILL = (0, 95, 160), (218, 234, 246)
_PATH_OLD, _PATH_NEW = (205, 215, 225), (45, 65, 95)
_LOAD: Color = (0, 125, 90)
_ACTIVATION_COLORS = np.array(
    [(255, 245, 240), (252, 187, 161), (251, 106, 74), (203, 24, 29), (103, 0, 13)], dtype=float
)
"""ColorBrewer's Reds at activation 0, 0.25, … 1: lightness falls all the way, so it reads in grey too."""


class Scene(NamedTuple):
    """What one picture shows."""

    angles: NDArray[Any]
    """(2,) shoulder, elbow (rad)."""
    activation: NDArray[Any]
    """(6,) muscle activations in [0, 1]."""
    target: NDArray[Any]
    """(2,) m."""
    path: NDArray[Any]
    """(k, 2) hand positions so far (m); k may be 0."""
    threshold: float
    """Radius of the goal (m)."""
    load: NDArray[Any]
    """(2,) force on the hand (N)."""
    caption: str = ""


class _Attachment(NamedTuple):
    """A point beside a bone: 0 trunk, 1 upper arm, 2 forearm."""

    bone: int
    fraction: float
    """Of the bone's length, from its proximal end."""
    offset: float
    """From the bone's axis, to the muscle's own side (m)."""


class _Route(NamedTuple):
    """How a muscle runs: between attachments on different bones it passes the joints at its moment arms."""

    side: float
    attachments: tuple[_Attachment, ...]
    belly: tuple[float, float]
    """Where along the route the belly begins and ends, as fractions of its length."""
    half_width: float
    """m."""


_ROUTES = dict(
    zip(
        MUSCLE_NAMES,
        (
            _Route(_FLEXION, (_Attachment(0, 0.05, 0.008), _Attachment(1, 0.36, 0.008)), (0.08, 0.92), 0.016),
            _Route(_EXTENSION, (_Attachment(0, 0.2, 0.008), _Attachment(1, 0.42, 0.008)), (0.06, 0.94), 0.015),
            _Route(_FLEXION, (_Attachment(1, 0.62, 0.008), _Attachment(2, 0.8, 0.010)), (0.1, 0.75), 0.013),
            _Route(
                _EXTENSION,
                (_Attachment(1, 0.38, 0.008), _Attachment(1, 0.7, 0.02), _Attachment(2, 0.07, 0.008)),
                (0.06, 0.78), 0.012,
            ),
            _Route(
                _FLEXION,
                (_Attachment(0, 0.8, 0.01), _Attachment(1, 0.5, 0.034), _Attachment(2, 0.17, 0.008)),
                (0.28, 0.8), 0.015,
            ),
            _Route(
                _EXTENSION,
                (_Attachment(0, 0.75, 0.01), _Attachment(1, 0.5, 0.042), _Attachment(2, 0.11, 0.008)),
                (0.22, 0.76), 0.014,
            ),
        ),
        strict=True,
    )
)  # fmt: skip


def draw(arm: ArmParameters, scene: Scene, size: int = 480) -> NDArray[np.uint8]:
    """The scene as a (``size``, ``size``, 3) RGB picture, y up, showing the whole reach around the shoulder."""
    canvas = _Canvas(sum(arm.link_length), size)
    joints = _joints(arm, np.asarray(scene.angles, dtype=float))
    hand = joints[-1]
    _draw_workspace(canvas, arm)
    canvas.disc(scene.target, scene.threshold, _GOAL_FILL, _GOAL)
    _draw_path(canvas, np.asarray(scene.path, dtype=float))
    _draw_bones(canvas, joints)
    for route, moment_arm, activation in zip(
        _ROUTES.values(), _moment_arms(arm, scene.angles), scene.activation, strict=True
    ):
        _draw_muscle(canvas, joints, route, moment_arm, activation_color(float(activation)))
    _draw_joints(canvas, joints)
    _draw_mark(canvas, scene.target)
    _draw_load(canvas, hand, np.asarray(scene.load, dtype=float))
    _draw_keys(canvas)
    canvas.text((-canvas.half + 0.03, canvas.half - 0.045), scene.caption)
    return canvas.picture()


def tile(frames: Sequence[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """Pictures of one shape (h, w, 3) in a near-square grid, row by row; empty cells are white."""
    if not frames:
        raise ValueError("tile needs at least one picture.")
    columns = math.ceil(math.sqrt(len(frames)))
    rows = math.ceil(len(frames) / columns)
    height, width, channels = frames[0].shape
    grid = np.full((rows * columns, height, width, channels), 255, dtype=np.uint8)
    grid[: len(frames)] = frames
    grid = grid.reshape(rows, columns, height, width, channels).swapaxes(1, 2)
    return grid.reshape(rows * height, columns * width, channels)


def activation_color(activation: float) -> Color:
    """Pale for 0, deep red for 1."""
    position = np.linspace(0, 1, len(_ACTIVATION_COLORS))
    red, green, blue = (round(float(np.interp(activation, position, c))) for c in _ACTIVATION_COLORS.T)
    return red, green, blue


class Window:
    """A window that shows pictures; the first :meth:`show` opens it. Once closed by hand it stays closed.

    Args:
        title: of the window.
        fps: pictures a second at most.
    """

    def __init__(self, title: str, fps: int) -> None:
        self._title, self._fps = title, fps
        self._clock: Any = None
        self._dismissed = False

    def show(self, frame: NDArray[np.uint8]) -> None:
        """Show a picture (h, w, 3), shrunk to fit the screen, and wait until the next one is due."""
        if self._dismissed:
            return
        pygame = _pygame()
        height, width = frame.shape[:2]
        picture = pygame.image.frombuffer(np.ascontiguousarray(frame), (width, height), "RGB")
        screen = self._open(width, height)
        if screen.get_size() != (width, height):
            picture = pygame.transform.smoothscale(picture, screen.get_size())
        screen.blit(picture, (0, 0))
        pygame.display.flip()
        if pygame.event.get(pygame.QUIT):
            self._dismissed = True
            self.close()
            return
        pygame.event.pump()
        self._clock.tick(self._fps)

    def close(self) -> None:
        """Close the window, if it is open."""
        if self._clock is not None:
            # Not pygame.quit(): the program may use pygame's other parts.
            _pygame().display.quit()
            self._clock = None

    def _open(self, width: int, height: int) -> Any:
        """pygame's one window, opened anew where another Window closed or resized it."""
        pygame = _pygame()
        if self._clock is None:
            self._clock = pygame.time.Clock()
        if not pygame.display.get_init():
            pygame.display.init()
        desktop = pygame.display.get_desktop_sizes()[0]
        shrink = min(1.0, 0.9 * desktop[0] / width, 0.9 * desktop[1] / height)
        size = (int(width * shrink), int(height * shrink))
        screen = pygame.display.get_surface()
        if screen is None or screen.get_size() != size:
            screen = pygame.display.set_mode(size)
            pygame.display.set_caption(self._title)
        return screen


class _Canvas:
    """An off-screen square surface drawn on in meters around the shoulder, antialiased by oversampling."""

    def __init__(self, reach: float, size: int) -> None:
        self._pygame, self._size = _pygame(), size
        self.half = VIEW_MARGIN * reach
        self._scale = _OVERSAMPLING * size / (2 * self.half)
        self.pixel = 1 / self._scale * _OVERSAMPLING
        side = _OVERSAMPLING * size
        # Masks of its own, so that an open window's pixel format changes nothing.
        self._surface = self._pygame.Surface((side, side), depth=24)
        self._surface.fill(_WHITE)

    def polygon(self, points: Points, fill: Color, edge: Color | None = None) -> None:
        pixels = self._pixels(points)
        self._pygame.draw.polygon(self._surface, fill, pixels)
        if edge is not None:
            self._pygame.draw.lines(self._surface, edge, True, pixels, self._width(1))

    def line(self, points: Points, color: Color, width: float = 1) -> None:
        """Width in the picture's pixels at size 480."""
        self._pygame.draw.lines(self._surface, color, False, self._pixels(points), self._width(width))

    def disc(self, center: ArrayLike, radius: float, fill: Color | None = None, edge: Color | None = None) -> None:
        pixel = self._pixels(np.asarray(center, dtype=float))
        if fill is not None:
            self._pygame.draw.circle(self._surface, fill, pixel, radius * self._scale)
        if edge is not None:
            self._pygame.draw.circle(self._surface, edge, pixel, radius * self._scale, self._width(1.2))

    def text(self, position: ArrayLike, text: str, color: Color = _INK, centered: bool = False) -> None:
        """Text that begins at a position, or is centered on it, at half its height; kept inside the picture."""
        if not text:
            return
        # A font does not outlive pygame.quit(), which any other user of pygame may call: none is kept.
        self._pygame.font.init()
        font = self._pygame.font.Font(None, max(14, round(17 * self._size / 480)) * _OVERSAMPLING)
        image = font.render(text, True, color)
        box = image.get_rect()
        pixel = self._pixels(np.asarray(position, dtype=float))
        box.center = pixel if centered else (pixel[0] + box.width / 2, pixel[1])
        self._surface.blit(image, box.clamp(self._surface.get_rect()))

    def picture(self) -> NDArray[np.uint8]:
        size = (self._size, self._size)
        small = self._pygame.transform.smoothscale(self._surface, size)
        flat = np.frombuffer(self._pygame.image.tobytes(small, "RGB"), dtype=np.uint8)
        return flat.reshape(*size, 3).copy()

    def _pixels(self, points: Points) -> Any:
        return (self._scale * (points * (1, -1) + self.half)).tolist()

    def _width(self, width: float) -> int:
        return max(1, round(width * _OVERSAMPLING * self._size / 480))


def _pygame() -> ModuleType:
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    try:
        import pygame
    except ImportError as error:
        raise ImportError("drawing the arm needs pygame: pip install pygame") from error
    return pygame


def _direction(angle: ArrayLike) -> Points:
    return np.stack((np.cos(angle), np.sin(angle)), axis=-1)


def _hand(arm: ArmParameters, angles: Points) -> Points:
    """Hand positions (n, 2) of postures (n, 2)."""
    upper, fore = arm.link_length
    return upper * _direction(angles[:, 0]) + fore * _direction(angles.sum(axis=1))


def _joints(arm: ArmParameters, angles: Points) -> Points:
    """The ends of the three bones (4, 2): where the trunk's begins, shoulder, elbow, hand (m)."""
    elbow = arm.link_length[0] * _direction(angles[0])
    hand = elbow + arm.link_length[1] * _direction(angles.sum())
    return np.stack((-_TRUNK_LENGTH * _direction(_TRUNK_ANGLE), np.zeros(2), elbow, hand))


def _moment_arms(arm: ArmParameters, angles: ArrayLike) -> Points:
    """Magnitudes (6, 2) of each muscle's moment arms at shoulder and elbow (m)."""
    linear = np.array((arm.path_linear_shoulder, arm.path_linear_elbow))
    quadratic = np.array((arm.path_quadratic_shoulder, arm.path_quadratic_elbow))
    angle = np.asarray(angles, dtype=float) - arm.path_reference_angle
    return np.abs(linear + 2 * quadratic * angle[:, None]).T


def _draw_workspace(canvas: _Canvas, arm: ArmParameters) -> None:
    """The hand positions within the joint limits, and the circle of the stretched arm."""
    (q1_min, q2_min), (q1_max, q2_max) = arm.joint_lower_limit, arm.joint_upper_limit
    corners = np.array([(q1_min, q2_min), (q1_max, q2_min), (q1_max, q2_max), (q1_min, q2_max), (q1_min, q2_min)])
    along = np.linspace(0, 1, 40)[:, None]
    postures = np.concatenate([a + along * (b - a) for a, b in zip(corners[:-1], corners[1:], strict=True)])
    canvas.polygon(_hand(arm, postures), _WORKSPACE, _FAINT)
    canvas.disc((0, 0), sum(arm.link_length), edge=_FAINT)


def _draw_path(canvas: _Canvas, path: Points) -> None:
    """Fading from the newest position back to the oldest."""
    path = path[:: -max(1, len(path) // _MAX_PATH_SEGMENTS)][::-1]
    freshness = np.linspace(0, 1, max(len(path) - 1, 1))[:, None]
    colors = np.array(_PATH_OLD) + freshness * np.subtract(_PATH_NEW, _PATH_OLD)
    for start, end, color in zip(path[:-1], path[1:], colors.astype(int).tolist(), strict=False):
        canvas.line(np.stack((start, end)), color, 2)


def _draw_bones(canvas: _Canvas, joints: Points) -> None:
    along = np.linspace(0, 1, 24)
    half_width = 0.0065 + 0.0045 * np.abs(2 * along - 1) ** 4
    for start, end in zip(joints[:-1], joints[1:], strict=True):
        canvas.polygon(_ribbon(start + along[:, None] * (end - start), half_width), _BONE, _BONE_EDGE)


def _draw_joints(canvas: _Canvas, joints: Points) -> None:
    for center, radius in zip(joints[1:], (0.016, 0.015, 0.013), strict=True):
        canvas.disc(center, radius, _WHITE, _INK)


def _draw_muscle(canvas: _Canvas, joints: Points, route: _Route, moment_arm: Points, color: Color) -> None:
    centerline = _centerline(joints, route, moment_arm)
    canvas.line(centerline, _TENDON, 1.5)
    first, last = (round(fraction * (len(centerline) - 1)) for fraction in route.belly)
    belly = centerline[first : last + 1]
    half_width = route.half_width * np.sin(np.linspace(0, np.pi, len(belly))) ** 0.8
    canvas.polygon(_ribbon(belly, half_width), color, _MUSCLE_EDGE)


def _centerline(joints: Points, route: _Route, moment_arm: Points) -> Points:
    """The muscle's smooth course (64, 2) from origin to insertion, evenly spaced (m)."""
    bones = np.diff(joints, axis=0)
    angle = np.arctan2(bones[:, 1], bones[:, 0])
    points: list[Points] = []
    bone = route.attachments[0].bone
    for attachment in route.attachments:
        for distal in range(bone + 1, attachment.bone + 1):
            points.extend(_around_joint(joints[distal], angle[distal - 1 : distal + 1], route.side, moment_arm[distal - 1]))
        bone = attachment.bone
        outward = route.side * _direction(angle[bone] + np.pi / 2)
        points.append(joints[bone] + attachment.fraction * bones[bone] + attachment.offset * outward)
    return _resample(_smooth(np.array(points)), 64)


def _around_joint(joint: Points, bone_angles: Points, side: float, radius: float) -> Points:
    """Points (n, 2) by which a muscle passes a joint: an extensor is wrapped around it, a flexor spans its inside."""
    proximal = bone_angles[0]
    flexion = (bone_angles[1] - proximal + np.pi) % (2 * np.pi) - np.pi
    turn = np.array([0.5]) if side == _FLEXION else np.linspace(0, 1, 5)
    return joint + side * radius * _direction(proximal + turn * flexion + np.pi / 2)


def _smooth(points: Points) -> Points:
    """The quadratic B-spline of control points (n, 2), by Chaikin's corner cutting; both ends stay."""
    for _ in range(3):
        start, end = points[:-1], points[1:]
        cut = np.stack((0.75 * start + 0.25 * end, 0.25 * start + 0.75 * end), axis=1).reshape(-1, 2)
        points = np.concatenate((points[:1], cut, points[-1:]))
    return points


def _resample(points: Points, n: int) -> Points:
    """n points (n, 2) evenly spaced along a line."""
    length = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))))
    at = np.linspace(0, length[-1], n)
    return np.stack([np.interp(at, length, axis) for axis in points.T], axis=1)


def _ribbon(centerline: Points, half_width: Points) -> Points:
    """Outline (2 n, 2) of a band around a line (n, 2)."""
    tangent = np.gradient(centerline, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    offset = half_width[:, None] * tangent[:, ::-1] * (-1, 1)
    return np.concatenate((centerline + offset, (centerline - offset)[::-1]))


def _draw_mark(canvas: _Canvas, center: ArrayLike) -> None:
    arm = 3.5 * canvas.pixel
    for offset in ((arm, 0.0), (0.0, arm)):
        canvas.line(np.stack((np.subtract(center, offset), np.add(center, offset))), _GOAL, 1.5)


def _draw_load(canvas: _Canvas, hand: Points, load: Points) -> None:
    """An arrow from the hand, as long as the force is strong, and its magnitude."""
    force = float(np.linalg.norm(load))
    if force == 0:
        return
    along = load / force
    across = along[::-1] * (-1, 1)
    start = hand + 0.013 * along
    tip = start + (0.022 + min(_LOAD_SCALE * force, _LOAD_MAX_LENGTH)) * along
    barb = tip - 0.022 * along
    canvas.line(np.stack((start, barb)), _LOAD, 2.5)
    canvas.polygon(np.stack((tip, barb + 0.011 * across, barb - 0.011 * across)), _LOAD)
    canvas.text(tip + (0.05, 0.03) * along, f"{force:.1f} N", _LOAD, centered=True)


def _draw_keys(canvas: _Canvas) -> None:
    """The scale bar and the color bar, in the lower corners."""
    left, bottom = 0.03 - canvas.half, 0.03 - canvas.half
    canvas.line(np.array([(left, bottom), (left + 0.1, bottom)]), _INK, 2)
    canvas.text((left + 0.05, bottom + 0.03), "10 cm", centered=True)
    width, height = 0.27, 0.022
    right = canvas.half - 0.03
    for i, activation in enumerate(np.linspace(0, 1, 54)):
        x = right - width + np.array([i, i + 1.5]) * width / 54
        canvas.polygon(_box(x[0], min(x[1], right), bottom, height), activation_color(float(activation)))
    outline = _box(right - width, right, bottom, height)
    canvas.line(np.concatenate((outline, outline[:1])), _INK)
    canvas.text((right - width / 2, bottom + 0.05), "activation 0 … 1", centered=True)


def _box(left: float, right: float, bottom: float, height: float) -> Points:
    return np.array([(left, bottom), (right, bottom), (right, bottom + height), (left, bottom + height)])
