"""Figures of tables of results in a given axis of matplotlib, in the look of the toolkit's own figures."""

from __future__ import annotations

import pandas as pd
from matplotlib.axes import Axes

from bilateral_rl.analysis.metrics import find_metric, preferred_among
from bilateral_rl.analysis.results import COLUMNS
from bilateral_rl.api.plotting import axes_for, only
from bilateral_rl.api.wording import in_python
from bilateral_rl.envs.tasks import RandomReach, make_task
from bilateral_rl.figures import curves as learning
from bilateral_rl.figures.adaptation import MEASURES, draw_blocks
from bilateral_rl.figures.lesions import draw_lesions
from bilateral_rl.io.errors import UserError

_USUAL_RADIUS = 0.05
"""Radius of the goal (m) at which lesions are drawn if nothing is said."""


@in_python
def plot_lesions(
    results: pd.DataFrame, ax: Axes | None = None, *, metric: str | None = None, model: str | None = None
) -> Axes:
    """Draw what networks do after each lesion, beside each other by what followed it.

    Dots are networks, large markers and bars their mean and its 95 % interval; a short red line is the mean of fresh
    networks that were treated alike, the dashed line that of the intact ones.

    Args:
        results: from :meth:`Run.lesion`, or its ``lesions.csv``.
        ax: where to draw; None for a new figure.
        metric: name of a metric in the table; None for the one that the paper judges the task by, at 5 cm.
        model: which of several models.

    Raises:
        UserError: no such table, or a metric or model that is not in it.
    """
    if not isinstance(results, pd.DataFrame) or not {*COLUMNS} <= {*results.columns} or results.empty:
        raise UserError("--results must be a table of lesions, as `run.lesion()` returns it.")
    task = only("task", results["task"].unique().tolist())
    of_model = only("model", results["model"].unique().tolist(), model, "table")
    found = find_metric(metric or preferred_among(results["metric"].unique(), _USUAL_RADIUS))
    measured = results.loc[results["model"] == of_model, "metric"].unique().tolist()
    if found.name not in measured:
        raise UserError(f"The table has no {found.name}; choose a metric from {', '.join(measured)}.")
    axes = axes_for(ax, (7.0, 3.4))
    draw_lesions(axes, results, task, found, of_model)
    return axes


@in_python
def plot_blocks(blocks: pd.DataFrame, ax: Axes | None = None, *, measure: str = "deviation_at_peak_speed") -> Axes:
    """Draw how networks adapt to a field by block: in the field, with the field off, and in a channel.

    A line is the mean over the seeds, a band its 95 % interval.

    Args:
        blocks: from :meth:`Run.blocks`.
        ax: where to draw; None for a new figure.
        measure: a column of the table, such as "final_error" or "channel_compensation".

    Raises:
        UserError: no such table, or no such column.
    """
    if not isinstance(blocks, pd.DataFrame) or not {"seed", "block", "condition"} <= {*blocks.columns} or blocks.empty:
        raise UserError("--blocks must be a table of blocks, as `run.blocks()` returns it.")
    known = [name for name in MEASURES if name in blocks and blocks[name].notna().any()]
    if measure not in known:
        raise UserError(f"The table has no {measure} by block; choose a measure from {', '.join(known)}.")
    axes = axes_for(ax, (4.5, 3.2))
    draw_blocks(axes, blocks, measure)
    return axes


@in_python
def plot_curves(
    curves: pd.DataFrame, ax: Axes | None = None, *, measure: str | None = None, by_hand: bool = False
) -> Axes:
    """Draw how networks learned: the mean over the seeds of each model, and its 95 % interval.

    Args:
        curves: from :meth:`Run.curves`, or those of several runs of one task and one way to train, by ``pd.concat``.
        ax: where to draw; None for a new figure.
        measure: a column of the table, such as "final_error_cm"; None for the one that the paper judges the task by.
        by_hand: whether there is a line for each hand in each role, of one model of two arms, and not one a model.

    Raises:
        UserError: no such table, or no such column; or by hand several models, or one arm.
    """
    if not isinstance(curves, pd.DataFrame) or not {"model", "task", "seed"} <= {*curves.columns} or curves.empty:
        raise UserError("--curves must be a table of trainings, as `run.curves()` returns it.")
    if sum(curves[name].notna().any() for name in learning.PROGRESS if name in curves) != 1:
        raise UserError("Trainings by epochs and by steps have no axis in common; draw each in one of its own.")
    task = only("task", curves["task"].unique().tolist())
    usual = learning.PREFERRED[_judged_by(task)]
    known = {column.name: column for column in (usual, learning.FINAL_ERROR, learning.VALIDATION_LOSS)}
    name = measure or usual.name
    if name not in curves or not pd.api.types.is_numeric_dtype(curves[name]):
        raise UserError(f"The table has no numbers {name}; choose a measure from its columns.")
    models = curves["model"].unique().tolist()
    if by_hand and len(models) > 1:
        raise UserError(f"There are several models ({', '.join(models)}): draw one of them by hand.")
    if by_hand and not learning.columns_of_hands(curves, name):
        raise UserError(f"The table has no {name} by hand, as trainings of two arms have: leave --by-hand out.")
    axes = axes_for(ax, (5.0, 3.0))
    column = known.get(name, learning.HistoryColumn(name, name.replace("_", " ").capitalize()))
    if by_hand:
        learning.draw_curves_of_hands(axes, curves, column)
    else:
        learning.draw_curves(axes, curves, column)
    return axes


def _judged_by(task: str) -> str:
    """Return what a task is judged by that a table names; one that only its user has counts as one of reaching."""
    try:
        return make_task(task).judged_by
    except ValueError:
        return RandomReach.judged_by
