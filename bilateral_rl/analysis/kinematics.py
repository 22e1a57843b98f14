"""How a hand moved: path, direction, speed, errors and effort, trial by trial.

Arrays are of ``n`` trials of ``T`` steps: ``hand`` (n, T + 1, 2) from the start on (m), ``target`` (n, 2) (m),
``timestep`` the length of a step (s). Everything is computed in float64 and spans the whole trial, unless it is judged
until the hand is ``near`` its target: the arms start at rest and the controllers have no reaction time, so no onset is
looked for. A trial in which a measure has no meaning, or that holds a NaN, gets NaN, without a warning.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from bilateral_rl.analysis.samples import Float64

SAME_PLACE = 1e-6
"""Distance (m) under which two places are one: ten times the resolution of a hand in single precision."""

NEAR = 0.02
"""Distance from the target (m) at which a reach is over where it is judged on its way alone."""


def hand_speed(hand: ArrayLike, timestep: float) -> Float64:
    """(n, T): mean speed of the hand over each step (m/s)."""
    return np.asarray(np.linalg.norm(np.diff(_float(hand), axis=1), axis=2) / timestep)


def until_near(hand: ArrayLike, target: ArrayLike, near: float) -> Float64:
    """(n, T + 1, 2): the hand's path until it first comes as near as ``near`` to the target, where it then stays (m).

    So what a reach does on its way is told from what it does about its target. A hand that never comes so near keeps
    the whole of its path.
    """
    path = _float(hand)
    inside = np.linalg.norm(path - _float(target)[:, None], axis=2) <= near
    moments = path.shape[1]
    last = np.where(inside.any(axis=1), inside.argmax(axis=1), moments - 1)
    return np.asarray(path[np.arange(len(path))[:, None], np.minimum(np.arange(moments), last[:, None])])


def path_length_ratio(hand: ArrayLike, target: ArrayLike, near: float | None = None) -> Float64:
    """(n,): length of the hand's path over the straight distance that it had to go.

    The denominator is the target's distance, not that of the end of the path, so it is given by the trial and not by
    what the hand did: 1 is a straight reach, more a detour, less a hand that fell short. NaN where the trial starts on
    its target. Coderre et al. 2010 (doi:10.1177/1545968309356091).

    Args:
        hand: (n, T + 1, 2) (m).
        target: (n, 2) (m).
        near: judge the path until it comes so near to the target, which is then so much less far (m); None for all.
    """
    reach = _reach(hand, target, near)
    steps = np.linalg.norm(np.diff(reach.offset, axis=1), axis=2)
    if near is None:
        return np.asarray(steps.sum(axis=1) / reach.distance)
    left = np.minimum(np.linalg.norm(reach.straight - reach.offset[:, -1], axis=1), near)  # a step may lead nearer
    to_go = reach.distance - left
    return np.asarray(steps.sum(axis=1) / np.where(to_go >= SAME_PLACE, to_go, np.nan))


def perpendicular_deviation(hand: ArrayLike, target: ArrayLike, near: float | None = None) -> Float64:
    """(n,): largest distance of the hand from the line through start and target, on either side of it (m).

    NaN where the trial starts on its target. The numerator of the linearity index of Atkeson & Hollerbach 1985
    (doi:10.1523/JNEUROSCI.05-09-02318.1985).

    Args:
        hand: (n, T + 1, 2) (m).
        target: (n, 2) (m).
        near: judge the path until it comes so near to the target (m); None for all of it.
    """
    reach = _reach(hand, target, near)
    return np.asarray(np.abs(_cross(reach.straight[:, None], reach.offset)).max(axis=1) / reach.distance)


def initial_direction(hand: ArrayLike, target: ArrayLike, near: float | None = None) -> Float64:
    """(n,): angle from start to target to start to hand, at the end of the fastest step (rad), in [-π, π].

    It is positive where the hand goes to the left of the straight way, counterclockwise. The direction at peak speed,
    as in Krakauer et al. 2000 (doi:10.1523/JNEUROSCI.20-23-08916.2000). At peak acceleration, the other common choice,
    these arms have mostly moved by less than a centimeter. NaN where the trial starts on its target, or the hand is at
    its start by then.

    Args:
        hand: (n, T + 1, 2) (m).
        target: (n, 2) (m).
        near: look for the fastest step until the hand comes so near to the target (m); None for the whole trial.
    """
    reach = _reach(hand, target, near)
    fastest = hand_speed(reach.path, 1.0).argmax(axis=1)
    moved = reach.offset[np.arange(len(fastest)), fastest + 1]
    angle = np.arctan2(_cross(reach.straight, moved), (reach.straight * moved).sum(axis=1))
    meant = (reach.distance >= SAME_PLACE) & (np.linalg.norm(moved, axis=1) >= SAME_PLACE)
    return np.where(meant, angle, np.nan)


def initial_direction_error(hand: ArrayLike, target: ArrayLike, near: float | None = None) -> Float64:
    """(n,): size of :func:`initial_direction` (rad), in [0, π]."""
    return np.abs(initial_direction(hand, target, near))


def extent(hand: ArrayLike, target: ArrayLike) -> Float64:
    """(n,): how far the hand ever gets along the line from start to target, as a share of the target's distance.

    Less than 1 is an undershoot, which looks straighter than the reach that it is a part of. NaN where the trial starts
    on its target.
    """
    reach = _reach(hand, target)
    along = np.einsum("nti,ni->nt", reach.offset, reach.straight)
    return np.asarray(along.max(axis=1) / reach.distance**2)


def peak_speed(hand: ArrayLike, timestep: float) -> Float64:
    """(n,): speed of the hand in its fastest step (m/s)."""
    return np.asarray(hand_speed(hand, timestep).max(axis=1))


def time_to_peak_speed(hand: ArrayLike, timestep: float) -> Float64:
    """(n,): from the trial's start to the middle of the (first) fastest step (s); NaN where the hand never moves."""
    speed = hand_speed(hand, timestep)
    return np.where(speed.max(axis=1) > 0, (speed.argmax(axis=1) + 0.5) * timestep, np.nan)


def end_point_errors(hand: ArrayLike, target: ArrayLike) -> Float64:
    """(n, 2): from the target to the hand after the last step (m)."""
    return _float(hand)[:, -1] - _float(target)


def end_point_variability(hand: ArrayLike, target: ArrayLike) -> float:
    """Dispersion of the end-point errors (m): root mean squared distance from their mean.

    What an error common to all trials leaves over: with it, the mean squared final error is the squared length of the
    mean error plus the squared dispersion. Trials with a NaN are left out; NaN for fewer than two. The bivariate
    variable error of Hancock, Butler & Fischman 1995 (doi:10.1080/00222895.1995.9941714).
    """
    errors = end_point_errors(hand, target)
    errors = errors[~np.isnan(errors).any(axis=1)]
    if len(errors) < 2:
        return float("nan")
    return float(np.sqrt(((errors - errors.mean(axis=0)) ** 2).sum(axis=1).mean()))


def rms_error(hand: ArrayLike, target: ArrayLike) -> Float64:
    """(n,): root mean squared distance from hand to target after each step, from the first to the last (m)."""
    squared = ((_float(hand)[:, 1:] - _float(target)[:, None]) ** 2).sum(axis=2)
    return np.asarray(np.sqrt(squared.mean(axis=1)))


def drift(hand: ArrayLike) -> Float64:
    """(n,): distance between the hand's mean positions in the first and in the last fifth of the moments (m).

    What shook the hand in between does not count, nor does how it came there: the slow part of an error in holding, as
    the drift of an unseen hand is measured (Brown, Rosenbaum & Sainburg 2003, doi:10.1152/jn.00013.2003).
    """
    path = _float(hand)
    fifth = max(path.shape[1] // 5, 1)
    return np.asarray(np.linalg.norm(path[:, -fifth:].mean(axis=1) - path[:, :fifth].mean(axis=1), axis=1))


def mean_speed(hand: ArrayLike, timestep: float) -> Float64:
    """(n,): mean speed of the hand over all steps (m/s); in a hold, the posture speed of Coderre et al. 2010."""
    return np.asarray(hand_speed(hand, timestep).mean(axis=1))


def effort(excitation: ArrayLike, timestep: float) -> Float64:
    """(n,): ∫ Σ u² dt over the muscles' excitations u (n, T, 6), held during each step (s).

    Criterion Σ (force / maximal force)² of Pedotti, Krishnan & Stark 1978 (doi:10.1016/0025-5564(78)90018-4), the
    excitation standing for the share of its maximal force that a muscle is asked for.
    """
    return np.asarray((_float(excitation) ** 2).sum(axis=(1, 2)) * timestep)


def force_effort(excitation: ArrayLike, max_force: ArrayLike, timestep: float) -> Float64:
    """(n,): :func:`effort` of excitations scaled by maximal force over the muscles' mean maximal force (s).

    Criterion Σ force² of the same source, in units in which six equal muscles give :func:`effort`: a strong muscle
    costs more than a weak one.

    Args:
        excitation: (n, T, 6), in [0, 1].
        max_force: (6,), maximal isometric forces (N).
        timestep: s.
    """
    force = _float(max_force)
    return effort(_float(excitation) * force / force.mean(), timestep)


class _Reach(NamedTuple):
    """What lies between start and target."""

    path: Float64
    """(n, T + 1, 2), the hand, as far as it is judged (m)."""
    offset: Float64
    """(n, T + 1, 2), from the start to the hand (m)."""
    straight: Float64
    """(n, 2), from the start to the target (m)."""
    distance: Float64
    """(n,), its length (m); NaN where start and target are one place."""


def _reach(hand: ArrayLike, target: ArrayLike, near: float | None = None) -> _Reach:
    path = _float(hand) if near is None else until_near(hand, target, near)
    straight = _float(target) - path[:, 0]
    distance = np.linalg.norm(straight, axis=1)
    return _Reach(path, path - path[:, :1], straight, np.where(distance >= SAME_PLACE, distance, np.nan))


def _cross(a: Float64, b: Float64) -> Float64:
    """Third component of the cross product of vectors in the plane, in the last axis."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _float(values: ArrayLike) -> Float64:
    return np.asarray(values, dtype=np.float64)
