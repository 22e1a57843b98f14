"""What each hand of two does after each lesion: that of the lesioned hemisphere fails, and the other one may not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from bilateral_rl.analysis.hands import contralesional_hand
from bilateral_rl.analysis.intervals import Interval
from bilateral_rl.analysis.metric import Metric, Role, of_hands
from bilateral_rl.analysis.results import State, protocol_words, protocols_in
from bilateral_rl.figures.hands import HAND_STYLES, hand_label, spring_in_words
from bilateral_rl.figures.labels import axis_label, model_label, task_label
from bilateral_rl.figures.lesion_places import (
    WIDTH,
    Column,
    column_of,
    control_handle,
    draw_places,
    has_control,
    label_places,
    lesions_in,
    style_handle,
)
from bilateral_rl.figures.seeds import marks_in_words
from bilateral_rl.figures.style import ModelStyle, new_figure, set_note, set_title_and_legend, style_axes
from bilateral_rl.vocabulary import SIDES, Side

_PANEL_HEIGHT, _REST_HEIGHT, _LEGEND_LINE = 1.6, 1.45, 0.16
"""Heights (inches): of a panel, of what is above and below all, and of a line of the legend."""
_SHADE = "0.9"
_CONTRALESIONAL = "contralesional hand"
_Hands = Mapping[tuple[Side, Role | None], Metric]


def lesioned_hands(results: pd.DataFrame, task: str, metric: Metric, model: str, spring: float) -> Figure | None:
    """Draw a metric of each hand in each role after each lesion, a panel a protocol.

    The half of a place is shaded in which the contralesional hand stands, that opposite to a hemisphere with a deep
    lesion. A short line across a column is the mean of fresh networks that were treated alike.

    Args:
        results: table of :mod:`bilateral_rl.analysis.results`.
        task: which of its tasks.
        metric: what to draw of each hand.
        model: of which of its models.
        spring: stiffness of the spring between the hands (N/m), for the note.

    Returns:
        The figure; None where the table tells no hands apart.
    """
    rows = results[(results["task"] == task) & (results["model"] == model)]
    by_role = of_hands(metric, set(rows["metric"]))
    if not by_role:
        return None
    hands = {(hand, role): of_role[hand] for hand in SIDES for role, of_role in by_role.items()}
    rows = rows[rows["metric"].isin([of_hand.name for of_hand in hands.values()])]
    protocols, lesions = protocols_in(rows), lesions_in(rows)
    figure = new_figure(_REST_HEIGHT + _PANEL_HEIGHT * len(protocols) + _LEGEND_LINE * len(by_role))
    all_axes = figure.subplots(len(protocols), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    means: list[Interval] = []
    shown: list[Column] = []
    for axes, protocol in zip(all_axes, protocols, strict=True):
        states = [State(task, model, lesion, protocol) for lesion in lesions]
        places = [[column_of(rows, of.name, state, _style(*hand)) for hand, of in hands.items()] for state in states]
        means += draw_places(axes, places)
        shown += [column for columns in places for column in columns]
        _shade(axes, lesions)
        style_axes(axes, y_label=axis_label(metric), title=protocol_words(protocol))
    label_places(all_axes[-1], lesions)
    _set_limits(all_axes[-1], shown)
    _set_legend(figure, f"{task_label(task)}, {model_label(model)}: each hand after lesions", hands, rows)
    tied = spring_in_words(spring)
    cut = any(mean.n > 1 and mean.high > all_axes[-1].get_ylim()[1] for mean in means)
    note = [marks_in_words(means), f"{tied} Longer bars are cut off." if cut else tied]
    if any(map(contralesional_hand, lesions)):
        note.append("Contralesional: the hand that the hemisphere with the deep lesion guided, across the body.")
    set_note(figure, "\n".join(note))
    return figure


def _style(hand: Side, role: Role | None) -> ModelStyle:
    return HAND_STYLES[hand, role or "reach"]


def _shade(axes: Axes, lesions: list[str]) -> None:
    """Shade the half of each place in which the contralesional hand stands."""
    for x, lesion in enumerate(lesions):
        if (hand := contralesional_hand(lesion)) is not None:
            left = x - WIDTH / 2 if hand == SIDES[0] else x
            axes.axvspan(left, left + WIDTH / 2, color=_SHADE, linewidth=0, zorder=-1, gid="contralesional")


def _set_limits(axes: Axes, columns: Sequence[Column]) -> None:
    """Let the seeds fill the axis, where the intervals of two or three would reach far beyond what can be."""
    shown = np.array([number for column in columns for number in (column.control, *column.values)], dtype=np.float64)
    shown = shown[np.isfinite(shown)]
    if len(shown):
        axes.set_ylim(min(0.0, 1.1 * shown.min()), max(0.0, 1.1 * shown.max()) or 1.0)


def _set_legend(figure: Figure, title: str, hands: _Hands, rows: pd.DataFrame) -> None:
    """Set the title and a legend with the hands side by side."""
    dominant, non_dominant = (
        [(style_handle(_style(*hand)), hand_label(*hand)) for hand in hands if hand[0] == side] for side in SIDES
    )
    shade: list[tuple[Artist, str]] = []
    if any(map(contralesional_hand, set(rows["lesion"]))):
        shade.append((Patch(color=_SHADE), _CONTRALESIONAL))
    if has_control(rows):  # which has a name so long that the legend has two columns
        entries = [*dominant, *shade, *non_dominant, control_handle()]
    else:
        entries = [*dominant, *non_dominant, *shade]
    handles, words = zip(*entries, strict=True)
    set_title_and_legend(figure, title, handles, words)
