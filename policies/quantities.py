"""What the numbers and switches of constructors may be, with errors that name them.

Numbers of NumPy and torch are as good as Python's: sizes come out of arrays, and seeds out of ``np.arange``.
"""

from __future__ import annotations

import contextlib
import math
import operator
from collections.abc import Iterable

import numpy as np


def whole(name: str, value: object, least: int = 1) -> int:
    """Return a whole number as Python's.

    Raises:
        ValueError: anything else, or a number below ``least``.
    """
    if not hasattr(value, "__index__") or isinstance(value, (bool, np.bool_)):
        raise ValueError(f"{name} must be a whole number, got {value!r}.")
    number = operator.index(value)
    if number < least:
        raise ValueError(f"{name} must be at least {least}, got {number}.")
    return number


def finite(name: str, value: object, least: float = -math.inf, most: float = math.inf, *, above: bool = False) -> float:
    """Return a finite number as Python's.

    Args:
        name: what the error calls it.
        value: as given.
        least: the smallest that it may be.
        most: the largest that it may be.
        above: whether it must be above ``least``, and not merely at least that.

    Raises:
        ValueError: anything else.
    """
    number = math.nan
    if hasattr(value, "__float__") and not isinstance(value, (bool, np.bool_)):
        with contextlib.suppress(TypeError, ValueError, RuntimeError):  # arrays of several numbers
            number = float(value)
    if not math.isfinite(number):
        raise ValueError(f"{name} must be a finite number, got {value!r}.")
    if number < least or (above and number == least):
        raise ValueError(f"{name} must be {'above' if above else 'at least'} {least:g}, got {number:g}.")
    if number > most:
        raise ValueError(f"{name} must be at most {most:g}, got {number:g}.")
    return number


def switch(name: str, value: object) -> bool:
    """Return True or False, also for 1 and 0.

    Raises:
        ValueError: anything else.
    """
    if isinstance(value, (bool, np.bool_)) or (isinstance(value, int) and value in (0, 1)):
        return bool(value)
    raise ValueError(f"{name} must be True or False, got {value!r}.")


def widths(name: str, value: object) -> tuple[int, ...]:
    """Return the units of each hidden layer.

    Raises:
        ValueError: no sequence of whole numbers of at least 1.
    """
    if isinstance(value, (str, bytes)) or not isinstance(value, Iterable):
        raise ValueError(f"{name} must be a sequence of units per hidden layer, such as (64, 64), got {value!r}.")
    return tuple(whole(f"each number of {name}", width) for width in value)
