"""What trials come to by target, condition, phase, hand or role, as a table that fits into the terminal."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd
from rich.table import Table

from bilateral_rl.analysis.formats import mean_sd
from bilateral_rl.analysis.metric import Metric
from bilateral_rl.figures.labels import with_unit

_SHOWN = (
    "final_error", "signed_deviation", "channel_compensation", "reaction_time", "jump_latency", "pulse_deviation",
)  # fmt: skip
"""What is shown of the metrics that there are after the one that the task is judged by; files have all of them."""
_SHOWN_OF_HANDS = ("final_error", "perpendicular_deviation_until_2cm", "hold_rms_error")
"""The same of the hands of two arms."""
_SHORT = {"Goal completion": "reaches", "Perpendicular deviation on the way": "off the straight line"}
"""Words for headings of hands, beside whose columns there is no room for longer ones."""
_MOST = 3
"""So many of them fit into 80 columns."""
_FINE = ("channel_compensation", "effort_per_s")
"""Columns with two decimals."""
_PHASE = {
    "error_cm": "error (cm)", "speed_cm_per_s": "speed (cm/s)", "peak_speed_cm_per_s": "peak (cm/s)",
    "effort_per_s": "effort (1/s)", "force_N": "force (N)",
}  # fmt: skip


def parts_table(parts: pd.DataFrame, metrics: Sequence[Metric], judged_by: str) -> Table:
    """Return a row a part: of the one seed, or mean ± standard deviation over the seeds.

    Args:
        parts: a row a seed and part (:func:`bilateral_rl.analysis.breakdowns.breakdown`), after ``seed``.
        metrics: those that it has columns for.
        judged_by: beginning of the name of the one that the task is judged by.
    """
    by = [name for name in ("target", "condition", "phase", "hand", "role") if name in parts]
    columns = _PHASE if "phase" in by else _chosen(parts, metrics, judged_by)
    of_hands = "hand" in by or "role" in by
    table = Table()
    for label in by:
        table.add_column(label, overflow="fold", no_wrap=of_hands)
    for words in ("trials", *columns.values()):
        table.add_column(words, justify="right", overflow="fold")
    for _, rows in parts.groupby(by, sort=False):
        first = rows.iloc[0]
        names = [str(first[label]) for label in by]
        if "target" in by:
            names[0] = f"{first['target']} ({first['target_angle_deg']:.0f}°)"
        if of_hands:
            names = [name.replace("_", "-") for name in names]
        cells = (mean_sd(rows[column], 2 if column in _FINE else 1) for column in columns)
        table.add_row(*names, str(first["trials"]), *cells)
    if (seeds := parts["seed"].nunique()) > 1:
        table.caption = f"mean ± standard deviation over {seeds} seeds"
    return table


def _chosen(parts: pd.DataFrame, metrics: Sequence[Metric], judged_by: str) -> dict[str, str]:
    """Return the headings of the columns that are shown: those of which any part has a value."""
    by_name = {metric.name: metric for metric in metrics if parts[metric.name].notna().any()}
    judged = [name for name in by_name if name.startswith(judged_by)]
    of_hands = "hand" in parts or "role" in parts
    others = [name for name in (_SHOWN_OF_HANDS if of_hands else _SHOWN) if name in by_name]
    heads = {name: with_unit(by_name[name]) for name in (*judged, *others[:_MOST])}
    if not of_hands:
        return heads
    for words, short in _SHORT.items():
        heads = {name: head.replace(words, short) for name, head in heads.items()}
    return heads
