"""What a hand does before a cue, and how it answers one, a jump of its target, or a pulse; trial by trial.

Arrays are as in :mod:`~bilateral_rl.analysis.kinematics`; ``go``, ``jump`` and ``first`` (n,) are the steps at which a
cue, a jump or a pulse comes. A trial in which it does not come within the ``T`` steps, or that has nothing to measure,
gets NaN.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bilateral_rl.analysis.kinematics import SAME_PLACE, hand_speed
from bilateral_rl.analysis.samples import Float64

ONSET_SHARE = 0.05
"""Share of its peak above which a speed counts as a movement: a threshold as Botzer & Karniel 2009
(doi:10.3389/neuro.20.002.2009) review them; the share is ours."""


def reaction_time(hand: ArrayLike, go: ArrayLike, timestep: float) -> Float64:
    """(n,): from the cue to the first step whose hand speed exceeds ``ONSET_SHARE`` of the highest from the cue on (s).

    NaN where the hand rests after the cue.
    """
    speed = hand_speed(hand, timestep)
    return _first_above(speed, np.asarray(go), timestep)


def hold_error(distance: ArrayLike, go: ArrayLike) -> Float64:
    """(n,): mean distance from hand to start over the steps before the cue (m); all of them where none comes."""
    return _mean_before(np.asarray(distance, dtype=np.float64), np.asarray(go))


def hold_speed(hand: ArrayLike, go: ArrayLike, timestep: float) -> Float64:
    """(n,): mean speed of the hand over the steps before the cue (m/s); all of them where none comes."""
    return _mean_before(hand_speed(hand, timestep), np.asarray(go))


def premature_movement(hand: ArrayLike, go: ArrayLike) -> Float64:
    """(n,): how far from its start the hand gets before the cue (m), or in the whole trial where none comes."""
    path = np.asarray(hand, dtype=np.float64)
    away = np.linalg.norm(path[:, 1:] - path[:, :1], axis=2)
    before = _before(np.asarray(go), away.shape[1])
    return np.where(before.any(axis=1), np.where(before, away, 0.0).max(axis=1), np.nan)


def jump_latency(hand: ArrayLike, jump: ArrayLike, shift: ArrayLike, timestep: float) -> Float64:
    """(n,): from the jump to the first step in which the hand has begun to follow it (s).

    That is when its velocity along the jump exceeds what it was in the step before by ``ONSET_SHARE`` of the largest
    such excess that comes. How thresholds bear on latencies: Oostwoud Wijdenes, Brenner & Smeets 2014
    (doi:10.3758/s13428-013-0349-7). NaN where the hand never follows.

    Args:
        hand: (n, T + 1, 2) (m).
        jump: (n,).
        shift: (n, 2), from the goal to where it jumps (m).
        timestep: s.
    """
    path, shift, jump = np.asarray(hand, dtype=np.float64), np.asarray(shift, dtype=np.float64), np.asarray(jump)
    length = np.linalg.norm(shift, axis=1, keepdims=True)
    along = np.divide(shift, length, out=np.zeros_like(shift), where=length >= SAME_PLACE)
    velocity = np.einsum("nti,ni->nt", np.diff(path, axis=1), along) / timestep
    steps = velocity.shape[1]
    last = np.clip(jump - 1, 0, steps - 1)
    before = np.where(jump > 0, velocity[np.arange(len(velocity)), last], 0.0)
    return _first_above(velocity - before[:, None], jump, timestep)


def pulse_deviation(hand: ArrayLike, goal: ArrayLike, first: ArrayLike) -> Float64:
    """(n,): largest distance of the hand, from the pulse on, from where it belongs (m).

    That is the line through start and goal in a reach, and the goal in a hold.
    """
    away, moments = _away(hand, goal), np.asarray(first)[:, None]
    after = np.arange(1, away.shape[1] + 1) > moments
    return np.where(after.any(axis=1), np.where(after, away, 0.0).max(axis=1), np.nan)


def pulse_latency(hand: ArrayLike, force: ArrayLike, first: ArrayLike, timestep: float) -> Float64:
    """(n,): from the pulse's first step until the hand stops to go along with it (s).

    The hand's velocity along the pulse, less what it was in the step before it, is positive at first; the latency ends
    with the first step after that in which it is not. NaN where it never is, or stays so to the end.

    Args:
        hand: (n, T + 1, 2) (m).
        force: (n, 2), the pulse (N).
        first: (n,).
        timestep: s.
    """
    path, push, first = np.asarray(hand, dtype=np.float64), np.asarray(force, dtype=np.float64), np.asarray(first)
    velocity = np.einsum("nti,ni->nt", np.diff(path, axis=1), push)
    n, steps = velocity.shape
    before = np.where(first > 0, velocity[np.arange(n), np.clip(first - 1, 0, steps - 1)], 0.0)
    excess, step = velocity - before[:, None], np.arange(steps)
    pushed = (step >= first[:, None]) & (excess > 0)
    begun = np.where(pushed.any(axis=1), pushed.argmax(axis=1), steps)
    turned = (step > begun[:, None]) & (excess <= 0)
    return np.where(turned.any(axis=1), (turned.argmax(axis=1) - first) * timestep, np.nan)


def return_time(distance: ArrayLike, first: ArrayLike, radius: float, timestep: float) -> Float64:
    """(n,): from step ``first`` to the end of the last step after which the hand is outside the goal (s).

    0 where it is never outside from then on; all the time there is where it is outside at the end.

    Args:
        distance: (n, T), hand to target after each step (m).
        first: (n,), step of the jump, or first step of the pulse.
        radius: of the goal (m).
        timestep: s.
    """
    outside, first = np.asarray(distance, dtype=np.float64) > radius, np.asarray(first)
    steps = outside.shape[1]
    outside = outside & (np.arange(steps) >= first[:, None])
    end = np.where(outside.any(axis=1), steps - outside[:, ::-1].argmax(axis=1), first)
    return np.where(first < steps, (end - first) * timestep, np.nan)


def _before(go: NDArray[np.integer], steps: int) -> NDArray[np.bool_]:
    """(n, T): which steps come before the cue."""
    return np.asarray(np.arange(steps) < go[:, None])


def _mean_before(values: Float64, go: NDArray[np.integer]) -> Float64:
    before = _before(go, values.shape[1])
    count = before.sum(axis=1)
    total = np.where(before, values, 0.0).sum(axis=1)
    return np.asarray(np.divide(total, count, out=np.full(len(values), np.nan), where=count > 0))


def _first_above(values: Float64, begin: NDArray[np.integer], timestep: float) -> Float64:
    """(n,): from ``begin`` to the first step above ``ONSET_SHARE`` of the largest of (n, T) values from then on (s)."""
    from_then_on = np.arange(values.shape[1]) >= begin[:, None]
    peak = np.where(from_then_on, values, 0.0).max(axis=1, keepdims=True)
    above = from_then_on & (values > ONSET_SHARE * peak) & (peak > 0)
    return np.where(above.any(axis=1), (above.argmax(axis=1) - begin) * timestep, np.nan)


def _away(hand: ArrayLike, goal: ArrayLike) -> Float64:
    """(n, T): after each step, distance from the line through start and goal, or from the goal where they are one."""
    path = np.asarray(hand, dtype=np.float64)
    straight = np.asarray(goal, dtype=np.float64) - path[:, 0]
    offset = path[:, 1:] - path[:, :1]
    distance = np.linalg.norm(straight, axis=1)
    across = np.abs(straight[:, :1] * offset[..., 1] - straight[:, 1:] * offset[..., 0])
    from_line = np.divide(across, distance[:, None], out=np.zeros_like(across), where=distance[:, None] > 0)
    from_goal = np.linalg.norm(offset - straight[:, None], axis=2)
    return np.asarray(np.where((distance >= SAME_PLACE)[:, None], from_line, from_goal))
