"""Forces on the hand that depend on its motion are refused where the time step alone would make the hand swing.

The arm is stepped by Euler's explicit method, which feeds energy into whatever swings. With the hand's mobility W, the
inverse of its apparent mass, a field B v − K x makes the hand's deviation follow d/dt (x, v) = A (x, v), with
A = [[0, 1], [−W K, W B]]. A step multiplies by 1 + A dt where time itself multiplies by exp(A dt): the growth that is
the method's own is |1 + λ dt| over max(1, |exp(λ dt)|), λ an eigenvalue of A. Muscles are left out.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bilateral_rl.envs.arm.parameters import ArmParameters
from bilateral_rl.envs.task import HandForces, Spring

Float64 = NDArray[np.float64]

MOST_GROWTH = 1.02
"""What a field's swings may grow by in a step through the method alone; seven times in a hundred steps."""
_POSTURES = 9
"""Of each joint, spread over its range."""


def check_stability(forces: HandForces, arm: ArmParameters) -> None:
    """Refuse forces under which the hand swings, wherever in the workspace; fields and walls each by themselves.

    Args:
        forces: of n trials, as :func:`~bilateral_rl.envs.doors.checked_trials` returns them, or of one row.
        arm: physical constants, of which the time step is one.

    Raises:
        ValueError: a field whose swings the time step lets grow, or walls that do not settle; it names the bound.
    """
    shapes = {"velocity_gain": 4, "position_gain": 4, "walls": 2}
    fields = [np.asarray(getattr(forces, name), dtype=np.float64).reshape(-1, k) for name, k in shapes.items()]
    if all((field == field[:1]).all() for field in fields):  # all trials alike, as in most experiments
        fields = [field[:1] for field in fields]
    *gains, walls = fields
    _check_walls(walls, arm)
    velocity, position = (np.linalg.norm(gain, axis=1) for gain in gains)
    # An eigenvalue λ of A is at most r, as |λ|² <= w (|B| |λ| + |K|), and |1 + z| <= |exp z| + |z|² exp|z| / 2.
    most = _highest_mobility(arm)
    r = arm.timestep * most * (velocity + np.sqrt(velocity**2 + 4 * position / most)) / 2
    doubtful = r > 0.15  # where 1 + r² exp(r) / 2 is still below ``MOST_GROWTH``
    rows = np.concatenate(gains, axis=1)[doubtful]
    for row in map(_numbers, set(rows.view(np.dtype((np.void, 64))).ravel().tolist())):  # few differ
        if (growth := _growth(row, arm)) > MOST_GROWTH:
            raise ValueError(
                f"{_named(row)} makes the hand swing {growth:.4g} times as wide every step through the time step of "
                f"{arm.timestep:g} s alone, where {MOST_GROWTH:g} is the most: take smaller gains, more damping or a "
                "shorter timestep."
            )


def check_spring(spring: Spring, arm: ArmParameters) -> None:
    """Refuse a spring between the hands of two such arms that swings, wherever their hands are.

    It acts on the motion of the hands relative to each other, for which their mobilities add. Of all postures the worst
    is that in which both hands are lightest, along the same line: along it, the motion follows
    d² z / dt² = −w (k z + c dz / dt), and the method's growth rises with w.

    Raises:
        ValueError: a spring whose swings the time step lets grow.
    """
    most = 2 * _highest_mobility(arm)
    for stiffness, damping in {*zip(spring.stiffness.tolist(), spring.damping.tolist(), strict=True)}:
        z = np.roots([1.0, most * damping, most * stiffness]) * arm.timestep
        if (growth := _own_growth(z)) > MOST_GROWTH:
            remedy = "less" if damping > stiffness * arm.timestep else "a softer spring, more"
            raise ValueError(
                f"a spring of {stiffness:g} N/m with a damper of {damping:g} N·s/m makes the hands swing {growth:.4g} "
                f"times as wide every step through the time step of {arm.timestep:g} s alone, where {MOST_GROWTH:g} is "
                f"the most: take {remedy} damping or a shorter timestep."
            )


def mobility(angles: NDArray[Any], arm: ArmParameters) -> Float64:
    """Return W (…, 2, 2) (1/kg), the hand's acceleration by the force on it, at rest at postures (…, 2) (rad).

    It is J I⁻¹ Jᵀ, of the joints' inertia I and the hand's Jacobian J, the inverse of its apparent mass (Hogan 1985,
    doi:10.1007/BF00355754).
    """
    shoulder, elbow = np.moveaxis(np.asarray(angles, dtype=np.float64), -1, 0)
    (upper, fore), mass, center, inertia = arm.link_length, arm.link_mass, arm.link_center_of_mass, arm.link_inertia
    second = mass[1] * center[1] ** 2 + inertia[1] + 0 * elbow
    coupling = mass[1] * upper * center[1] * np.cos(elbow)
    first = mass[0] * center[0] ** 2 + inertia[0] + mass[1] * upper**2 + second + 2 * coupling
    joints = _stack([[first, second + coupling], [second + coupling, second]])
    fore_x, fore_y = fore * np.cos(shoulder + elbow), fore * np.sin(shoulder + elbow)
    x, y = upper * np.cos(shoulder) + fore_x, upper * np.sin(shoulder) + fore_y
    jacobian = _stack([[-y, -fore_y], [x, fore_x]])
    return np.asarray(jacobian @ np.linalg.solve(joints, np.swapaxes(jacobian, -1, -2)))


def _check_walls(walls: Float64, arm: ArmParameters) -> None:
    """Refuse walls across which a hand of the smallest apparent mass m swings, or one of any mass does not settle.

    Across the channel, z = λ dt solves z² + (d dt / m) z + k dt² / m = 0, and |1 + z| < 1 asks for d > k dt and
    d < 2 m / dt + k dt / 2.
    """
    stiffness, damping = walls.T
    least = stiffness * arm.timestep
    most = 2 / (arm.timestep * _highest_mobility(arm)) + least / 2
    unstable = (damping < least) | (damping > most) | (least > most)
    if unstable.any():
        i = int(unstable.argmax())
        raise ValueError(
            f"walls of {stiffness[i]:g} N/m and {damping[i]:g} N·s/m make the hand swing with a timestep of "
            f"{arm.timestep:g} s: their damping must lie between {least[i]:.4g} and {most[i]:.4g} N·s/m"
            f"{', which a lower stiffness can meet' if least[i] > most[i] else ''}."
        )


@functools.lru_cache(maxsize=64)
def _mobilities(arm: ArmParameters) -> Float64:
    """Return the mobilities (postures, 2, 2) all over the joints' range."""
    lower, upper = arm.joint_lower_limit, arm.joint_upper_limit
    axes = [np.linspace(lower[i], upper[i], _POSTURES) for i in range(2)]
    return mobility(np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2), arm)


@functools.lru_cache(maxsize=64)
def _highest_mobility(arm: ArmParameters) -> float:
    """Return the inverse of the smallest apparent mass (1/kg)."""
    return float(np.linalg.eigvalsh(_mobilities(arm)).max())


@functools.lru_cache(maxsize=10_000)
def _growth(gains: tuple[float, ...], arm: ArmParameters) -> float:
    """Return the method's own growth a step under B and K, eight numbers, in the worst posture."""
    velocity_gain, position_gain = np.array(gains).reshape(2, 2, 2)
    w = _mobilities(arm)
    a = np.zeros((len(w), 4, 4))
    a[:, :2, 2:] = np.eye(2)
    a[:, 2:, :2], a[:, 2:, 2:] = -w @ position_gain, w @ velocity_gain
    return _own_growth(np.linalg.eigvals(a) * arm.timestep)


def _own_growth(z: NDArray[Any]) -> float:
    """Return the greatest growth of Euler's method at any of ``z`` = λ dt beyond that of the motion itself."""
    return float((np.abs(1 + z) / np.exp(np.clip(z.real, 0, 700))).max())


def _stack(rows: list[list[Any]]) -> Float64:
    """Return (…, 2, 2) of entries (…)."""
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def _numbers(row: bytes) -> tuple[float, ...]:
    return tuple(np.frombuffer(row).tolist())


def _named(row: tuple[float, ...]) -> str:
    """Return the gains of a field that are not 0, in words."""
    gains = {"a velocity field of {} N·s/m": row[:4], "an elastic field of {} N/m": row[4:]}
    matrix = "[[{:g}, {:g}], [{:g}, {:g}]]"
    shown = {words: matrix.format(*(e + 0.0 for e in gain)) for words, gain in gains.items() if any(gain)}
    return " with ".join(words.format(gain) for words, gain in shown.items())
