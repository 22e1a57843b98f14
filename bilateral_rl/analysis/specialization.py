"""How far the hemispheres of a network have specialized: what each does alone, and the index of the two."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from bilateral_rl.analysis.results import State, by_seed
from bilateral_rl.vocabulary import Side

ALONE: dict[Side, str] = {"dominant": "deep_non_dominant", "non_dominant": "deep_dominant"}
"""The lesion that leaves one side to work alone (paper section 6)."""


def specialization_index(dominant: ArrayLike, non_dominant: ArrayLike) -> NDArray[np.float64]:
    """(d − n) / (d + n): 1 where only the dominant side can do the task, −1 where only the non-dominant one can.

    The laterality index (Leask & Crow 1997, doi:10.1016/s0028-3932(97)00059-6) of performance. NaN where both are 0 or
    one is NaN.

    Args:
        dominant: (n,) or a number, at least 0: :func:`~bilateral_rl.analysis.metrics.preferred_metric` with the
            non-dominant side lesioned, so that the dominant one works alone.
        non_dominant: the same with the dominant side lesioned, seeds in the same order.
    """
    d, n = np.asarray(dominant, dtype=np.float64), np.asarray(non_dominant, dtype=np.float64)
    return np.asarray((d - n) / np.where(d + n > 0, d + n, np.nan))


def specialization_by_seed(results: pd.DataFrame, metric: str, state: State) -> pd.Series:
    """Return the specialization index of every seed whose two sides were both tested alone, seeds in rising order.

    Args:
        results: long table (:mod:`bilateral_rl.analysis.results`).
        metric: name of a metric of which more is better.
        state: the networks; their lesion does not matter.
    """
    sides = [by_seed(results, metric, state.after(lesion)) for lesion in ALONE.values()]
    both = pd.concat(sides, axis=1, join="inner")
    return pd.Series(specialization_index(both.iloc[:, 0], both.iloc[:, 1]), both.index)
