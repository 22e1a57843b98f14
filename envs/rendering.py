"""Pictures of one arm or two: what one shows, and how it is drawn."""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bilateral_rl.envs.anatomy import elbow_and_hand
from bilateral_rl.envs.arm.parameters import ArmParameters
from bilateral_rl.envs.arm_drawing import (
    OF_ONE,
    OF_TWO,
    ArmScene,
    Look,
    activation_colors,
    draw_above,
    draw_arm,
    draw_beneath,
    draw_signal,
)
from bilateral_rl.envs.canvas import INK, WHITE, Canvas, Points, View
from bilateral_rl.envs.force_drawing import FORCE, draw_scale, draw_velocity_field
from bilateral_rl.envs.spring_drawing import SPRING, SPRING_FORCE, SpringScene, draw_spring
from bilateral_rl.vocabulary import SIDES

VIEW_MARGIN = 1.13
"""Half the picture's side over the reach of a single arm; its shoulder is at the center."""

_LINE_SPACING = 0.05  # of the caption (m)
_ABOVE, _BELOW, _BESIDE = 0.115, 0.27, 0.02  # what a picture of two arms shows beyond their hands' places (m)
_WORDS_BELOW = 0.17  # the line of the shoulders (m)

_FAINT, _WORKSPACE, _BODY = (212, 216, 222), (247, 248, 250), (236, 237, 240)


class Scene(NamedTuple):
    """What one picture shows."""

    arms: tuple[ArmScene, ...]
    """One arm, or the dominant and the non-dominant one, each in its own frame."""
    threshold: float
    """Radius of the goals (m)."""
    caption: str = ""
    """One or several lines."""
    shoulder_distance: float = 0.0
    """Distance of the shoulders of two arms (m)."""
    spring: SpringScene | None = None
    """What ties the hands together; None if nothing does."""


def draw(arm: ArmParameters, scene: Scene, size: int = 480) -> NDArray[np.uint8]:
    """Return the scene as an RGB picture (h, w, 3), y up.

    A single arm is in the middle of a square that shows its whole reach; two are in the frame of the body, seen from
    above, and the picture is broader than it is high.

    Args:
        arm: each arm's constants.
        scene: what is shown.
        size: height of the picture (pixels).
    """
    canvas = Canvas(*_background(arm, len(scene.arms), scene.shoulder_distance, size))
    frames = _frames(canvas, len(scene.arms), scene.shoulder_distance)
    looks = OF_TWO if len(scene.arms) > 1 else (OF_ONE,)
    arms = list(zip(frames, scene.arms, looks, strict=True))
    for frame, one, look in arms:
        draw_beneath(frame, arm, one, scene.threshold, look)
    for frame, one, look in arms:
        draw_arm(frame, arm, one, look)
    if scene.spring is not None:
        hands = np.stack([frame.outside(one.joints(arm)[-1]) for frame, one, _ in arms])
        draw_spring(canvas, scene.spring, hands)
    for frame, one, look in arms:
        draw_above(frame, arm, one, look)
    for frame, one, look in arms:
        _draw_words(canvas, frame, one, look)
    if scene.spring is not None:
        place = (0.0, -_WORDS_BELOW - _LINE_SPACING)
        canvas.text(place, f"spring {np.linalg.norm(scene.spring.force):.1f} N", SPRING)
    _draw_scale_of_forces(canvas, scene)
    for i, line in enumerate(scene.caption.splitlines()):
        canvas.text((canvas.left + 0.03, canvas.top - 0.045 - i * _LINE_SPACING), line, centered=False)
    return canvas.picture()


def picture_size(arm: ArmParameters, n_arms: int, shoulder_distance: float, size: int) -> tuple[int, int]:
    """Return width and height of a picture of ``size`` (pixels)."""
    return _view(arm, n_arms, shoulder_distance).size(size)


def _view(arm: ArmParameters, n_arms: int, shoulder_distance: float) -> View:
    """Return what a picture shows: all that the arms reach, and room below for words."""
    reach = sum(arm.link_length)
    if n_arms == 1:
        return View((0.0, 0.0), (VIEW_MARGIN * reach, VIEW_MARGIN * reach))
    lowest = min(float(area[:, 1].min()) for area in _workspace(arm))
    bottom, top = min(lowest, 0.0) - _BELOW, reach + _ABOVE
    return View((0.0, (top + bottom) / 2), (shoulder_distance / 2 + reach + _BESIDE, (top - bottom) / 2))


def _frames(canvas: Canvas, n_arms: int, shoulder_distance: float) -> list[Canvas]:
    """Return the canvas in each arm's own frame."""
    if n_arms == 1:
        return [canvas]
    return [canvas.frame(outward * shoulder_distance / 2, outward) for outward in (1.0, -1.0)]


def _draw_words(canvas: Canvas, frame: Canvas, scene: ArmScene, look: Look) -> None:
    """Draw what stands below the arms: the signals, the velocity fields and, of two arms, which one is which."""
    aside = frame.outside((0.0, 0.0))[0]
    if scene.cue is not None:
        draw_signal(canvas, scene.cue, np.array((1.5 * aside, canvas.bottom + 0.045)), look)
    if scene.forces is not None:
        left = canvas.right - 0.25 if aside > 0 else canvas.left + 0.03
        draw_velocity_field(frame, scene.forces, np.array((left, canvas.bottom + 0.105)))
    if scene.role is not None:
        side = SIDES[0] if aside > 0 else SIDES[1]
        lines = (f"{side.replace('_', '-')} hand: {scene.role}", *scene.words.splitlines())
        for i, line in enumerate(lines):
            canvas.text((2.4 * aside, -_WORDS_BELOW - i * _LINE_SPACING), line, look.goal)


def _draw_scale_of_forces(canvas: Canvas, scene: Scene) -> None:
    if any(one.forces is not None for one in scene.arms):
        draw_scale(canvas, FORCE)
    elif scene.spring is not None:
        draw_scale(canvas, SPRING_FORCE)


@lru_cache(maxsize=4)
def _background(arm: ArmParameters, n_arms: int, shoulder_distance: float, size: int) -> tuple[View, int, Any]:
    """Return view, height and surface of what every picture shows: body, workspaces, scale bar and color bar."""
    view = _view(arm, n_arms, shoulder_distance)
    canvas = Canvas(view, size)
    frames = _frames(canvas, n_arms, shoulder_distance)
    if n_arms == 1:
        canvas.disc((0, 0), sum(arm.link_length), WHITE, _FAINT)
    for frame in frames:
        for area in _workspace(arm):
            frame.polygon(area, _WORKSPACE, _FAINT)
    for frame in frames[:-1]:  # whose edges lie below the other's area
        for area in _workspace(arm):
            frame.line(area, _FAINT)
    if n_arms > 1:
        _draw_body(canvas, shoulder_distance)
    left, right, bottom = canvas.left + 0.03, canvas.right - 0.03, canvas.bottom + 0.03
    canvas.line(np.array([(left, bottom), (left + 0.1, bottom)]), INK, 2)
    canvas.text((left + 0.05, bottom + 0.03), "10 cm")
    edges = np.linspace(right - 0.27, right, 65)
    for (start, end), color in zip(pairwise(edges), activation_colors(np.linspace(0, 1, 64)), strict=True):
        canvas.polygon(_box(start, end, bottom, bottom + 0.022), color)
    canvas.line(_box(right - 0.27, right, bottom, bottom + 0.022), INK)
    canvas.text((right - 0.135, bottom + 0.05), "activation 0 … 1")
    return view, size, canvas.surface


def _draw_body(canvas: Canvas, shoulder_distance: float) -> None:
    """Suggest the body from above: shoulders, head and nose, and the midline, from which the arms mirror each other."""
    angle = np.linspace(0, 2 * np.pi, 73)[:-1]
    circle = np.stack((np.cos(angle), np.sin(angle)), axis=1)
    trunk = np.sign(circle) * np.abs(circle) ** 0.75 * (shoulder_distance / 2 + 0.03, 0.085) + (0.0, -0.055)
    canvas.polygon(trunk, _BODY, _FAINT)
    canvas.polygon(np.array([(-0.022, 0.03), (0.0, 0.062), (0.022, 0.03)]), WHITE, _FAINT)
    canvas.polygon(circle * (0.068, 0.082) + (0.0, -0.04), WHITE, _FAINT)
    dashes = np.arange(0.08, canvas.top - 0.02, 0.03)
    for y in dashes:
        canvas.line(np.array([(0.0, y), (0.0, y + 0.015)]), _FAINT)


def _box(left: float, right: float, bottom: float, top: float) -> Points:
    return np.array([(left, bottom), (right, bottom), (right, top), (left, top), (left, bottom)])


@lru_cache(maxsize=4)
def _workspace(arm: ArmParameters) -> tuple[Points, ...]:
    """Return the outlines (n, 2) of the hand positions within the joint limits (m).

    An elbow that bends both ways reaches most of them by two postures: each way has an area of its own.
    """
    (q1_min, q2_min), (q1_max, q2_max) = arm.joint_lower_limit, arm.joint_upper_limit
    along = np.linspace(0, 1, 40)[:, None]
    areas = []
    for first, last in pairwise([q2_min, 0.0, q2_max] if q2_min < 0 < q2_max else [q2_min, q2_max]):
        corners = _box(q1_min, q1_max, first, last)
        postures = np.concatenate([a + along * (b - a) for a, b in pairwise(corners)])
        areas.append(np.stack([elbow_and_hand(arm, posture)[1] for posture in postures]))
    return tuple(areas)
