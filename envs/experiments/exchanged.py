"""Trials of two arms: joined from those of each, and exchanged between them, mirrored about the body's midline."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from bilateral_rl.envs.task import HandForces, Trials

T = TypeVar("T")
_MIRROR = np.array([-1.0, 1.0])


def of_both_arms(dominant: Trials, non_dominant: Trials) -> Trials:
    """Return trials (n, 2, …) of both arms, of those (n, …) of each."""
    return _each(lambda *of_arms: np.stack(of_arms, axis=1), dominant, non_dominant)


def exchanged(trials: Trials, where: NDArray[np.bool_]) -> Trials:
    """Return trials (n, 2, …) of which in those of ``where`` (n,) each arm does what the other one did, mirrored.

    A spring is the same both ways.
    """
    if not where.any():
        return trials
    spring, trials = trials.spring, trials._replace(spring=None)
    other = _each(lambda of_arms: of_arms[:, ::-1], trials)
    other = other._replace(load=mirrored_vectors(other.load))
    if other.forces is not None:
        other = other._replace(forces=mirrored_forces(other.forces))

    def chosen(mine: NDArray[Any], others: NDArray[Any]) -> NDArray[Any]:
        return np.where(where.reshape(-1, *[1] * (mine.ndim - 1)), others, mine)

    return _each(chosen, trials, other)._replace(spring=spring)


def mirrored_forces(forces: HandForces) -> HandForces:
    """Return forces (…) mirrored about x = 0: a curl field then turns the other way."""
    return forces._replace(
        velocity_gain=mirrored_gains(forces.velocity_gain),
        position_gain=mirrored_gains(forces.position_gain),
        center=mirrored_vectors(forces.center),
        pulse=mirrored_vectors(forces.pulse),
    )


def mirrored_vectors(vectors: NDArray[Any]) -> NDArray[Any]:
    """Return vectors or positions (…, 2) mirrored about x = 0."""
    return np.asarray(vectors * _MIRROR, dtype=vectors.dtype)


def mirrored_gains(gains: NDArray[Any]) -> NDArray[Any]:
    """Return matrices G (…, 2, 2) of forces G v mirrored about x = 0, M G M."""
    return np.asarray(gains * _MIRROR[:, None] * _MIRROR, dtype=gains.dtype)


def _each(function: Callable[..., NDArray[Any]], *trials: T) -> T:
    """Return what a function makes of each field of one or several trials; what is None stays so."""
    first: Any = trials[0]
    fields = [
        None if fields[0] is None else _each(function, *fields) if isinstance(fields[0], tuple) else function(*fields)
        for fields in zip(*trials, strict=True)
    ]
    made: T = type(first)(*fields)
    return made
