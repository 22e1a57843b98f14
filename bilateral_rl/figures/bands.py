"""Many trials over time: a line for their mean, a band for their quartiles."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike, NDArray

from bilateral_rl.figures.style import ModelStyle

BANDS_NOTE = "Line: mean over trials. Band: their quartiles."


def draw_band(
    axes: Axes, time: ArrayLike, values: NDArray[np.floating], style: ModelStyle, label: str, index: int = 0
) -> None:
    """Draw mean and quartiles over trials, without NaN.

    Args:
        axes: where to draw.
        time: (T,), positions along the x axis.
        values: (n, T), a row a trial.
        style: look of the line; a broken line lies above others, so that these show in its gaps.
        label: name of the line in a legend.
        index: number of the line among those in ``axes``, so that its five markers stand beside theirs.
    """
    lower, upper = np.nanquantile(values, (0.25, 0.75), axis=0)
    axes.fill_between(time, lower, upper, color=style.color, alpha=0.15, linewidth=0)
    every = max(values.shape[1] // 5, 1)
    is_broken = style.line != "-"
    axes.plot(
        time, np.nanmean(values, axis=0), color=style.color, linestyle=style.line, linewidth=1.6, label=label,
        marker=style.marker, markersize=4.5, markevery=((1 + 2 * index) * every // 7, every),
        markeredgecolor="white", markeredgewidth=0.5, zorder=2.5 if is_broken else 2,
    )  # fmt: skip
