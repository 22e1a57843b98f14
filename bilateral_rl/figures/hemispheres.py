"""Figures of trials: what each hemisphere contributes to the commands."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from bilateral_rl.analysis.formats import fixed
from bilateral_rl.analysis.modulation import Contributions, Floating, modulation_of, varying
from bilateral_rl.figures.bands import BANDS_NOTE, draw_band
from bilateral_rl.figures.labels import model_label
from bilateral_rl.figures.style import (
    INK,
    NOTE_SIZE,
    ModelStyle,
    in_order,
    new_figure,
    set_note,
    set_title_and_legend,
    style_axes,
)

DOMINANT_STYLE = ModelStyle("#01665e", "o", "-")
NON_DOMINANT_STYLE = ModelStyle("#c98a2b", "s", (0, (4, 1.5)))
_NOTE = (
    "Contribution: what a side adds to the commands before the sigmoid, mean over the muscles. What varies: the same "
    "without each muscle's mean. In all: share of the modulation, its standard deviation over time and trials."
)


def dominant_share(sides: Contributions) -> NDArray[np.float64]:
    """(n, T) percent of what varies in the contributions that is the dominant side's; NaN where nothing varies.

    Each muscle's mean over all trials and steps is left out: a constant is no control, and a saturated side gives
    little else, however large it is.
    """
    dominant, non_dominant = (_magnitude(varying(side)) for side in sides)
    total = dominant + non_dominant
    return 100 * np.divide(dominant, total, out=np.full_like(total, np.nan), where=total > 0)


def hemisphere_activity(sides: Mapping[str, Contributions], timestep: float, title: str) -> Figure:
    """Draw the mean absolute contribution of each hemisphere over time, a column a model.

    Below stands the dominant side's share of what varies in them (:func:`dominant_share`), and in words that of the
    modulation (:class:`~bilateral_rl.analysis.modulation.SideModulation`).

    Args:
        sides: contributions in the trials of one or more seeds, by model; at most four models.
        timestep: length of a step (s).
        title: title of the figure, with the task.
    """
    models = in_order(sides)
    figure = new_figure(4.6)
    above, below = figure.subplots(2, len(models), sharex=True, sharey="row", squeeze=False)
    for i, model in enumerate(models):
        time = 1000 * timestep * np.arange(sides[model].dominant.shape[1])
        draw_band(above[i], time, _magnitude(sides[model].dominant), DOMINANT_STYLE, "dominant")
        draw_band(above[i], time, _magnitude(sides[model].non_dominant), NON_DOMINANT_STYLE, "non-dominant")
        draw_band(below[i], time, dominant_share(sides[model]), DOMINANT_STYLE, "dominant")
        _write_share(below[i], modulation_of(sides[model]).percent["dominant"])
        below[i].axhline(50, color=INK, linewidth=0.8, linestyle=(0, (5, 3)))
        style_axes(above[i], y_label="Mean absolute\ncontribution (a.u.)" * (i == 0), title=model_label(model))
        style_axes(below[i], "Time (ms)", "Dominant side's share\nof what varies (%)" * (i == 0))
    above[0].set_ylim(bottom=0)
    below[0].set_ylim(0, 100)
    set_title_and_legend(figure, title, *above[0].get_legend_handles_labels())
    set_note(figure, f"{_NOTE}\n{BANDS_NOTE}")
    return figure


def _write_share(axes: Axes, percent: float) -> None:
    """Write the share of the whole modulation (%) where its line does not run."""
    height = 0.04 if percent > 25 else 0.88
    words = f"in all {fixed(percent, 0)} %"
    axes.text(0.5, height, words, transform=axes.transAxes, ha="center", fontsize=NOTE_SIZE, color=INK)


def _magnitude(contribution: Floating) -> NDArray[np.float64]:
    """Return the mean absolute value over the muscles: (n, T, 6) to (n, T)."""
    return np.asarray(np.abs(contribution).mean(axis=2, dtype=np.float64))
