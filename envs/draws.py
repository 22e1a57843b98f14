"""Postures and loads from uniform numbers, and springs, as tasks of one arm and of two have them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bilateral_rl.envs.task import Spring

if TYPE_CHECKING:
    from bilateral_rl.envs.settings import TrialSettings

Float32 = NDArray[np.float32]


def uniform_postures(uniform: NDArray[np.float64], settings: TrialSettings) -> Float32:
    """Return postures (…, 2), uniform over the joint range (rad), from uniform numbers (…, 2)."""
    lower, upper = np.array(settings.arm.joint_lower_limit), np.array(settings.arm.joint_upper_limit)
    return np.asarray(lower + uniform * (upper - lower), dtype=np.float32)


def draw_loads(uniform: NDArray[np.float64], settings: TrialSettings) -> Float32:
    """Return loads (…, 2) on the hand (N), drawn as ``settings.load`` says from uniform numbers (…, 2).

    The text says "random direction, random bounded intensity": we read it as a size that is uniform itself, rather than
    a load uniform over the disk, of which most would be near the bound.
    """
    if settings.load == "axes":
        return np.asarray((2 * uniform - 1) * settings.max_load, dtype=np.float32)
    angle, size = 2 * np.pi * uniform[..., 0], settings.max_load * uniform[..., 1]
    return np.asarray(size[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1), dtype=np.float32)


def springs(n: int, settings: TrialSettings) -> Spring:
    """Return the spring of the settings for each of ``n`` trials of two arms."""
    spring = settings.two_arms.spring
    return Spring(np.full(n, spring.stiffness, dtype=np.float32), np.full(n, spring.damping, dtype=np.float32))
