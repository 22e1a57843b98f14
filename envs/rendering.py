"""Pictures of the arm: what one shows, and how it is drawn."""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import pairwise
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bilateral_rl.envs.anatomy import ROUTES, Route, elbow_and_hand, moment_arms, muscle_course, ribbon
from bilateral_rl.envs.arm.parameters import MUSCLE_NAMES, ArmParameters
from bilateral_rl.envs.canvas import INK, WHITE, Canvas, Color, Points
from bilateral_rl.envs.force_drawing import HandForceScene, draw_force, draw_legend, draw_surroundings
from bilateral_rl.envs.tasks import NEVER

VIEW_MARGIN = 1.13
"""Half the picture's side over the arm's reach; the shoulder is at the center."""

_TRUNK = -0.13 * np.array((math.cos(math.radians(15)), math.sin(math.radians(15))))  # where the shoulder girdle begins
_LOAD_SCALE, _LOAD_MAX_LENGTH = 0.01, 0.2  # m/N, m
_MAX_PATH_SEGMENTS = 400
_LINE_SPACING = 0.05  # of the caption (m)

_FAINT, _WORKSPACE = (212, 216, 222), (247, 248, 250)
_BONE, _BONE_EDGE, _TENDON, _MUSCLE_EDGE = (235, 231, 222), (140, 136, 128), (150, 125, 120), (110, 70, 65)
_GOAL, _GOAL_FILL, _LOAD = (0, 95, 160), (218, 234, 246), (0, 125, 90)
_FAINT_GOAL = (150, 185, 215)
_AMBER, _GREEN = (240, 170, 30), (0, 125, 90)
_SIGNALS = {
    "wait": ("wait for the cue", WHITE, _AMBER),
    "go": ("go", _GREEN, _GREEN),
    "jump": ("the target jumped", _GOAL, _GOAL),
}
"""Words, fill and edge of the signal in each phase."""
_PATH_OLD, _PATH_NEW = (205, 215, 225), (45, 65, 95)
_ACTIVATION_COLORS = ((255, 245, 240), (252, 187, 161), (251, 106, 74), (203, 24, 29), (103, 0, 13))
"""ColorBrewer's Reds at activation 0, 0.25, … 1: lightness falls all the way, so it reads in grey too."""


class CueScene(NamedTuple):
    """What a timeline says at a moment."""

    phase: Literal["wait", "go", "jump"]
    """Whether the go cue is yet to come, has come, or the target has jumped since."""
    other_target: NDArray[Any] | None
    """(2,): the target that is to come, or was there before the jump (m); None if there is none."""

    @classmethod
    def at(cls, step: int, go: int, jump: int, goal: NDArray[Any]) -> CueScene:
        """Return what is to see after ``step`` steps of a trial with the cue at ``go`` and a jump at ``jump``."""
        if step < go:
            return cls("wait", None if go >= NEVER else goal)
        return cls("go", None) if step < jump else cls("jump", goal)


class Scene(NamedTuple):
    """What one picture shows."""

    angles: NDArray[Any]
    """(2,): angles of shoulder and elbow (rad)."""
    activation: NDArray[Any]
    """(6,): muscle activations in [0, 1]."""
    target: NDArray[Any]
    """(2,): position of the target (m)."""
    path: NDArray[Any]
    """(k, 2): hand positions so far (m); k may be 0."""
    threshold: float
    """Radius of the goal (m)."""
    load: NDArray[Any]
    """(2,): constant force on the hand (N)."""
    caption: str = ""
    """One or several lines."""
    forces: HandForceScene | None = None
    """What acts on the hand beside the load; None in tasks without."""
    cue: CueScene | None = None
    """What the timeline says; None in tasks without."""


def draw(arm: ArmParameters, scene: Scene, size: int = 480) -> NDArray[np.uint8]:
    """Return the scene as a (``size``, ``size``, 3) RGB picture, y up, showing the whole reach around the shoulder."""
    angles, load = np.asarray(scene.angles, dtype=float), np.asarray(scene.load, dtype=float)
    joints = np.stack((_TRUNK, np.zeros(2), *elbow_and_hand(arm, angles)))
    canvas = Canvas(_half(arm), size, _background(arm, size))
    if scene.forces is not None:
        draw_surroundings(canvas, scene.forces, joints[-1], sum(arm.link_length))
    if scene.cue is not None:
        _draw_cue(canvas, scene.cue, scene.threshold)
    canvas.disc(scene.target, scene.threshold, _GOAL_FILL, _GOAL)
    _draw_path(canvas, np.asarray(scene.path, dtype=float))
    _draw_bones(canvas, joints)
    colors = _activation_colors(np.asarray(scene.activation))
    for name, color, moment_arm in zip(MUSCLE_NAMES, colors, moment_arms(arm, angles), strict=True):
        _draw_muscle(canvas, ROUTES[name], muscle_course(joints, ROUTES[name], moment_arm), color)
    for center, radius in zip(joints[1:], (0.017, 0.016, 0.013), strict=True):
        canvas.disc(center, radius, WHITE, INK)
    for offset in ((0.01, 0.0), (0.0, 0.01)):
        canvas.line(np.stack((np.subtract(scene.target, offset), np.add(scene.target, offset))), _GOAL, 1.5)
    if load.any():
        _draw_load(canvas, joints[-1], load)
    if scene.forces is not None:
        draw_force(canvas, joints[-1], np.asarray(scene.forces.force, dtype=float))
        draw_legend(canvas, scene.forces)
    for i, line in enumerate(scene.caption.splitlines()):
        canvas.text((0.03 - canvas.half, canvas.half - 0.045 - i * _LINE_SPACING), line, centered=False)
    return canvas.picture()


def _half(arm: ArmParameters) -> float:
    """Return half the side of what a picture shows (m)."""
    return VIEW_MARGIN * sum(arm.link_length)


def _activation_colors(activation: NDArray[Any]) -> list[Color]:
    """Return a color for each activation (n,), pale for 0 to deep red for 1."""
    at = np.linspace(0, 1, len(_ACTIVATION_COLORS))
    channels = [np.interp(activation, at, channel).round() for channel in zip(*_ACTIVATION_COLORS, strict=True)]
    return [(int(r), int(g), int(b)) for r, g, b in zip(*channels, strict=True)]


@lru_cache(maxsize=4)
def _background(arm: ArmParameters, size: int) -> Any:
    """Return a canvas's surface with what every picture shows: the workspace, the scale bar and the color bar."""
    canvas = Canvas(_half(arm), size)
    _draw_workspace(canvas, arm)
    left, right, bottom = 0.03 - canvas.half, canvas.half - 0.03, 0.03 - canvas.half
    canvas.line(np.array([(left, bottom), (left + 0.1, bottom)]), INK, 2)
    canvas.text((left + 0.05, bottom + 0.03), "10 cm")
    edges = np.linspace(right - 0.27, right, 65)
    for (start, end), color in zip(pairwise(edges), _activation_colors(np.linspace(0, 1, 64)), strict=True):
        canvas.polygon(_box(start, end, bottom, bottom + 0.022), color)
    canvas.line(_box(right - 0.27, right, bottom, bottom + 0.022), INK)
    canvas.text((right - 0.135, bottom + 0.05), "activation 0 … 1")
    return canvas.surface


def _box(left: float, right: float, bottom: float, top: float) -> Points:
    return np.array([(left, bottom), (right, bottom), (right, top), (left, top), (left, bottom)])


def _draw_workspace(canvas: Canvas, arm: ArmParameters) -> None:
    """Draw the hand positions within the joint limits, and the circle of the stretched arm.

    An elbow that bends both ways reaches most of them by two postures: each way has an area of its own.
    """
    canvas.disc((0, 0), sum(arm.link_length), WHITE, _FAINT)
    (q1_min, q2_min), (q1_max, q2_max) = arm.joint_lower_limit, arm.joint_upper_limit
    along = np.linspace(0, 1, 40)[:, None]
    for first, last in pairwise([q2_min, 0.0, q2_max] if q2_min < 0 < q2_max else [q2_min, q2_max]):
        corners = _box(q1_min, q1_max, first, last)
        postures = np.concatenate([a + along * (b - a) for a, b in pairwise(corners)])
        hands = np.stack([elbow_and_hand(arm, posture)[1] for posture in postures])
        canvas.polygon(hands, _WORKSPACE, _FAINT)


def _draw_path(canvas: Canvas, path: Points) -> None:
    """Draw the hand's path (k, 2), fading from the newest position back to the oldest."""
    path = path[:: -(len(path) // _MAX_PATH_SEGMENTS + 1)][::-1]
    colors = np.linspace(_PATH_OLD, _PATH_NEW, max(len(path) - 1, 0)).astype(int).tolist()
    for (start, end), color in zip(pairwise(path), colors, strict=True):
        canvas.line(np.stack((start, end)), color, 2)


def _draw_bones(canvas: Canvas, joints: Points) -> None:
    along = np.linspace(0, 1, 24)[:, None]
    half_width = 0.007 + 0.005 * np.abs(2 * along - 1) ** 4
    for start, end in pairwise(joints):
        canvas.polygon(ribbon(start + along * (end - start), half_width), _BONE, _BONE_EDGE)


def _draw_muscle(canvas: Canvas, route: Route, course: Points, color: Color) -> None:
    canvas.line(course, _TENDON, 1.5)
    first, last = (round(fraction * (len(course) - 1)) for fraction in route.belly)
    along = np.linspace(0, 1, last + 1 - first)[:, None]
    canvas.polygon(ribbon(course[first : last + 1], route.half_width * np.sin(np.pi * along)), color, _MUSCLE_EDGE)


def _draw_cue(canvas: Canvas, cue: CueScene, threshold: float) -> None:
    """Draw a signal below the arm, and the outline of the target that is not the present one."""
    if cue.other_target is not None:
        canvas.disc(cue.other_target, threshold, WHITE, _FAINT_GOAL)
    words, fill, edge = _SIGNALS[cue.phase]
    place = np.array((-0.04 - 0.016 * len(words) / 2, 0.045 - canvas.half))
    canvas.disc(place, 0.014, fill, edge)
    canvas.text(place + np.array((0.03, 0.0)), words, centered=False)


def _draw_load(canvas: Canvas, hand: Points, load: Points) -> None:
    """Draw an arrow from the hand, longer for a stronger force, with its magnitude."""
    force = float(np.linalg.norm(load))
    along = load / force
    across = along[::-1] * (-1, 1)
    barb = hand + (0.013 + min(_LOAD_SCALE * force, _LOAD_MAX_LENGTH)) * along
    tip = barb + 0.024 * along
    canvas.line(np.stack((hand + 0.013 * along, barb)), _LOAD, 2.5)
    canvas.polygon(np.stack((tip, barb + 0.012 * across, barb - 0.012 * across)), _LOAD)
    canvas.text(tip + (0.055, 0.03) * along, f"{force:.1f} N", _LOAD)
