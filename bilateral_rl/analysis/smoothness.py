"""How smooth a movement was, from its speed: spectral arc length and log dimensionless jerk.

Both are those of Balasubramanian, Melendez-Calderon, Roby-Brami & Burdet 2015 (doi:10.1186/s12984-015-0090-9), do not
change with the amplitude of a movement, and are the higher the smoother it is. Speeds are arrays whose last axis is
time, one value every ``timestep`` seconds; the other axes are trials, all of them measured at once.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from bilateral_rl.analysis.samples import Float64

MAX_CUTOFF = 10.0
"""Highest frequency that counts (Hz)."""
AMPLITUDE_THRESHOLD = 0.05
"""Share of the spectrum's maximum under which its tail does not count."""
PAD_LEVEL = 4
"""Powers of two by which zeros lengthen the movement, which refines the spectrum's grid."""


def sparc(speed: ArrayLike, timestep: float) -> Float64:
    """Spectral arc length of each trial, without unit.

    Minus the length of the speed's amplitude spectrum, its maximum set to 1 and its frequencies scaled to [0, 1], up
    to the last frequency of at most ``MAX_CUTOFF`` whose amplitude reaches ``AMPLITUDE_THRESHOLD``. NaN for a hand that
    never moves, and where nothing but frequency 0 counts.

    Args:
        speed: (..., T), at least 0 (m/s).
        timestep: length of a step (s).

    Returns:
        One value a trial, (...).
    """
    speed = np.asarray(speed, dtype=np.float64)
    length = 2 ** (math.ceil(math.log2(speed.shape[-1])) + PAD_LEVEL)
    frequency = np.fft.rfftfreq(length, timestep)
    frequency = frequency[frequency <= MAX_CUTOFF]  # (F,) Hz
    amplitude = _unit_peak(np.abs(np.fft.rfft(speed, length))[..., : len(frequency)])  # (..., F)
    # (..., 1): index of the last frequency that counts. Each trial's arcs, (..., F - 1), are summed up to there.
    last = np.where(amplitude >= AMPLITUDE_THRESHOLD, np.arange(len(frequency)), 0).max(axis=-1, keepdims=True)
    arcs = np.hypot(np.diff(frequency) / _nan_unless_positive(frequency[last]), np.diff(amplitude))
    arc_length = np.where(np.arange(len(frequency) - 1) < last, arcs, 0.0).sum(axis=-1)
    return np.where(last[..., 0] > 0, -arc_length, np.nan)


def ldlj(speed: ArrayLike, timestep: float) -> Float64:
    """Log dimensionless jerk of each trial, without unit.

    −ln(D³ / v_peak² · ∫ v̈² dt) with the trial's duration D and speed v, whose second derivative is a second
    difference: the jerk along the path, not of the turns. NaN for a hand that never moves, and where the speed has no
    second derivative but 0.

    Args:
        speed: (..., T), (m/s).
        timestep: length of a step (s).

    Returns:
        One value a trial, (...).
    """
    speed = np.asarray(speed, dtype=np.float64)
    duration = speed.shape[-1] * timestep
    jerk = np.diff(_unit_peak(speed), n=2) / timestep**2
    return np.asarray(-np.log(_nan_unless_positive(duration**3 * (jerk**2).sum(axis=-1) * timestep)))


def _unit_peak(values: Float64) -> Float64:
    """``values`` scaled to a maximum of 1 in the last axis; NaN where the maximum is 0."""
    return np.asarray(values / _nan_unless_positive(values.max(axis=-1, keepdims=True)))


def _nan_unless_positive(values: Float64) -> Float64:
    return np.where(values > 0, values, np.nan)
