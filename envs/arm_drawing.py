"""One arm in a picture: its bones and muscles, its targets and its path, and what acts on its hand.

Everything is drawn in the arm's own frame; a canvas shows that of the non-dominant arm mirrored.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bilateral_rl.envs.anatomy import ROUTES, Route, joint_positions, moment_arms, muscle_course, ribbon
from bilateral_rl.envs.arm.parameters import MUSCLE_NAMES, ArmParameters
from bilateral_rl.envs.canvas import INK, WHITE, Canvas, Color, Points
from bilateral_rl.envs.force_drawing import HAND_RADIUS, HandForceScene, draw_force, draw_surroundings
from bilateral_rl.envs.task import NEVER

_LOAD_SCALE, _LOAD_MAX_LENGTH = 0.01, 0.2  # m/N, m
_MAX_PATH_SEGMENTS = 400

_BONE, _BONE_EDGE, _TENDON, _MUSCLE_EDGE = (235, 231, 222), (140, 136, 128), (150, 125, 120), (110, 70, 65)
_LOAD = (0, 125, 90)
_AMBER, _GREEN = (240, 170, 30), (0, 125, 90)
_ACTIVATION_COLORS = ((255, 245, 240), (252, 187, 161), (251, 106, 74), (203, 24, 29), (103, 0, 13))
"""ColorBrewer's Reds at activation 0, 0.25, … 1: lightness falls all the way, so it reads in grey too."""

Role = Literal["reach", "hold"]


class Look(NamedTuple):
    """Colors of what belongs to a hand."""

    goal: Color
    goal_fill: Color
    faint_goal: Color
    old_path: Color
    new_path: Color
    hand: Color


OF_ONE = Look((0, 95, 160), (218, 234, 246), (150, 185, 215), (205, 215, 225), (45, 65, 95), WHITE)
"""An arm without another."""
OF_TWO = (
    OF_ONE._replace(new_path=(0, 62, 110), hand=(0, 95, 160)),
    Look((176, 96, 0), (251, 233, 208), (226, 190, 145), (232, 222, 205), (112, 60, 0), (176, 96, 0)),
)
"""The dominant arm and the non-dominant one: blue and ochre differ for color-blind people too."""


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


class ArmScene(NamedTuple):
    """What one picture shows of one arm, in its own frame."""

    angles: NDArray[Any]
    """(2,): angles of shoulder and elbow (rad)."""
    activation: NDArray[Any]
    """(6,): muscle activations in [0, 1]."""
    target: NDArray[Any]
    """(2,): position of the target (m)."""
    path: NDArray[Any]
    """(k, 2): hand positions so far (m); k may be 0."""
    load: NDArray[Any]
    """(2,): constant force on the hand (N)."""
    forces: HandForceScene | None = None
    """What acts on the hand beside the load; None in tasks without."""
    cue: CueScene | None = None
    """What the timeline says; None in tasks without."""
    role: Role | None = None
    """What the hand is to do where each of two has something of its own to do."""
    words: str = ""
    """What else is written below an arm with a role."""

    def joints(self, arm: ArmParameters) -> Points:
        """Return the positions (4, 2) of where the shoulder girdle begins, shoulder, elbow and hand (m)."""
        return joint_positions(arm, np.asarray(self.angles, dtype=float))


def draw_beneath(canvas: Canvas, arm: ArmParameters, scene: ArmScene, radius: float, look: Look) -> None:
    """Draw what lies below the arms: surroundings, the target with its ``radius`` (m), and the path."""
    if scene.forces is not None:
        draw_surroundings(canvas, scene.forces, scene.joints(arm)[-1], sum(arm.link_length))
    if scene.cue is not None:
        _draw_cue(canvas, scene.cue, radius, look)
    canvas.disc(scene.target, radius, look.goal_fill, look.goal)
    if scene.role == "hold":
        canvas.disc(scene.target, 0.7 * radius, None, look.goal)
        canvas.disc(scene.target, 0.4 * radius, None, look.goal)
    _draw_path(canvas, np.asarray(scene.path, dtype=float), look)


def draw_arm(canvas: Canvas, arm: ArmParameters, scene: ArmScene, look: Look) -> None:
    """Draw bones, muscles and joints."""
    joints = scene.joints(arm)
    _draw_bones(canvas, joints)
    colors = activation_colors(np.asarray(scene.activation))
    for name, color, moment_arm in zip(
        MUSCLE_NAMES, colors, moment_arms(arm, np.asarray(scene.angles, dtype=float)), strict=True
    ):
        _draw_muscle(canvas, ROUTES[name], muscle_course(joints, ROUTES[name], moment_arm), color)
    for center, radius, fill in zip(joints[1:], (0.017, 0.016, HAND_RADIUS), (WHITE, WHITE, look.hand), strict=True):
        canvas.disc(center, radius, fill, INK)


def draw_above(canvas: Canvas, arm: ArmParameters, scene: ArmScene, look: Look) -> None:
    """Draw what lies above the arms: the target's center, and the forces on the hand."""
    if scene.role != "hold":
        for offset in ((0.01, 0.0), (0.0, 0.01)):
            canvas.line(np.stack((np.subtract(scene.target, offset), np.add(scene.target, offset))), look.goal, 1.5)
    load = np.asarray(scene.load, dtype=float)
    if scene.forces is None and not load.any():
        return
    hand = scene.joints(arm)[-1]
    if load.any():
        _draw_load(canvas, hand, load)
    if scene.forces is not None:
        draw_force(canvas, hand, np.asarray(scene.forces.force, dtype=float))


def draw_signal(canvas: Canvas, cue: CueScene, place: Points, look: Look) -> None:
    """Draw the signal of a cue with its words around a ``place`` (2,)."""
    words, fill, edge = {
        "wait": ("wait for the cue", WHITE, _AMBER),
        "go": ("go", _GREEN, _GREEN),
        "jump": ("the target jumped", look.goal, look.goal),
    }[cue.phase]
    place = place - np.array((0.04 + 0.016 * len(words) / 2, 0.0))
    canvas.disc(place, 0.014, fill, edge)
    canvas.text(place + np.array((0.03, 0.0)), words, centered=False)


def activation_colors(activation: NDArray[Any]) -> list[Color]:
    """Return a color for each activation (n,), pale for 0 to deep red for 1."""
    at = np.linspace(0, 1, len(_ACTIVATION_COLORS))
    channels = [np.interp(activation, at, channel).round() for channel in zip(*_ACTIVATION_COLORS, strict=True)]
    return [(int(r), int(g), int(b)) for r, g, b in zip(*channels, strict=True)]


def _draw_cue(canvas: Canvas, cue: CueScene, radius: float, look: Look) -> None:
    """Draw the outline of the target that is not the present one."""
    if cue.other_target is not None:
        canvas.disc(cue.other_target, radius, WHITE, look.faint_goal)


def _draw_path(canvas: Canvas, path: Points, look: Look) -> None:
    """Draw the hand's path (k, 2), fading from the newest position back to the oldest."""
    path = path[:: -(len(path) // _MAX_PATH_SEGMENTS + 1)][::-1]
    colors = np.linspace(look.old_path, look.new_path, max(len(path) - 1, 0)).astype(int).tolist()
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


def _draw_load(canvas: Canvas, hand: Points, load: Points) -> None:
    """Draw an arrow from the hand, longer for a stronger force, with its magnitude."""
    force = float(np.linalg.norm(load))
    along = load / force
    across = along[::-1] * (-1, 1)
    barb = hand + (HAND_RADIUS + min(_LOAD_SCALE * force, _LOAD_MAX_LENGTH)) * along
    tip = barb + 0.024 * along
    canvas.line(np.stack((hand + HAND_RADIUS * along, barb)), _LOAD, 2.5)
    canvas.polygon(np.stack((tip, barb + 0.012 * across, barb - 0.012 * across)), _LOAD)
    canvas.text(tip + (0.055, 0.03) * along, f"{force:.1f} N", _LOAD)
