"""What every figure in a given axis needs: the axis, and the one of several things that is to be drawn."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

from matplotlib.axes import Axes

from bilateral_rl.io.errors import UserError

T = TypeVar("T")


def axes_for(ax: Axes | None, size: tuple[float, float]) -> Axes:
    """Return the axis to draw into: the given one, or that of a new figure, which a notebook shows."""
    if ax is None:
        from matplotlib import pyplot  # chooses how to show figures, which is the caller's affair if there is an axis

        return pyplot.figure(figsize=size, layout="constrained").subplots()
    if not isinstance(ax, Axes):
        raise UserError(f"--ax must be one axis of matplotlib, such as axes[0], not {type(ax).__name__}.")
    return ax


def only(name: str, present: Sequence[T], chosen: T | None = None, where: str = "recording") -> T:
    """Return the one that is chosen, or the only one that there is. Raises UserError for anything else."""
    words = ", ".join(map(str, present))
    if chosen is None and len(present) > 1:
        raise UserError(f"There are several ({words}): say which by --{name}.")
    if chosen is not None and chosen not in present:
        raise UserError(f"There is no {name} {chosen} in this {where}; choose from {words}.")
    return present[0] if chosen is None else chosen
