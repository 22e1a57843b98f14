"""Names of models, lesions, tasks and metrics in words."""

from __future__ import annotations

import re
import textwrap
from typing import Protocol

from bilateral_rl.policies.lesions import lesion_words

_PREFIXES = {"uni": "Uni", "bi": "Bi", "cc": "CC"}
_AXIS_CHARACTERS = 20
"""Longest line of an axis label: it fits beside the lowest panel."""
_LESION_CHARACTERS = 9
"""Longest line below one of eight columns: "callosum," fits."""


class MetricLike(Protocol):
    """What a figure needs of a metric."""

    @property
    def name(self) -> str:
        """Name in the table of results."""

    @property
    def label(self) -> str:
        """Words for axes, without the unit."""

    @property
    def unit(self) -> str:
        """Unit of the values; empty for pure numbers."""


def with_unit(metric: MetricLike) -> str:
    """Return the metric in words with its unit."""
    return f"{metric.label} ({metric.unit})" if metric.unit else metric.label


def axis_label(metric: MetricLike) -> str:
    """Return the metric in words with its unit, in short lines."""
    text = re.sub(r"(\d) (?=\w)", "\\1\u00a0", with_unit(metric))  # a number stays with its unit
    return textwrap.fill(text, _AXIS_CHARACTERS, break_long_words=False)


def model_label(name: str) -> str:
    """Return the paper's spelling of a model, ``Uni-DL`` for ``uni_dl``; other names stay as they are."""
    prefix, _, rest = name.partition("_")
    return f"{_PREFIXES[prefix]}-{rest.upper()}" if prefix in _PREFIXES and rest else name


def task_label(name: str) -> str:
    """Return a task in words, as the beginning of a title."""
    return name.replace("_", " ").capitalize()


def lesion_label(name: str) -> str:
    """Return a lesion in words, in short lines."""
    return textwrap.fill(lesion_words(name), _LESION_CHARACTERS, break_long_words=False)
