"""What a hand has learned of a field of forces: where it is deviated, and what it presses with on a channel's walls.

Arrays are as in :mod:`~bilateral_rl.analysis.kinematics`, and sides are told by the path from start to target: to the
left of it is positive. Forces are of channel trials (Scheidt, Reinkensmeyer, Conditt, Rymer & Mussa-Ivaldi 2000,
doi:10.1152/jn.2000.84.2.853).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from bilateral_rl.analysis.kinematics import SAME_PLACE, hand_speed
from bilateral_rl.analysis.samples import Float64


def signed_deviation(hand: ArrayLike, target: ArrayLike) -> Float64:
    """(n, T + 1): distance of the hand to the left of the line from start to target (m); NaN where they are one."""
    path = np.asarray(hand, dtype=np.float64)
    return _to_the_left(path - path[:, :1], path[:, 0], target)


def deviation_at_peak_speed(hand: ArrayLike, target: ArrayLike) -> Float64:
    """(n,): :func:`signed_deviation` at the end of the fastest step (m).

    Early enough to show what was planned: Smith, Ghazizadeh & Shadmehr 2006 (doi:10.1371/journal.pbio.0040179).
    """
    fastest = hand_speed(hand, 1.0).argmax(axis=1)
    return np.asarray(signed_deviation(hand, target)[np.arange(len(fastest)), fastest + 1])


def largest_deviation(hand: ArrayLike, target: ArrayLike) -> Float64:
    """(n,): :func:`signed_deviation` where it is largest in size (m)."""
    return _largest(signed_deviation(hand, target))


def force_on_walls(force: ArrayLike, start: ArrayLike, target: ArrayLike) -> Float64:
    """(n, T): force of the hand on the walls to the left of the path (N), minus that of the walls on the hand.

    Args:
        force: (n, T, 2), of the walls on the hand in each step (N).
        start: (n, 2), where the channel begins (m).
        target: (n, 2), where the channel leads (m).
    """
    return -_to_the_left(np.asarray(force, dtype=np.float64), start, target)


def peak_force(force: ArrayLike, start: ArrayLike, target: ArrayLike) -> Float64:
    """(n,): :func:`force_on_walls` where it is largest in size (N)."""
    return _largest(force_on_walls(force, start, target))


def compensation(force: ArrayLike, field_force: ArrayLike, start: ArrayLike, target: ArrayLike) -> Float64:
    """(n,): regression coefficient of the force on the walls on the one that would cancel the field.

    The slope of the least-squares line, with an intercept, through the trial's steps: 1 where the hand presses as the
    field would ask for, 0 where it does not care, below 0 the other way (Smith, Ghazizadeh & Shadmehr 2006,
    doi:10.1371/journal.pbio.0040179). NaN where the field has no force across the path.

    Args:
        force: (n, T, 2), of the walls on the hand in each step (N).
        field_force: (n, T, 2), what the field would have, which the hand cancels by minus that (N).
        start: (n, 2), where the channel begins (m).
        target: (n, 2), where the channel leads (m).
    """
    measured, ideal = (force_on_walls(one, start, target) for one in (force, field_force))
    measured, ideal = (one - one.mean(axis=1, keepdims=True) for one in (measured, ideal))
    spread = (ideal**2).sum(axis=1)
    product = (measured * ideal).sum(axis=1)
    return np.asarray(np.divide(product, spread, out=np.full(len(spread), np.nan), where=spread > 0))


def _to_the_left(vectors: Float64, start: ArrayLike, target: ArrayLike) -> Float64:
    """(n, T): the share of vectors (n, T, 2) to the left of the line from start to target."""
    straight = np.asarray(target, dtype=np.float64) - np.asarray(start, dtype=np.float64)
    distance = np.linalg.norm(straight, axis=1)
    unit = straight / np.where(distance >= SAME_PLACE, distance, np.nan)[:, None]
    return np.asarray(unit[:, None, 0] * vectors[..., 1] - unit[:, None, 1] * vectors[..., 0])


def _largest(values: Float64) -> Float64:
    """(n,): of (n, T), the value that is largest in size; NaN where all are."""
    size = np.where(np.isnan(values), -1.0, np.abs(values))
    return np.asarray(values[np.arange(len(values)), size.argmax(axis=1)])
