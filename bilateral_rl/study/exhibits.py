"""What a report shows beside the claims: tables, figures, and the metrics that they are of."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

from bilateral_rl.analysis.metric import Metric
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.study.drawing import Drawing
from bilateral_rl.study.report_table import ReportTable

Runs: TypeAlias = Mapping[str, Mapping[str, list[RunFolder]]]
"""The runs that are done, by task and model."""


@dataclass(frozen=True)
class Exhibits:
    """Of the first reading."""

    tables: Sequence[ReportTable]
    drawings: Iterable[Drawing]
    """Drawn one by one, when they are asked for."""
    metrics: Sequence[Metric]
    """What they are of."""
    radii: Mapping[str, float] = field(default_factory=dict)
    """Radius of the goal by task (m)."""
