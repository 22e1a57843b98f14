"""How the hemispheres of models specialize while they are trained."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter

from bilateral_rl.analysis.floor import AT_FLOOR, is_above
from bilateral_rl.analysis.results import FRESH, TRAINED
from bilateral_rl.analysis.specialization import ALONE, specialization_index
from bilateral_rl.figures.curves import PREFERRED, PROGRESS, carried_forward, interval_over_seeds
from bilateral_rl.figures.hemispheres import DOMINANT_STYLE, NON_DOMINANT_STYLE
from bilateral_rl.figures.labels import axis_label, model_label, task_label
from bilateral_rl.figures.style import (
    INK,
    ModelStyle,
    in_order,
    new_figure,
    set_note,
    set_title_and_legend,
    style_axes,
)
from bilateral_rl.io.text import seed_counts
from bilateral_rl.policies.lesions import INTACT

_LESIONS = {
    INTACT: ("intact", ModelStyle(INK, "^", (0, (1, 1)))),
    ALONE["dominant"]: ("dominant alone", DOMINANT_STYLE),
    ALONE["non_dominant"]: ("non-dominant alone", NON_DOMINANT_STYLE),
}
"""The lesions that are drawn: their words and their look."""
_INDEX_STYLE = ModelStyle(INK, "o", "-")
_PROGRESS = "timesteps"


def specialization_over_training(probes: pd.DataFrame, task: str) -> Figure:
    """Draw what each hemisphere does alone as its network learns, and the specialization index, a column a model.

    The index is that of :func:`bilateral_rl.analysis.specialization.specialization_index`, but none where neither
    hemisphere does better than the control's (:func:`bilateral_rl.analysis.floor.is_above`). Means over the seeds, as
    in :func:`~bilateral_rl.figures.curves.learning_curves`.

    Args:
        probes: tables of :func:`bilateral_rl.training.lesion_probe.read_probes`, with each seed of a model once and at
            most four models.
        task: the task that they learned.
    """
    models, measure = in_order(probes["model"]), PREFERRED[task]
    figure = new_figure(5.2)
    above, below = figure.subplots(2, len(models), sharex=True, sharey="row", squeeze=False)
    for i, model in enumerate(models):
        rows = probes[(probes["model"] == model) & (probes["network"] == TRAINED)]
        control = probes[(probes["model"] == model) & (probes["network"] == FRESH)]
        values = {lesion: carried_forward(rows[rows["lesion"] == lesion], measure.name, _PROGRESS)
                  for lesion in _LESIONS}  # fmt: skip
        for lesion, (words, style) in _LESIONS.items():
            _draw(above[i], values[lesion], style, words)
        dominant, non_dominant = (values[lesion] for lesion in ALONE.values())
        index = pd.DataFrame(specialization_index(dominant, non_dominant), dominant.index)
        floor = _at_floor(values, {lesion: control[control["lesion"] == lesion].set_index("seed")[measure.name]
                                   for lesion in ALONE.values()})  # fmt: skip
        _draw(below[i], index.mask(floor, axis=0), _INDEX_STYLE, "index")
        _mark_floor(below[i], floor)
        below[i].axhline(0, color=INK, linewidth=0.8, linestyle=(0, (5, 3)))
        style_axes(above[i], y_label=axis_label(measure) * (i == 0), title=model_label(model))
        style_axes(below[i], PROGRESS[_PROGRESS], "Specialization index\n← non-dominant · dominant →" * (i == 0))
        below[i].xaxis.set_major_formatter(EngFormatter())
    above[0].set_ylim(bottom=0)
    below[0].set_ylim(-1.05, 1.05)
    set_title_and_legend(
        figure, f"{task_label(task)}: specialization over training", *above[0].get_legend_handles_labels()
    )
    meaning = "Index: (d − n) / (d + n); d, n: value with the dominant, the non-dominant hemisphere alone."
    set_note(figure, f"{meaning}\n{_seeds_in_words(probes)}")
    return figure


def _at_floor(values: Mapping[str, pd.DataFrame], control: Mapping[str, pd.Series]) -> pd.Series:
    """Return at which points of progress neither hemisphere alone does better than the control's."""
    intact = values[INTACT]
    above = []
    for lesion in ALONE.values():
        fresh, rows = control[lesion].reindex(intact.columns), values[lesion].reindex(intact.index)
        above.append(
            [is_above(row, fresh, whole) for row, whole in zip(rows.to_numpy(), intact.to_numpy(), strict=True)]
        )
    return pd.Series([one is False and other is False for one, other in zip(*above, strict=True)], intact.index)


def _mark_floor(axes: Axes, floor: pd.Series) -> None:
    """Say where there is no index, from half way to the point before to half way to the next."""
    steps = floor.index.to_numpy(dtype=np.float64)
    if not floor.any() or len(steps) < 2:
        return
    middles = (steps[1:] + steps[:-1]) / 2
    left, right = np.append(steps[0], middles), np.append(middles, steps[-1])
    for low, high in zip(left[floor.to_numpy()], right[floor.to_numpy()], strict=True):
        axes.axvspan(low, high, color=INK, alpha=0.12, linewidth=0, gid="floor")
    middle = float(np.mean([left[floor.to_numpy()].min(), right[floor.to_numpy()].max()]))
    axes.text(middle, -0.9, AT_FLOOR, ha="center", va="bottom", fontsize=8, color=INK)


def _draw(axes: Axes, values: pd.DataFrame, style: ModelStyle, label: str) -> None:
    """Draw the mean over the columns of ``values``, the seeds, and its interval."""
    x, mean, low, high = interval_over_seeds(values)
    axes.fill_between(x, low, high, color=style.color, alpha=0.2, linewidth=0)
    axes.plot(
        x, mean, color=style.color, linestyle=style.line, linewidth=1.6, label=label, gid=label,
        marker=style.marker, markersize=4.5, markevery=max(1, len(x) // 8),
        markeredgecolor="white", markeredgewidth=0.5,
    )  # fmt: skip


def _seeds_in_words(probes: pd.DataFrame) -> str:
    counts = probes.groupby("model")["seed"].nunique()
    if counts.max() == 1:
        return "One seed each." if len(counts) > 1 else "One seed."
    return f"Line and band: mean of {seed_counts(counts)} and its 95 % confidence interval."
