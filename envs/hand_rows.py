"""Trials of two arms as kernels take them: a row for each hand, in the frame of its own arm."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bilateral_rl.envs.body_frame import in_arm_frames, vectors_between_frames
from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.envs.task import HandForces, Timeline, Trials

_MIRRORED = np.array([[[1.0, 1.0], [1.0, 1.0]], [[1.0, -1.0], [-1.0, 1.0]]])
"""What each arm's matrices B of the frame of the body are multiplied by, element by element, to act in its own: for the
non-dominant arm this is M B M with M = diag(−1, 1), under which a curl field changes its handedness."""


def hand_rows(trials: Trials, settings: TrialSettings) -> Trials:
    """Return checked trials (n, 2 arms, …) of the frame of the body as hands (2n, …), in their own arms' frames.

    Row 2i + a is arm a of trial i. Angles are each arm's own already, and the spring stays (n,).
    """
    timeline, forces = trials.timeline, trials.forces
    return Trials(
        start=_rows(trials.start),
        goal=_rows(trials.goal),
        load=_rows(vectors_between_frames(trials.load)),
        timeline=None if timeline is None else Timeline(*map(_rows_alike, timeline)),
        forces=None if forces is None else _forces(forces, settings.two_arms.shoulder_distance),
        spring=trials.spring,
    )


def _forces(forces: HandForces, shoulder_distance: float) -> HandForces:
    return HandForces(
        velocity_gain=_rows(forces.velocity_gain * _MIRRORED),
        position_gain=_rows(forces.position_gain * _MIRRORED),
        center=_rows(in_arm_frames(forces.center, shoulder_distance)),
        pulse=_rows(vectors_between_frames(forces.pulse)),
        pulse_window=_rows_alike(forces.pulse_window),
        walls=_rows(forces.walls),
    )


def _rows_alike(array: NDArray[Any]) -> NDArray[Any]:
    """Return (n, 2, …) as (2n, …)."""
    return array.reshape(-1, *array.shape[2:])


def _rows(array: NDArray[Any]) -> NDArray[np.float32]:
    return np.asarray(_rows_alike(array), dtype=np.float32)
