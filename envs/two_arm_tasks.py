"""The tasks of both arms: two reaches, two holds, and one hand that reaches while the other one, tied to it, holds."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bilateral_rl.envs.arm.parameters import ArmParameters
from bilateral_rl.envs.draws import draw_loads, springs, uniform_postures
from bilateral_rl.envs.kinematics import hand_position, inverse_kinematics, is_in_workspace
from bilateral_rl.envs.stability import check_spring
from bilateral_rl.envs.task import Task, Trials
from bilateral_rl.envs.task_specs import TASK_SPECS

if TYPE_CHECKING:
    from bilateral_rl.envs.settings import TrialSettings

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]

FROM_MIDLINE, IN_FRONT = 0.05, 0.10
"""How far on its own side of the body's midline and in front of the shoulders a hand starts at least, in
``reach_and_hold`` (m): of postures uniform over the joints' range a third would cross the hands."""
_DIRECTIONS = 72
"""Directions of a reach, of which one that stays in the arm's workspace is chosen."""
_ANGLES = 2 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
_WAYS = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)], axis=-1)
_SPREAD = np.arange(_DIRECTIONS) * 29 % _DIRECTIONS
"""The directions in an order in which each is far from those before it."""
_CELLS = 256
"""Parts that each joint's range is cut into, so that starts are drawn from an area without trying again."""


class _TwoArmTask(Task):
    """A task of both arms, with the spring between their hands that the settings say."""

    n_arms = 2

    def is_symmetric(self, settings: TrialSettings) -> bool:
        return not self.has_roles or settings.two_arms.roles == "drawn"

    def check(self, settings: TrialSettings) -> None:
        check_spring(springs(1, settings), settings.arm)


class TwoReaches(_TwoArmTask):
    """Reach with both hands, each from one random posture to the hand position of another."""

    id = "two_reaches"
    has_load = False
    n_uniform = 8

    def trials(self, uniform: Float64, settings: TrialSettings) -> Trials:
        n = len(uniform)
        postures = uniform_postures(uniform.reshape(n, 2, 2, 2), settings)  # trial, arm, start or goal, joint
        no_load = np.zeros((n, 2, 2), dtype=np.float32)
        return Trials(postures[:, :, 0], postures[:, :, 1], no_load, spring=springs(n, settings))


class TwoHolds(_TwoArmTask):
    """Keep both hands where they start, each against a load of its own, drawn as ``settings.load`` says."""

    id = "two_holds"
    n_uniform = 8
    judged_by = "time_in_goal"

    def trials(self, uniform: Float64, settings: TrialSettings) -> Trials:
        n = len(uniform)
        parts = uniform.reshape(n, 2, 2, 2)  # trial, arm, posture or load, joint or axis
        start = uniform_postures(parts[:, :, 0], settings)
        return Trials(start, start, draw_loads(parts[:, :, 1], settings), spring=springs(n, settings))


class ReachAndHold(_TwoArmTask):
    """Reach with one hand while the other keeps its place, tied to it by a spring (Woytowicz, Westlake, Whitall &
    Sainburg 2018, doi:10.1152/jn.00878.2017, "bread cutting").

    Both hands start anywhere on their own side, not nearer than 5 cm to the midline, and 10 cm in front of the
    shoulders or farther. The target of the hand that reaches lies within ``settings.two_arms.reach`` of its start, in a
    direction that its arm can follow, one of 72.
    """

    id = "reach_and_hold"
    has_load = False
    has_roles = True
    n_uniform = 7
    trial = TASK_SPECS["reach_and_hold"].trial

    def trials(self, uniform: Float64, settings: TrialSettings) -> Trials:
        n, arm, every = len(uniform), settings.arm, np.arange(len(uniform))
        starts, role, distance, direction = np.split(uniform, [4, 5, 6], axis=1)
        start = _apart_postures(starts.reshape(n, 2, 2), settings)
        reaching = _reaching_arm(role[:, 0], settings)
        least, most = settings.two_arms.reach
        length = least + distance[:, 0] * (most - least)
        targets = _targets(hand_position(start[every, reaching], arm), length)
        possible = is_in_workspace(targets, arm)
        nth = (direction[:, 0] * possible.sum(axis=1)).astype(np.intp)
        chosen = (possible.cumsum(axis=1) > nth[:, None]).argmax(axis=1)
        goal = start.copy()
        goal[every, reaching] = inverse_kinematics(targets[every, chosen], arm)
        return Trials(start, goal, np.zeros((n, 2, 2), dtype=np.float32), spring=springs(n, settings))

    def check(self, settings: TrialSettings) -> None:
        super().check(settings)
        _check_targets(settings.arm, settings.two_arms.shoulder_distance, settings.two_arms.reach)


def _reaching_arm(uniform: Float64, settings: TrialSettings) -> NDArray[np.intp]:
    """Return which arm reaches in each trial, (n,): 0, the dominant one, or 1."""
    roles = settings.two_arms.roles
    if roles == "drawn":
        return (uniform >= 0.5).astype(np.intp)
    return np.full(len(uniform), 0 if roles == "dominant_reaches" else 1)


def _apart_postures(uniform: Float64, settings: TrialSettings) -> Float32:
    """Return postures (…, 2) (rad) from uniform numbers (…, 2): uniform over those that keep the hands apart.

    A cell of the joints' range is chosen by the first number, a place in it by what is left of it and the second.
    """
    arm = settings.arm
    corners = _apart_cells(arm, settings.two_arms.shoulder_distance)
    scaled = uniform[..., 0] * len(corners)
    cell = scaled.astype(np.intp)
    within = np.stack([scaled - cell, uniform[..., 1]], axis=-1)
    return np.asarray(corners[cell] + within * _cell_size(arm), dtype=np.float32)


@functools.lru_cache(maxsize=16)
def _apart_cells(arm: ArmParameters, shoulder_distance: float) -> Float64:
    """Return the lower corners (k, 2) (rad) of those cells of the joints' range all of whose postures keep the hands
    apart.

    Raises:
        ValueError: there is none.
    """
    size = _cell_size(arm)
    steps = np.stack(np.meshgrid(np.arange(_CELLS), np.arange(_CELLS), indexing="ij"), axis=-1).reshape(-1, 2)
    corners = np.array(arm.joint_lower_limit) + steps * size
    x, y = hand_position(corners + size / 2, arm).T
    upper, fore = arm.link_length
    margin = size @ [upper + fore, fore] / 2  # no posture of a cell has the hand farther from where its middle has it
    apart = (x + shoulder_distance / 2 >= FROM_MIDLINE + margin) & (y >= IN_FRONT + margin)
    if not apart.any():
        raise ValueError(
            f"shoulders {shoulder_distance:g} m apart leave this arm no start with its hand {FROM_MIDLINE:g} m on its "
            f"own side of the midline and {IN_FRONT:g} m in front: take a larger two_arms.shoulder_distance."
        )
    return np.asarray(corners[apart])


def _cell_size(arm: ArmParameters) -> Float64:
    return np.asarray((np.array(arm.joint_upper_limit) - np.array(arm.joint_lower_limit)) / _CELLS)


def _targets(hand: Float64, length: Float64 | float) -> Float64:
    """Return positions (n, 72, 2) in every direction at distances (n,) from hands (n, 2) (m)."""
    return np.asarray(hand[:, None] + np.reshape(length, (-1, 1, 1)) * _WAYS)


@functools.lru_cache(maxsize=16)
def _check_targets(arm: ArmParameters, shoulder_distance: float, reach: tuple[float, float]) -> None:
    """Refuse reaches that are too long for an arm at some start.

    The corners of all cells stand for the starts in them, and three lengths for those between.

    Raises:
        ValueError: from there no direction stays in the arm's workspace.
    """
    hands = hand_position(_corners(arm, shoulder_distance), arm)
    for length in (reach[0], sum(reach) / 2, reach[1]):
        stuck = hands
        for way in _WAYS[_SPREAD]:  # a direction at a time, as few of them have a target for nearly all
            stuck = stuck[~is_in_workspace(stuck + length * way, arm)]
        if len(stuck):
            raise ValueError(f"two_arms.reach: from some starts this arm reaches no target {length:g} m away.")


def _corners(arm: ArmParameters, shoulder_distance: float) -> Float64:
    """Return all corners (k, 2) (rad) of the cells that starts are drawn from, each once."""
    lower, size = np.array(arm.joint_lower_limit), _cell_size(arm)
    nth = np.rint((_apart_cells(arm, shoulder_distance) - lower) / size).astype(np.intp)
    numbered = [(nth + corner) @ [_CELLS + 1, 1] for corner in ((0, 0), (0, 1), (1, 0), (1, 1))]
    return np.asarray(lower + np.stack(np.divmod(np.unique(numbered), _CELLS + 1), axis=-1) * size)
