"""Values of several seeds at one place of an axis: the seeds as dots, their mean, its confidence interval."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike, NDArray

from bilateral_rl.analysis.intervals import Interval, mean_interval
from bilateral_rl.figures.style import INK, TEXT_SIZE, ModelStyle
from bilateral_rl.io.text import seed_counts


def draw_seeds(
    axes: Axes,
    x: float,
    values: ArrayLike,
    style: ModelStyle,
    *,
    width: float,
    size: float = 6.5,
    filled: bool = True,
) -> Interval:
    """Draw one column: each seed as a dot beside the others, the mean as a marker, its 95 % interval as a bar.

    Args:
        axes: where to draw.
        x: middle of the column.
        values: (n,), one a seed; NaN is left out, and where nothing else is left, a dash says so.
        style: color of the dots and the mean, marker of the mean.
        width: width of the cloud of dots.
        size: size of the mean's marker (points).
        filled: whether that marker is filled or open.

    Returns:
        The mean and its interval.
    """
    heights = np.asarray(values, dtype=np.float64)
    mean = mean_interval(heights)
    if mean.n == 0:
        axes.text(x, 0.03, "–", transform=axes.get_xaxis_transform(), ha="center", size=1.3 * TEXT_SIZE, color="0.4")
        return mean
    positions = x + width * _offsets(len(heights))
    axes.plot(positions, heights, "o", color=style.color, alpha=0.45, markersize=2.8, markeredgewidth=0, gid="seeds")
    if mean.n > 1:
        axes.vlines(x, mean.low, mean.high, color=INK, linewidth=1.3, zorder=3, gid="interval")
    face, edge, edge_width = (style.color, INK, 0.7) if filled else ("white", style.color, 1.4)
    axes.plot(
        x, mean.value, style.marker, color=face, markeredgecolor=edge, markeredgewidth=edge_width, markersize=size,
        zorder=4, gid="mean",
    )  # fmt: skip
    return mean


def _offsets(n: int) -> NDArray[np.float64]:
    """Spread n dots over [-0.5, 0.5], (n,): none of several is in the middle, where the mean would hide it."""
    return np.linspace(-0.5, 0.5, n + n % 2)[:n] if n > 1 else np.zeros(n)


def marks_in_words(means: Iterable[Interval]) -> str:
    """Say what the marks of :func:`draw_seeds` mean, and how many seeds there are."""
    counts = [mean.n for mean in means if mean.n]
    if max(counts, default=0) < 2:
        return f"Markers: {seed_counts(counts)}."
    return f"Dots: seeds. Large markers and bars: mean of {seed_counts(counts)} and its 95 % confidence interval."
