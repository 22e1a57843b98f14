"""How the hemispheres of models specialize while they are trained."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter

from bilateral_rl.analysis.floor import AT_FLOOR, is_above
from bilateral_rl.analysis.results import FRESH, TRAINED
from bilateral_rl.analysis.specialization import ALONE, specialization_index
from bilateral_rl.envs.tasks import TaskLike, make_task
from bilateral_rl.figures.curves import PREFERRED, PROGRESS, carried_forward, interval_over_seeds
from bilateral_rl.figures.hemispheres import DOMINANT_STYLE, NON_DOMINANT_STYLE
from bilateral_rl.figures.labels import axis_label, model_label, task_label
from bilateral_rl.figures.protocols import CONTROL_COLOR
from bilateral_rl.figures.style import (
    FAINT,
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
_INDEX, _INDEX_STYLE = "index", ModelStyle(INK, "o", "-")
_FLOOR = "At the floor: neither hemisphere alone is better than that of fresh networks."
_PROGRESS = "timesteps"


def specialization_over_training(probes: pd.DataFrame, task: TaskLike) -> Figure:
    """Draw what each hemisphere does alone as its network learns, and the specialization index, a column a model.

    The index is that of :func:`bilateral_rl.analysis.specialization.specialization_index`, but none where neither
    hemisphere does better than the control's (:func:`bilateral_rl.analysis.floor.is_above`). Means over the seeds, as
    in :func:`~bilateral_rl.figures.curves.learning_curves`.

    Args:
        probes: tables of :func:`bilateral_rl.training.probe_table.read_probes`, with each seed of a model once and at
            most four models.
        task: the task that they learned.
    """
    learned = make_task(task)
    models, measure = in_order(probes["model"]), PREFERRED[learned.judged_by]
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
        fresh = {lesion: control[control["lesion"] == lesion].set_index("seed")[measure.name]
                 for lesion in ALONE.values()}  # fmt: skip
        _draw_control(above[i], fresh)
        floor = _at_floor(values, fresh)
        _draw(below[i], index.mask(floor, axis=0), _INDEX_STYLE, _INDEX)
        _mark_floor(below[i], floor)
        below[i].axhline(0, color=INK, linewidth=0.8, linestyle=(0, (5, 3)))
        style_axes(above[i], y_label=axis_label(measure) * (i == 0), title=model_label(model))
        style_axes(below[i], PROGRESS[_PROGRESS], "Specialization index\n← non-dominant · dominant →" * (i == 0))
        below[i].xaxis.set_major_formatter(EngFormatter())
    above[0].set_ylim(bottom=0)
    below[0].set_ylim(-1.05, 1.05)
    entries = _legend([*above, *below])
    set_title_and_legend(
        figure, f"{task_label(learned.id)}: specialization over training", [*entries.values()], [*entries.keys()]
    )
    meaning = "Index: (d − n) / (d + n); d, n: value with the dominant, the non-dominant hemisphere alone."
    floor_note = f"\n{_FLOOR}" if AT_FLOOR in entries else ""
    set_note(figure, f"{meaning}{floor_note}\n{_seeds_in_words(probes)}")
    return figure


def _legend(panels: Iterable[Axes]) -> dict[str, Artist]:
    """Everything with a label but the index, which has panels of its own."""
    entries = {
        label: handle for axes in panels for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    return {label: handle for label, handle in entries.items() if label != _INDEX}


def _draw_control(axes: Axes, fresh: Mapping[str, pd.Series]) -> None:
    """Draw what each side alone does in fresh networks, the mean over the seeds."""
    for values in fresh.values():
        if values.notna().any():
            axes.axhline(
                values.mean(), color=CONTROL_COLOR, linewidth=1.2, zorder=1.5, label="fresh side alone", gid="control"
            )


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
    """Shade where there is no index, from half way to the point before to half way to the next."""
    steps, floored = floor.index.to_numpy(dtype=np.float64), floor.to_numpy()
    edges = np.concatenate([steps[:1], (steps[1:] + steps[:-1]) / 2, steps[-1:]])
    starts = np.flatnonzero(floored & ~np.append(False, floored[:-1]))
    ends = np.flatnonzero(floored & ~np.append(floored[1:], False))
    for start, end in zip(starts, ends, strict=True):
        axes.axvspan(edges[start], edges[end + 1], color=FAINT, linewidth=0, zorder=0, label=AT_FLOOR, gid="floor")


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
