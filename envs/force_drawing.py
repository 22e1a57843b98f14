"""Forces on the hand in pictures: the present one as an arrow, the field, and the walls of a channel."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bilateral_rl.envs.canvas import Canvas, Color, Points

FORCE_SCALE = 0.01
"""Length of an arrow by its force (m/N)."""
FORCE, _FAINT_FORCE = (118, 42, 131), (205, 180, 212)

HAND_RADIUS = 0.013
"""Radius of the hand's disc (m)."""

_LEAST_FORCE = 0.05  # N, that is written as 0.1
_HEAD, _HALF_HEAD = 0.024, 0.012  # m
_WALLS_APART = 0.012  # m
_GRID = 0.06 * np.arange(-2, 3)  # m from the hand
_GLYPH_RADIUS, _GLYPH_ARROW = 0.045, 0.04  # m


class HandForceScene(NamedTuple):
    """What acts on the hand beside its load."""

    force: NDArray[Any]
    """(2,): force in the last step (N)."""
    offset: NDArray[Any]
    """(2,): the part of fields and walls that depends on neither position nor velocity (N)."""
    velocity_gain: NDArray[Any]
    """(2, 2): force by velocity of the hand (N·s/m)."""
    position_gain: NDArray[Any]
    """(2, 2): force toward the origin by position of the hand (N/m)."""

    def channel(self) -> tuple[Points, Points] | None:
        """Return the point of a channel's axis nearest to the shoulder (m), and its direction, (2,) each, or None.

        Walls pull toward a line, and nothing else here has a stiffness across one line alone.
        """
        gain = np.asarray(self.position_gain, dtype=float)
        if not gain.any() or not np.allclose(gain, gain.T, atol=1e-3 * np.abs(gain).max()):
            return None
        (weak, stiff), axes = np.linalg.eigh(gain)
        if abs(weak) > 1e-3 * stiff:
            return None
        along, across = axes.T
        return across * (across @ self.offset) / stiff, along


def draw_surroundings(canvas: Canvas, forces: HandForceScene, hand: Points, reach: float) -> None:
    """Draw what lies around the hand (2,): the walls of a channel within ``reach`` (m), or the elastic field."""
    channel = forces.channel()
    if channel is not None:
        point, along = channel
        half = (
            max(reach**2 - float(point @ point), 0.0) ** 0.5
        )  # as the point of the axis that is nearest to the shoulder
        aside = 0.5 * _WALLS_APART * along[::-1] * (-1, 1)
        for side in (aside, -aside):
            canvas.line(point + side + np.outer((-half, half), along), FORCE, 1.5)
    elif forces.position_gain.any():
        for place in hand + np.stack(np.meshgrid(_GRID, _GRID), axis=-1).reshape(-1, 2):
            arrow = FORCE_SCALE * (forces.offset - forces.position_gain @ place)
            _draw_small_arrow(canvas, place, _shortened(arrow, 0.9 * _GRID[-1] / 2), _FAINT_FORCE)


def draw_scale(canvas: Canvas, color: Color = FORCE) -> None:
    """Draw, above the scale bar, how long an arrow of 10 N is."""
    base = np.array((canvas.left + 0.03, canvas.bottom + 0.105))
    draw_arrow(canvas, base, np.array((10 * FORCE_SCALE - _HEAD, 0.0)), color)
    canvas.text(base + np.array((0.05, 0.03)), "10 N", color)


def draw_velocity_field(canvas: Canvas, forces: HandForceScene, corner: Points) -> None:
    """Draw what a velocity field does in eight directions, to the right of ``corner`` (2,) and above it.

    These are directions of the hand at speeds that are alike: dots, and arrows from them.
    """
    if not forces.velocity_gain.any() or forces.channel() is not None:
        return
    center = canvas.inside(corner + np.array((0.115, 0.16)))
    angles = np.pi / 4 * np.arange(8)
    directions = np.stack((np.cos(angles), np.sin(angles)), axis=1)
    by_direction = directions @ np.asarray(forces.velocity_gain, dtype=float).T
    longest = np.linalg.norm(by_direction, axis=1).max()
    for direction, force in zip(directions, by_direction, strict=True):
        canvas.line(np.stack((center, center + _GLYPH_RADIUS * direction)), _FAINT_FORCE, 1)
        _draw_small_arrow(canvas, center + _GLYPH_RADIUS * direction, _GLYPH_ARROW * force / longest, FORCE)
    canvas.text(canvas.inside(corner + np.array((0.0, 0.265))), "force by velocity", FORCE, centered=False)


def draw_force(canvas: Canvas, hand: Points, force: Points, color: Color = FORCE, written: bool = True) -> None:
    """Draw a force (2,) (N) as an arrow from the hand (2,), cut at the picture's edge, with its size if ``written``."""
    size = float(np.linalg.norm(force))
    if size < _LEAST_FORCE:
        return
    along = force / size
    base = hand + HAND_RADIUS * along
    room = canvas.room(base, along, 0.02) - _HEAD
    draw_arrow(canvas, base, max(min(FORCE_SCALE * size, room), 0.0) * along, color)
    if written:
        aside = 0.04 * along[::-1] * (-1, 1)
        middle = hand + (HAND_RADIUS + 0.6 * min(FORCE_SCALE * size, max(room, 0.0))) * along
        canvas.text(middle + aside, f"{size:.1f} N", color)


def draw_arrow(canvas: Canvas, base: Points, shaft: Points, color: Color) -> None:
    """Draw an arrow whose head begins where its shaft (2,) (m) ends."""
    length = float(np.linalg.norm(shaft))
    along = shaft / length if length else np.array((1.0, 0.0))
    across, barb = along[::-1] * (-1, 1), base + shaft
    canvas.line(np.stack((base, barb)), color, 2.5)
    canvas.polygon(np.stack((barb + _HEAD * along, barb + _HALF_HEAD * across, barb - _HALF_HEAD * across)), color)


def _draw_small_arrow(canvas: Canvas, base: Points, arrow: Points, color: Color) -> None:
    length = float(np.linalg.norm(arrow))
    if length < 1e-4:
        return
    along, tip = arrow / length, base + arrow
    head = min(0.012, 0.6 * length)
    across = 0.5 * head * along[::-1] * (-1, 1)
    canvas.line(np.stack((base, tip - head * along)), color, 1.2)
    canvas.polygon(np.stack((tip, tip - head * along + across, tip - head * along - across)), color)


def _shortened(arrow: Points, longest: float) -> Points:
    return np.asarray(arrow * min(1.0, longest / max(float(np.linalg.norm(arrow)), 1e-12)))
