"""Why a training cannot go on: numbers from the environment that are not finite, or a policy that has diverged."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor


class DivergedError(ValueError):
    """A policy, its critics or what they come to are no longer made of finite numbers."""


def check_observations(observations: NDArray[Any], step: int, envs: Iterable[int] | None = None) -> None:
    """Refuse observations that are not finite.

    Args:
        observations: (n, …).
        step: steps of the training so far, over all environments.
        envs: numbers of the ``n`` environments; None for all, in their order.

    Raises:
        ValueError: numbers that are not finite; the sentence names the first such environment.
    """
    if observations.dtype.kind != "f" or _is_finite(observations):
        return
    flat = observations.reshape(len(observations), -1)
    row, column = np.argwhere(~np.isfinite(flat))[0].tolist()
    number = row if envs is None else list(envs)[row]
    raise ValueError(
        f"environment {number} gave an observation that is not finite at step {step}: its number {column} is "
        f"{flat[row, column]}."
    )


def check_policy(parameters: Iterable[Tensor], step: int) -> None:
    """Refuse parameters that are not finite.

    Raises:
        DivergedError: a parameter that is not finite.
    """
    numbers = torch.cat([parameter.detach().ravel() for parameter in parameters])
    # The sum of what is not finite is not; the sum of finite numbers nearly always is, and is a third of the work.
    if not math.isfinite(numbers.sum()) and not numbers.isfinite().all():
        raise DivergedError(
            f"the policy diverged after {step} steps: its parameters are no longer finite numbers; try a smaller "
            "learning_rate or reward_scale."
        )


def check_actions(actions: NDArray[np.floating[Any]], parameters: Iterable[Tensor], step: int) -> None:
    """Refuse actions (n, …) that are not finite, of a policy with these parameters.

    Raises:
        DivergedError: an action that is not finite.
    """
    if _is_finite(actions):
        return
    check_policy(parameters, step)
    raise DivergedError(
        f"the policy diverged after {step} steps: its actions are not finite, as its parameters have grown too large; "
        "try a smaller learning_rate or reward_scale."
    )


def _is_finite(numbers: NDArray[np.floating[Any]]) -> bool:
    # Of all ways to know, that with the fewest calls. Squares of finite numbers may overflow.
    return math.isfinite(np.vdot(numbers, numbers)) or bool(np.isfinite(numbers).all())
