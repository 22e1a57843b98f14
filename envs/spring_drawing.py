"""The spring between the hands in pictures: a coil of one wire, whose turns open as it is stretched."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bilateral_rl.envs.canvas import Canvas, Color, Points
from bilateral_rl.envs.force_drawing import HAND_RADIUS, draw_force

SPRING: Color = (52, 52, 58)
SPRING_FORCE: Color = (110, 112, 130)

_PITCH, _RADIUS, _LEAST_RADIUS = 0.016, 0.016, 0.008  # of a turn where the spring is as long as at the start (m)
_LEAST_TURNS, _MOST_TURNS = 7, 80
_LEAD = 0.012  # m of straight wire at either end
_DEPTH = 0.4  # a turn is seen from the side by so much that it is no zigzag


class SpringScene(NamedTuple):
    """What ties the hands together, in the frame of the body."""

    start_length: float
    """Distance of the hands at the start (m)."""
    force: NDArray[Any]
    """(2,): force on the dominant hand (N); that on the other one is as strong, and opposite."""


def draw_spring(canvas: Canvas, scene: SpringScene, hands: Points) -> None:
    """Draw the spring from the dominant to the non-dominant hand, (2, 2) (m), and its force on both.

    Args:
        canvas: in the frame of the body.
        scene: the spring.
        hands: where the hands are.
    """
    force = np.asarray(scene.force, dtype=float)
    for hand, on_hand in zip(hands, (force, -force), strict=True):
        draw_force(canvas, hand, on_hand, SPRING_FORCE, written=False)
    canvas.line(coil(hands[0], hands[1], scene.start_length), SPRING, 1.3)


def coil(start: Points, end: Points, start_length: float) -> Points:
    """Return the course (n, 2) of the wire between two hands (2,) (m), from the edges of their discs.

    The turns are as many as they were at the start: stretched they lie far apart and are narrow, and pressed together
    they are dense and wide.
    """
    apart = float(np.linalg.norm(end - start))
    if apart <= 2 * HAND_RADIUS:
        return np.stack((start, end))
    along = (end - start) / apart
    across = along[::-1] * (-1, 1)
    lead = min(HAND_RADIUS + _LEAD, 0.4 * apart)
    length = apart - 2 * lead
    turns = int(np.clip(round((start_length - 2 * lead) / _PITCH), _LEAST_TURNS, _MOST_TURNS))
    radius = max(_RADIUS * min(_PITCH * turns / length, 2.0) ** 0.5, _LEAST_RADIUS)
    angle = np.linspace(0, 2 * np.pi * turns, 24 * turns + 1)[:, None]
    turned = length * angle / angle[-1] - _DEPTH * radius * np.cos(angle)
    wire = start + (lead + turned) * along + radius * np.sin(angle) * across
    return np.concatenate(((start + HAND_RADIUS * along)[None], wire, (end - HAND_RADIUS * along)[None]))
